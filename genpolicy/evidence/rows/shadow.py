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
        margin_layer: That layer; of a candidate that passed the one with the smallest share of a
            limit left, empty where nothing was measured.
        margin_check: The check of it whose margin is kept.
        layer_margin: Its margin: limit minus value, in `margin_unit`.
        margin_unit: Its unit.
        position_change_m: Largest move of a position by projection, m.
        rotation_change_rad: Largest turn by projection, rad.
        boundary_jerk_m_s3: Jerk at the boundary to the previous command, m/s^3.
        outcome_representation: What came of the layer: `passed`, `failed`, `unknown` (a check could
            not be evaluated, which is not passed) or `not_reached`: an earlier one rejected.
        outcome_kinematic: Likewise.
        outcome_geometric: Likewise.
        outcome_dynamic: Likewise.
        outcome_contact: Likewise.
        outcome_fresh: Likewise.
        check_representation: The check that its margin belongs to: of a layer that rejects the one
            it rejects for, of one that passed the tightest by share of its limit, without those
            that ask yes or no or answer in one of two units. Empty where there is none.
        check_kinematic: Likewise.
        check_geometric: Likewise.
        check_dynamic: Likewise.
        check_contact: Likewise.
        check_fresh: Likewise.
        margin_representation: Limit minus value of that check, in its unit. None where the layer
            was not reached or is unknown, where it failed for a number that is none, and where it
            passed and measured nothing, as contact does in free motion.
        margin_kinematic: Likewise.
        margin_geometric: Likewise.
        margin_dynamic: Likewise.
        margin_contact: Likewise.
        margin_fresh: Likewise.
        unit_representation: Unit of that margin; empty without a check.
        unit_kinematic: Likewise.
        unit_geometric: Likewise.
        unit_dynamic: Likewise.
        unit_contact: Likewise.
        unit_fresh: Likewise.
        share_representation: That margin over the size of its limit, by which different units
            compare.
        share_kinematic: Likewise.
        share_geometric: Likewise.
        share_dynamic: Likewise.
        share_contact: Likewise.
        share_fresh: Likewise.
        row_representation: First row that offends against the layer, as `first_row`; None where it
            did not reject.
        row_kinematic: Likewise.
        row_geometric: Likewise.
        row_dynamic: Likewise.
        row_contact: Likewise.
        row_fresh: Likewise.
        margins: Margin of every check in the order of `feasibility.reasons.Reason`, each in its
            unit; NaN where it was not evaluated, infinite where nothing limits it.
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
    margin_layer: str
    margin_check: str
    layer_margin: float | None
    margin_unit: str
    position_change_m: float | None
    rotation_change_rad: float | None
    boundary_jerk_m_s3: float | None
    outcome_representation: str
    outcome_kinematic: str
    outcome_geometric: str
    outcome_dynamic: str
    outcome_contact: str
    outcome_fresh: str
    check_representation: str
    check_kinematic: str
    check_geometric: str
    check_dynamic: str
    check_contact: str
    check_fresh: str
    margin_representation: float | None
    margin_kinematic: float | None
    margin_geometric: float | None
    margin_dynamic: float | None
    margin_contact: float | None
    margin_fresh: float | None
    unit_representation: str
    unit_kinematic: str
    unit_geometric: str
    unit_dynamic: str
    unit_contact: str
    unit_fresh: str
    share_representation: float | None
    share_kinematic: float | None
    share_geometric: float | None
    share_dynamic: float | None
    share_contact: float | None
    share_fresh: float | None
    row_representation: int | None
    row_kinematic: int | None
    row_geometric: int | None
    row_dynamic: int | None
    row_contact: int | None
    row_fresh: int | None
    margins: tuple[float, ...]
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
