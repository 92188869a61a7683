"""Rows of shadow: candidates, the stub, the balance of actions, and what stood still."""

from dataclasses import dataclass


@dataclass(frozen=True)
class CandidateRow:
    """`candidates.parquet` of shadow: one candidate at one observation, intact or corrupted.

    Attributes:
        method: The method.
        seed: Number of its training seed.
        fixture: `held_out`, `two_modes` (held-out too, where modes were found), or the corruption.
        situation: Episode and row.
        phase: Task phase.
        observation: Number of the observation.
        candidate: Number of the candidate.
        mode: Mode of the path, as the task names it.
        representation: Whether the layer passed; one that could not be evaluated did not. None
            where it was not reached.
        kinematic: Likewise.
        geometric: Likewise.
        dynamic: Likewise.
        contact: Likewise.
        fresh: Likewise.
        outcome: `passed` by all of them, `failed` at one, or `unknown`: one could not be evaluated.
        first_reason: Check that the first layer failed at, or that could not be evaluated there;
            empty where all passed.
        first_row: First row of the chunk that offends against it, counted from 0 and late ones
            included; None where all passed, and where the array is no chunk.
        layer_margin: Margin of that layer, else the smallest one.
        margin_unit: Its unit.
        position_change_m: Largest move of a position by projection, m.
        rotation_change_rad: Largest turn by projection, rad.
        boundary_jerk_m_s3: Jerk at the boundary to the previous command, m/s^3.
        raw: Actions as sampled, row by row.
        projected: Actions as projected, row by row.
    """

    method: str
    seed: int
    fixture: str
    situation: str
    phase: str
    observation: int
    candidate: int
    mode: str
    representation: bool | None
    kinematic: bool | None
    geometric: bool | None
    dynamic: bool | None
    contact: bool | None
    fresh: bool | None
    outcome: str
    first_reason: str
    first_row: int | None
    layer_margin: float | None
    margin_unit: str
    position_change_m: float | None
    rotation_change_rad: float | None
    boundary_jerk_m_s3: float | None
    raw: tuple[float, ...]
    projected: tuple[float, ...]


@dataclass(frozen=True)
class ShadowStubRow:
    """`stub.parquet` of shadow: what reached the controller stub.

    Attributes:
        method: The method.
        fixture: `held_out`, or the corruption.
        delivered: Chunks handed to the executor.
        arrivals: Actions that reached the stub.
        stale: Of these, older than allowed.
        invalid: Of these, not of a chunk that passed.
    """

    method: str
    fixture: str
    delivered: int
    arrivals: int
    stale: int
    invalid: int


@dataclass(frozen=True)
class ShadowCountRow:
    """`counts.parquet` of shadow: balance of actions, one row a reason of discard.

    Attributes:
        method: The method.
        fixture: `held_out`, or the corruption.
        generated: Actions generated.
        executed: Actions executed.
        queued: Actions left in a queue.
        reason: Why actions were discarded; empty where none was.
        count: How many.
    """

    method: str
    fixture: str
    generated: int
    executed: int
    queued: int
    reason: str
    count: int


@dataclass(frozen=True)
class ShadowHoldRow:
    """`holds.parquet` of shadow: when the executor did not command, and what the supervisor said.

    Attributes:
        method: The method.
        fixture: `held_out`, the corruption, or the incident.
        phase: Task phase of the newest observation that was used.
        event: `hold` is a tick that held; `doubt` one that held because its time was not believed;
            `watchdog` a silence after which the supervisor began to hold; `stop` a protective or
            emergency stop.
        reason: Why: what was empty or discarded, what is wrong with the clock, what stopped.
        count: How often.
    """

    method: str
    fixture: str
    phase: str
    event: str
    reason: str
    count: int
