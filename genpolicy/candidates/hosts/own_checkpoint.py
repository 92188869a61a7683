"""A checkpoint of ours knows what its entry says of it: the two are held against each other.

Nobody but its maker can say most of this of a stranger's policy. Of a checkpoint it is written down
in its `config.json`, so that an entry that says otherwise is wrong, and so would be its card.
"""

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NoReturn

from genpolicy.candidates.described import (
    architecture_of,
    eta_of,
    evaluations_of,
    path_of,
    precision_of,
    tolerance_of,
)
from genpolicy.candidates.hosts.kinds import TrainedEntry
from genpolicy.candidates.wire.declared import DIGEST, Declared
from genpolicy.candidates.wire.entry import Output
from genpolicy.candidates.wire.served import ACTIONS, OBSERVATION
from genpolicy.contract.action import GRIPPER, POSITION, ROTATION, action_contract_hash
from genpolicy.errors import ConfigError
from genpolicy.policies.evaluations import allowed_evaluations
from genpolicy.policies.policy import NetworkPolicy
from genpolicy.policies.settings import SamplerConfig

HORIZONS = ("observation_horizon", "prediction_horizon", "action_period_s")
"""H_e is how chunks are used, not how they are made: a ladder may execute fewer rows."""


@dataclass(frozen=True)
class Said:
    """One thing that both know.

    Attributes:
        item: What it is; of an entry its place there.
        found: What the one says who is refused.
        expected: What the other says.
    """

    item: str
    found: object
    expected: object


def require_as_declared(
    entry: TrainedEntry, policy: NetworkPolicy, *, width: int | None, observation: str | None
) -> None:
    """Refuse an entry that says something else of a checkpoint than the checkpoint itself.

    What the entry is silent about, and what the checkpoint does not know (`cpu_capability`), stays.

    Args:
        entry: What is said of it.
        policy: The checkpoint, loaded.
        width: Numbers of the observation in force; None where they are not known.
        observation: SHA-256 of the observation contract in force, likewise.

    Raises:
        ConfigError: They differ; each difference is named with both sides.
    """
    other = [one for one in _all(entry, policy) if one.found != one.expected]
    if other:
        _refuse(
            f"what the entry of {entry.name} says", other,
            "as `config.json` of its checkpoint says",
            "Correct the entry, or name the checkpoint that it describes.",
        )  # fmt: skip
    config = policy.checkpoint.config
    trained = config.provenance
    in_force = [
        Said(f"numbers of {OBSERVATION}", config.dimensions.observation_dim, width),
        Said("observation contract", trained.observation_contract_sha256, observation),
        Said("action contract", trained.action_contract_sha256, action_contract_hash()),
    ]
    other = [one for one in in_force if one.expected is not None and one.found != one.expected]
    if other:
        _refuse(
            f"what the checkpoint of {entry.name} was trained on", other,
            "as in force here", "Bring one that was trained on what it is given here.",
        )  # fmt: skip


def _all(entry: TrainedEntry, policy: NetworkPolicy) -> Iterator[Said]:
    for name in HORIZONS:
        yield Said(
            f"horizons.{name}", getattr(entry.horizons, name), getattr(policy.horizons, name)
        )
    yield Said("stochastic", entry.stochastic, policy.stochastic)
    yield from _actions(entry.action)
    if entry.declared is not None:
        yield from _declared(entry.declared, policy)


def _actions(said: Output) -> Iterator[Said]:
    """The one action that a checkpoint predicts: absolute places of the TCP, m, and 6D."""
    yield Said("action.key", said.key, ACTIONS)
    if said.joints is not None:
        yield Said("action", "joints", "places of the TCP")
        return
    assert said.position is not None  # an action that is no joints has one
    yield Said("action.motion", said.motion, "absolute")
    yield Said("action.frame", said.frame, "robot_base")
    yield Said("action.position.columns", said.position.columns, list(_columns(POSITION)))
    yield Said("action.position.unit", said.position.unit, "m")
    if said.rotation is None:
        yield Said("action.rotation", "none", "rotation_6d")
    else:
        yield Said("action.rotation.form", said.rotation.form, "rotation_6d")
        yield Said("action.rotation.columns", said.rotation.columns, list(_columns(ROTATION)))
    yield Said("action.gripper.column", said.gripper.column, GRIPPER)
    yield Said("action.gripper.closed", said.gripper.closed, 0.0)
    metres = said.gripper.open_m / (said.gripper.open - said.gripper.closed)
    if not math.isclose(metres, 1.0):
        yield Said("metres in a 1 of action.gripper", round(metres, 6), 1)


def _columns(part: slice) -> range:
    return range(part.start, part.stop)


def _declared(said: Declared, policy: NetworkPolicy) -> Iterator[Said]:
    config, sampler = policy.checkpoint.config, policy.sampler
    own: dict[str, object] = {
        "dataset": config.provenance.dataset_manifest_sha256,
        "training_seed": config.training_seed,
        "architecture": architecture_of(config),
        "parameters": config.parameters["total"],
        "path": path_of(config, sampler),
        "sampler": sampler.name,
        "sampler_steps": sampler.steps,
        "precision": precision_of(policy),
        "batch_rows": sampler.batch_rows,
    }
    if config.provenance.episodes_sha256 is not None:  # of a part of the split; else it is unknown
        own["split"] = config.provenance.episodes_sha256
    for name, value in own.items():
        yield Said(f"declared.{name}", getattr(said, name), value)
    for name, value in (("eta", eta_of(sampler)), ("tolerance", tolerance_of(sampler))):
        if getattr(said, name) is not None and not (value is None and getattr(said, name) == 0.0):
            yield Said(f"declared.{name}", getattr(said, name), value)
    if not _allowed(said.evaluations, sampler):
        yield Said("declared.evaluations", said.evaluations, evaluations_of(sampler))


def _allowed(evaluations: int, sampler: SamplerConfig) -> bool:
    return allowed_evaluations(sampler).nearest(evaluations) == evaluations


def _refuse(where: str, other: Sequence[Said], rule: str, action: str) -> NoReturn:
    found = "; ".join(f"{one.item} {_shown(one.found)}" for one in other)
    expected = "; ".join(f"{one.item} {_shown(one.expected)}" for one in other)
    raise ConfigError(where=where, found=found, expected=f"{expected}, {rule}", action=action)


def _shown(value: object) -> str:
    if isinstance(value, str) and re.fullmatch(DIGEST, value):
        return value  # whole: it is what one writes into the entry
    return repr(value) if isinstance(value, str) else str(value)
