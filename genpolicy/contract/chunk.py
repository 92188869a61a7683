"""The chunk and its life: Candidate → Proposal → Projected → (Admitted, in `feasibility`).

Every chunk names the observation it rests on, who made it, and until when it may be used.
A step of its life is a new type; there is no way back and none can be skipped.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from genpolicy.errors import ContractError, NonFiniteError
from genpolicy.integrity.hashing import sha256_bytes

Array = NDArray[np.float64]


class DiscardReason(StrEnum):
    """Why a chunk, or the rest of it, was not executed; each reason is counted on its own."""

    EXPIRED = "expired"
    STALE_OBSERVATION = "stale_observation"
    OBSERVATION_DIVERGENCE = "observation_divergence"
    PHASE_TRANSITION = "phase_transition"
    FORCE_EVENT = "force_event"
    COLLISION_EVENT = "collision_event"
    CALIBRATION_MISMATCH = "calibration_mismatch"
    BROKEN_PREDECESSOR = "broken_predecessor"
    RESET = "reset"
    OUT_OF_ORDER = "out_of_order"
    DUPLICATE = "duplicate"
    SUPERSEDED = "superseded"
    CHECKPOINT_MISMATCH = "checkpoint_mismatch"
    SAMPLER_MISMATCH = "sampler_mismatch"
    FUTURE_OBSERVATION = "future_observation"
    QUEUE_OVERFLOW = "queue_overflow"
    INFEASIBLE = "infeasible"
    STOPPED = "stopped"
    INTERVENTION = "intervention"
    END_OF_EPISODE = "end_of_episode"


@dataclass(frozen=True)
class ChunkMetadata:
    """What every chunk carries (design: contracts; chapter 4.2). Times in s, one monotonic clock.

    Attributes:
        chunk_id: Unique in the session.
        condition_observation_event_time_s: When the newest conditioning observation was exposed.
        policy_checkpoint_hash: SHA-256 of the weights.
        sampler_config_hash: SHA-256 of the sampler's settings.
        action_start_time_s: When action 0 of the chunk is due.
        action_period_s: Time between actions.
        valid_until_s: The chunk must not be used after this.
        task_phase: Phase of the conditioning observation.
        calibration_epoch: Calibration of the conditioning observation.
        predecessor_chunk_id: The chunk that this one continues; empty for an explicit re-plan.
        session_epoch: Counts resets; chunks of an earlier session are void.
        method: Name of the method.
        candidate_index: Which candidate of its invocation.
    """

    chunk_id: str
    condition_observation_event_time_s: float
    policy_checkpoint_hash: str
    sampler_config_hash: str
    action_start_time_s: float
    action_period_s: float
    valid_until_s: float
    task_phase: str
    calibration_epoch: str
    predecessor_chunk_id: str
    session_epoch: int
    method: str
    candidate_index: int

    def __post_init__(self) -> None:
        if not self.well_typed:
            raise ContractError(
                where=f"metadata of chunk {self.chunk_id!r:.80}",
                found=", ".join(f"{k} a {type(v).__name__}" for k, v in vars(self).items()),
                expected="text for names, whole numbers for counts, s for times",
                action="Reject the chunk and hold.",
            )
        for name in (
            "condition_observation_event_time_s",
            "action_start_time_s",
            "action_period_s",
            "valid_until_s",
        ):
            if not np.isfinite(getattr(self, name)):
                raise NonFiniteError(
                    where=f"chunk {self.chunk_id}: {name}",
                    found=repr(getattr(self, name)),
                    expected="a finite time in s",
                    action="Reject the chunk and hold.",
                )
        if not self.action_period_s > 0:
            raise ContractError(
                where=f"chunk {self.chunk_id}: action_period_s",
                found=repr(self.action_period_s),
                expected="> 0",
                action="Reject the chunk and hold.",
            )

    @property
    def well_typed(self) -> bool:
        """Every field is of its own plain type, so that it can be compared and written down."""
        numbers = ("session_epoch", "candidate_index")
        times = [name for name in self.__dataclass_fields__ if name.endswith("_s")]
        kinds = dict.fromkeys(numbers, (int,)) | dict.fromkeys(times, (int, float))
        return all(
            isinstance(value, kinds.get(name, (str,))) and not isinstance(value, bool)
            for name, value in vars(self).items()
        )


@dataclass(frozen=True)
class Candidate:
    """One sampled chunk of an invocation, before any check.

    Attributes:
        metadata: What it rests on.
        actions: The raw sample, physical units, read-only. Shape (K, D_a).
    """

    metadata: ChunkMetadata
    actions: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "actions", raw_actions(self.actions))


@dataclass(frozen=True)
class Proposal:
    """The candidate that the selector chose, or a blend; still without any authority.

    Attributes:
        metadata: What it rests on; a blend has a chunk_id of its own.
        actions: Raw actions, read-only. Shape (K, D_a).
        selected_by: Name of the selector (`first`, …) or of the combining rule.
    """

    metadata: ChunkMetadata
    actions: Array
    selected_by: str

    def __post_init__(self) -> None:
        object.__setattr__(self, "actions", raw_actions(self.actions))


@dataclass(frozen=True)
class Projected:
    """A proposal after projection; the raw actions stay beside it.

    Attributes:
        proposal: The proposal, unchanged.
        actions: Actions after projection, read-only. Shape (K, D_a).
        position_change_m: Largest position change by the projection, m.
        rotation_change_rad: Largest rotation change by the projection, rad.
    """

    proposal: Proposal
    actions: Array
    position_change_m: float
    rotation_change_rad: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "actions", frozen_array(self.actions))

    @property
    def metadata(self) -> ChunkMetadata:
        """What the chunk rests on."""
        return self.proposal.metadata


def frozen_array(values: Array) -> Array:
    """A read-only float64 copy."""
    copy = np.array(values, dtype=np.float64)
    copy.flags.writeable = False
    return copy


def raw_actions(values: object) -> Array:
    """A read-only float64 copy of what a policy answered, whatever it is.

    What is no array of real numbers (text, bytes, objects, complex numbers, one number, rows of
    unequal length, what fails when it is asked) is an array without a row: the first layer rejects
    it, and nothing is raised.
    """
    try:
        found = np.asarray(values)
    except Exception:  # an object's own `__array__` may raise anything
        found = np.zeros((0, 0))
    real = found.dtype.kind in "fiu" and found.ndim > 0
    return frozen_array(found if real else np.zeros((0, 0)))


def actions_sha256(actions: Array) -> str:
    """SHA-256 of the little-endian float64 bytes of an action array."""
    return sha256_bytes(np.ascontiguousarray(actions, dtype="<f8").tobytes())
