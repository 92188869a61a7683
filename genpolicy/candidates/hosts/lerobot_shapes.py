"""What a LeRobot policy takes and gives, as its `config.json` says, held against its entry.

Read and not run. `adapters/lerobot_server.py` answers with `predict_action_chunk` as it is, so that
of ACT a chunk has `chunk_size` rows, of Diffusion `n_action_steps`, which begin at the newest of
the `n_obs_steps` observations, inside a `horizon` that begins at the oldest.
"""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NoReturn

from genpolicy.candidates.hosts.kinds import CHECKPOINT_FILES, LeRobotEntry
from genpolicy.candidates.wire.channels import widths_of
from genpolicy.candidates.wire.served import ACTIONS
from genpolicy.contract.observation import ObservationContract
from genpolicy.errors import BadInputError, ConfigError
from genpolicy.integrity.documents import read_json

ACTION = "action"
ROWS = {"act": "chunk_size", "diffusion": "n_action_steps"}
"""By type of policy: the setting that says how many rows its answers have."""
CHUNKS = ("chunk_size", "horizon")
"""Of other types: settings that no answer is longer than."""


def require_shapes(entry: LeRobotEntry, folder: Path, contract: ObservationContract) -> None:
    """Refuse an entry of other inputs, history, columns or rows than the policy has.

    What its `config.json` does not say is held against nothing.

    Args:
        entry: What is declared.
        folder: Of the entry's file.
        contract: The observation in force.

    Raises:
        ConfigError: They differ; both sides are named.
        ContractError: The entry names what the observation does not have.
    """
    try:
        found = read_json(folder / entry.pretrained_model / CHECKPOINT_FILES[0])
    except BadInputError:
        return  # refused by name where files are verified and read
    config = _map(found)
    _require_inputs(entry, config, widths_of(entry, contract))
    _require_columns(entry, config)
    _require_rows(entry, config)


def _require_inputs(
    entry: LeRobotEntry, config: Mapping[str, Any], widths: Mapping[str, int]
) -> None:
    features = _map(config.get("input_features"))
    taken = {name: _size(features[name]) for name in features if not name.startswith(ACTION)}
    if taken:
        given = [*entry.observation, *(name for name in entry.constants if name in taken)]
        if set(given) != set(taken):
            _refuse(entry, "observation", ", ".join(sorted(given)), ", ".join(sorted(taken)))
    for name, width in widths.items():
        size = taken.get(name)
        if size is not None and size != width:
            _refuse(entry, f"observation.{name}", f"{width} numbers", f"{size} numbers")
    steps = _number(config.get("n_obs_steps"))
    for name, part in entry.observation.items():
        if steps is not None and part.history != steps:
            _refuse(entry, f"observation.{name}.history", str(part.history), f"n_obs_steps {steps}")


def _require_columns(entry: LeRobotEntry, config: Mapping[str, Any]) -> None:
    if entry.action.key != ACTIONS:
        _refuse(entry, "action.key", repr(entry.action.key), f"{ACTIONS!r} from its adapter")
    size = _size(_map(config.get("output_features")).get(ACTION))
    if size is not None and size < entry.action.width:
        _refuse(
            entry, "action", f"{entry.action.width} columns at least", f"{size} numbers of {ACTION}"
        )


def _require_rows(entry: LeRobotEntry, config: Mapping[str, Any]) -> None:
    wanted, where = entry.horizons.prediction_horizon, "horizons.prediction_horizon"
    setting = ROWS.get(str(config.get("type")))
    rows = _number(config.get(setting)) if setting else None
    if setting and rows is not None and rows != wanted:
        _refuse(entry, where, str(wanted), f"{setting} {rows}")
    for name in CHUNKS:
        most = _number(config.get(name))
        if most is None:
            continue
        past = (_number(config.get("n_obs_steps")) or 1) - 1 if name == "horizon" else 0
        if wanted + past > most:
            _refuse(
                entry, where, f"{wanted}" + (f" behind {past} of the past" if past else ""),
                f"{name} {most}",
            )  # fmt: skip


def _map(found: object) -> Mapping[str, Any]:
    return found if isinstance(found, dict) else {}


def _number(found: object) -> int | None:
    return found if type(found) is int else None


def _size(feature: object) -> int | None:
    """Numbers of an array; None where its shape is not said."""
    shape = _map(feature).get("shape")
    known = isinstance(shape, list) and all(type(size) is int for size in shape)
    return math.prod(shape) if known and isinstance(shape, list) else None


def _refuse(entry: LeRobotEntry, part: str, said: str, own: str) -> NoReturn:
    raise ConfigError(
        where=f"{part} of the candidate {entry.name}",
        found=said,
        expected=f"{own}, as {entry.pretrained_model}/{CHECKPOINT_FILES[0]} says",
        action="Correct the entry, or bring a policy that was trained so.",
    )
