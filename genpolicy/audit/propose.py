"""Settings for a dataset of one's own: what is near, what is apart, from units and spread.

Every scale is declared, in the units of the data; where a unit says nothing, a share of the
spread of the training data stands in for it. Whatever is proposed here can be overridden in the
`audit` section of the contract, and what was proposed is written beside the verdict.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from genpolicy.audit.forms import forms_of, in_place
from genpolicy.audit.settings import AuditSettings
from genpolicy.contract.observation import ObservationContract
from genpolicy.contract.settings import parse_settings
from genpolicy.data.dataset import Dataset
from genpolicy.data.grips import is_two_valued

# Length that makes another observation; another mode is three of them, and a
# calibration is off from three tenths of one on.
SCALES = {"m": 0.01, "px": 10.0, "rad": 0.05, "N": 5.0}
SPREAD_SHARE = 0.05
APART, SHIFTED = 3.0, 0.3
# The radius grows with the root of the number of components: 1.4 scales in each (RMS).
RADIUS_PER_COMPONENT = 1.4
OWN_BODY = {
    *("tcp", "eef", "ee", "gripper", "joint", "joints", "robot", "robot0", "qpos", "qvel", "arm"),
    *("hand", "force", "torque", "wrench", "velocity", "vel", "state", "proprio", "phase"),
}
CHUNK_S = 0.8
MINIMUM_CHUNK, MAXIMUM_CHUNK = 8, 64
# Two routes can only lie apart by what was travelled: a chunk covers three times that distance.
TRAVELLED = 3.0
LENGTHS = ("m", "px")
FORMS = ("action_forms", "action_gains", "action_offsets")


def propose_settings(
    dataset: Dataset,
    overrides: Mapping[str, Any] | None = None,
    *,
    source: Mapping[str, Any] | None = None,
) -> AuditSettings:
    """Settings of an audit from what the manifest says of the data.

    Args:
        dataset: A verified dataset.
        overrides: Settings that the user states; they win.
        source: The import contract as plain values; that of the manifest if absent.

    Returns:
        Settings with every scale filled in.

    Raises:
        ConfigError: An override that does not exist or does not fit.
    """
    source = source or dataset.manifest.get("import_contract") or {}
    contract = dataset.observation_contract
    stated = {**(source.get("audit") or {}), **(overrides or {})}
    paired: Mapping[str, str] = source.get("pairing") or {}
    training = dataset.split("train").frames
    pairing = _route(dataset, contract, paired)
    values: dict[str, Any] = {
        "position_channel": None,
        "position_components": list(pairing.values()) or None,
        "action_components": list(pairing) or None,
        "reference_channel": None,
        "ignored_channels": [],
        "context_channels": _context(contract, set(paired.values())),
        "phase_observed": (source.get("labels") or {}).get("phase") is None,
    }
    values["channel_scale"] = _scales(contract, training.observation)
    values |= _forms(source.get("forms") or {})
    values |= {name: stated[name] for name in FORMS if name in stated}
    placed = _placed(dataset, contract, pairing, values)
    values |= _separations(dataset, contract, pairing, placed)
    values["chunk_rows"] = _chunk_rows(dataset, placed, values["minimum_separation_m"])
    values["persistence_lag_rows"] = values["chunk_rows"]
    values |= {name: value for name, value in stated.items() if name != "channel_scale"}
    values["channel_scale"] |= stated.get("channel_scale", {})
    horizon = int(values.get("observation_horizon", 2))
    used = sum(c.size for c in contract.channels if c.name not in values["ignored_channels"])
    values.setdefault("radius", max(6.0, RADIUS_PER_COMPONENT * float(np.sqrt(horizon * used))))
    return parse_settings(AuditSettings, values, where="contract.yaml: audit")


def _context(contract: ObservationContract, paired: set[str]) -> list[str]:
    """Channels that show the scene: what the robot's own body does follows from the mode.

    Where the body has a stream of its own, everything in it is left out; else names tell.
    """
    body = {
        channel.stream
        for channel in contract.channels
        if paired & {f"{channel.name}.{part}" for part in channel.components}
    }
    alone = {channel.stream for channel in contract.channels} - body
    return [
        channel.name
        for channel in contract.channels
        if not paired & {f"{channel.name}.{part}" for part in channel.components}
        and not (alone and channel.stream in body)
        and not OWN_BODY & set(channel.name.lower().split("_"))
    ]


def _route(
    dataset: Dataset, contract: ObservationContract, paired: Mapping[str, str]
) -> dict[str, str]:
    """The pairs that are one route: lengths where there are two of them, and no hand.

    A turn or a grip beside lengths has its own unit and its own component: its spread must not
    drown two routes.
    """
    units = _units(contract)
    lengths = {a: o for a, o in paired.items() if units.get(o) in LENGTHS}
    if len(lengths) > 1:
        return lengths
    stated = list(dataset.manifest["action_contract"]["components"])
    training = dataset.split("train").frames.action
    moving = {a: o for a, o in paired.items() if not is_two_valued(training[:, stated.index(a)])}
    return moving or dict(paired)


def _units(contract: ObservationContract) -> dict[str, str]:
    return {
        f"{channel.name}.{part}": channel.unit
        for channel in contract.channels
        for part in channel.components
    }


def _forms(stated: Mapping[str, Any]) -> dict[str, Any]:
    """What the import contract says of the action's numbers, where they are no plain places."""
    return {
        "action_forms": {
            name: item["form"] for name, item in stated.items() if item["form"] != "place"
        },
        "action_gains": {
            name: float(item["gain"]) for name, item in stated.items() if item["gain"] != 1.0
        },
        "action_offsets": {
            name: float(item["offset"]) for name, item in stated.items() if item["offset"] != 0.0
        },
    }


