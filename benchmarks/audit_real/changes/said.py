"""Ways of saying one thing: an instruction in many words or in one object, a rotation twice."""

import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from benchmarks.audit_real.changes.change import COLUMNS, Change, Place, free, steady
from benchmarks.audit_real.changes.forms import SAME
from benchmarks.audit_real.motion import wobble
from benchmarks.audit_real.recording import Array, Episode, Recording

VERBS = (
    "go", "pass", "move", "drive", "steer", "swing", "travel", "veer", "sweep", "circle", "lead",
    "carry it",
)  # fmt: skip
SIDES = ("left", "right", "middle", "top")
# How far a tool that points down tilts and turns, rad.
TILT, TURN = 0.03, 0.4


def _told(name: str, text: Callable[[str, np.random.Generator], str], named: str) -> Change:
    """What decides, in a text that has more to say."""

    def apply(recording: Recording, place: Place, strength: float) -> Recording:
        episodes = tuple(
            replace(e, facts={**e.facts, name: text(SIDES[int(way) % len(SIDES)], place.rng)})
            for e, way in zip(recording.episodes, recording.modes, strict=True)
        )
        return replace(recording, episodes=episodes).true(
            decided_by=name, names=(named,),
            undecided=recording.truth.undecided if recording.real else "",
        )  # fmt: skip

    title = "many words decide" if named == "instruction" else "a part of one object decides"
    return Change(
        title, COLUMNS, apply, f"hidden_state({named})",
        fits=lambda r: free(r) and steady(r) and r.layout != "zarr",
    )  # fmt: skip


def _sentence(side: str, rng: np.random.Generator) -> str:
    return f"{VERBS[int(rng.integers(len(VERBS)))]} round the {side} side of it"


def _object(side: str, rng: np.random.Generator) -> str:
    """As robocasa writes it: the instruction among what the simulator knows of a scene."""
    models = [
        {"name": f"obj_{k}", "path": f"objects/{rng.integers(1 << 40)}.xml"} for k in range(9)
    ]
    return json.dumps({"layout_id": int(rng.integers(9)), "object_cfgs": models,
                       "seed": int(rng.integers(1 << 40)), "lang": f"{side} side"})  # fmt: skip


def _tool(recording: Recording, place: Place, written: Callable[[Array, Place], Array],
          names: tuple[str, ...]) -> Recording:  # fmt: skip
    """The rotation of a tool that points down, commanded and observed, in one way."""
    first = next(iter(recording.names))
    column = "obs/tool" if first.startswith("obs/") else f"{first.rpartition('.')[0] or 'obs'}.tool"

    def change(episode: Episode) -> Episode:
        roll = np.pi + wobble(place.rng, len(episode), 1, size=TILT, slow=6.0)[:, 0]
        yaw = np.linspace(0.0, TURN, len(episode))
        angles = np.stack([roll, np.zeros(len(episode)), yaw], axis=1)
        seen = angles + place.rng.normal(0.0, 1e-3, angles.shape)
        action = np.concatenate([episode.action, written(angles, place)], axis=1)
        command = np.concatenate([episode.command, angles[:, [0] * len(names)]], axis=1)
        return replace(
            episode, action=action, command=command,
            seen={**episode.seen, column: written(seen, place)},
        )  # fmt: skip

    return replace(
        recording.each(change), names={**recording.names, column: names},
        follows=(*recording.follows, *(None for _ in names)),
        action_names=(*recording.action_names, *names) if recording.action_names else (),
    )  # fmt: skip


def _wrapped(angles: Array, place: Place) -> Array:
    return (angles + np.pi) % (2.0 * np.pi) - np.pi


def _either_sign(angles: Array, place: Place) -> Array:
    """Quaternions x, y, z, w whose sign is drawn, and drawn again on the way."""
    half = angles / 2.0
    (cr, cy), (sr, sy) = (np.cos(half[:, [0, 2]]).T, np.sin(half[:, [0, 2]]).T)
    turned = np.stack([sr * cy, sr * sy, cr * sy, cr * cy], axis=1)
    begin = int(place.rng.integers(1, len(angles)))
    sign = place.rng.choice([-1.0, 1.0], 2)[(np.arange(len(angles)) >= begin).astype(int)]
    return np.asarray(turned * sign[:, None])


def _absolute(recording: Recording) -> bool:
    return recording.form == "absolute" and not recording.real


SAID = (
    _told("instruction", _sentence, "instruction"),
    _told("ep_meta", _object, "lang"),
    Change(
        "a tool's roll at half a turn", COLUMNS,
        lambda r, place, s: _tool(r, place, _wrapped, ("roll", "pitch", "yaw")), SAME,
        fits=_absolute,
    ),
    Change(
        "commanded quaternions of either sign", COLUMNS,
        lambda r, place, s: _tool(r, place, _either_sign, ("qx", "qy", "qz", "qw")), SAME,
        fits=_absolute,
    ),
)  # fmt: skip