def _placed(
    dataset: Dataset,
    contract: ObservationContract,
    pairing: Mapping[str, str],
    values: Mapping[str, Any],
) -> np.ndarray:
    """What pairs of the training data's action, as places; all of it where nothing pairs."""
    frames = dataset.split("train").frames
    stated = list(dataset.manifest["action_contract"]["components"])
    names = list(contract.component_names)
    settings = parse_settings(
        AuditSettings, {name: values[name] for name in FORMS}, where="contract.yaml: forms"
    )
    partners = {name: names.index(seen) for name, seen in pairing.items() if seen in names}
    forms = forms_of(settings, stated, partners)
    action = frames.action
    if forms is not None:
        action = in_place(action, frames.observation, frames.episode, forms)
    return action[:, [k for k, name in enumerate(stated) if not pairing or name in pairing]]


def _chunk_rows(dataset: Dataset, placed: np.ndarray, separation: float) -> int:
    """As many actions as go into 0.8 s, or as it takes to travel far enough to part ways."""
    period_s = float(dataset.manifest["action_contract"]["period_s"])
    frames = dataset.split("train").frames
    inside = np.diff(frames.episode) == 0
    steps = np.linalg.norm(np.diff(placed, axis=0)[inside], axis=1)
    moving = steps[steps > 0.0]
    speed = float(np.median(moving)) if len(moving) else 0.0
    far = TRAVELLED * separation / speed if speed > 0.0 else 0.0
    return int(np.clip(round(max(CHUNK_S / period_s, far)), MINIMUM_CHUNK, MAXIMUM_CHUNK))


def _scales(contract: ObservationContract, observation: np.ndarray) -> dict[str, float]:
    """By unit where it is known, else a share of the middle 90 % of the training data."""
    result = {}
    for channel in contract.channels:
        part = observation[:, contract.slices[channel.name]]
        result[channel.name] = SCALES.get(channel.unit, _spread_scale(part))
    return result


def _spread_scale(values: np.ndarray) -> float:
    low, high = np.quantile(values, [0.05, 0.95], axis=0)
    scale = SPREAD_SHARE * float(np.max(high - low, initial=0.0))
    return scale if scale > 0.0 else 1.0


def _separations(
    dataset: Dataset,
    contract: ObservationContract,
    pairing: Mapping[str, str],
    placed: np.ndarray,
) -> dict[str, float]:
    """Least distance of two modes and of epochs, and the metre, in the unit commanded.

    That is the unit of what is moved: a change or a normalised place has none of its own.
    """
    stated = dataset.manifest["action_contract"]
    known = _units(contract)
    units = {known.get(seen, "") for seen in pairing.values()} or set(stated["units"])
    unit = next(iter(units)) if len(units) == 1 else ""
    scale = SCALES.get(unit, _spread_scale(placed))
    return {
        "minimum_separation_m": APART * scale,
        "calibration_floor_m": SHIFTED * scale,
        "metre": scale / SCALES["m"],
    }
