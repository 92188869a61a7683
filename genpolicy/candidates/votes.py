"""Earlier predictions of the moments that a new chunk is for: who has a vote, and what is made.

A prediction may speak for a row only where its own chunk could still have been executed there: of
the same unbroken chain, within its horizon, its validity and the largest action age. What voids a
chunk (another phase, calibration or session, a stop, a contact) drops it from the queue, and with
that the chain ends. So no vote brings in what the executor would refuse.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from genpolicy.candidates.joining import (
    BIDIRECTIONAL,
    BLENDS,
    ENSEMBLE_NEWEST,
    RUNNING_AVERAGE,
    JoiningSettings,
)
from genpolicy.candidates.selector import propose
from genpolicy.contract.action import ACTION_DIM, ROTATION
from genpolicy.contract.chunk import Candidate, ChunkMetadata, Proposal
from genpolicy.contract.rotation import rotation_from_6d, rotation_to_6d

Array = NDArray[np.float64]

NS_PER_S = 1_000_000_000
LEVER_M = 0.1
"""Arm by which a turn counts as a distance: about what a hand reaches beyond its flange, m."""
BLEND = "blend"
"""What the id of a blend ends with, behind the id of its invocation."""


@dataclass(frozen=True)
class Prediction:
    """What an earlier invocation drew, and what became of it.

    Attributes:
        invocation: Id of the invocation.
        metadata: Of the chunk that entered the queue; a blend's has an id of its own.
        drawn: The sample itself, before it was joined or projected. Shape (K, D_a).
        commanded: The admitted actions. Shape (K, D_a).
    """

    invocation: str
    metadata: ChunkMetadata
    drawn: Array
    commanded: Array


@dataclass(frozen=True)
class Now:
    """What holds where a vote is asked for.

    Attributes:
        metadata: Of the new chunk.
        execution_horizon: Actions of a chunk that may be executed.
        maximum_age_ns: Largest action age in the new chunk's phase, ns.
    """

    metadata: ChunkMetadata
    execution_horizon: int
    maximum_age_ns: int


class Asked(NamedTuple):
    """One question: may this prediction's row speak for a row of the new chunk?

    Attributes:
        before: The prediction.
        now: The new chunk, and what holds.
        due_ns: When the new chunk's row is due.
        linked: Whether the chain of predecessors leads to it.
    """

    before: Prediction
    now: Now
    due_ns: int
    linked: bool

    @property
    def row(self) -> float:
        """Row of the prediction that is due then."""
        own = self.before.metadata
        return (self.due_ns - _ns(own.action_start_time_s)) / _ns(own.action_period_s)


class Holds(Protocol):
    """An answer to a question."""

    def __call__(self, asked: Asked, /) -> bool:
        """Whether it may."""


class VoteCheck(NamedTuple):
    """One row of the table: its name, and whether it holds."""

    name: str
    holds: Holds


def _young(asked: Asked) -> bool:
    condition_ns = _ns(asked.before.metadata.condition_observation_event_time_s)
    return asked.due_ns - condition_ns <= asked.now.maximum_age_ns


VOTE_CHECKS = (
    VoteCheck("chain", lambda asked: asked.linked),
    VoteCheck("horizon", lambda asked: asked.row < asked.now.execution_horizon),
    VoteCheck("valid", lambda asked: asked.due_ns <= _ns(asked.before.metadata.valid_until_s)),
    VoteCheck("age", _young),
)
"""Who has a vote; a mutant is the tuple minus one row."""


@dataclass(frozen=True)
class Votes:
    """Rows of one earlier prediction that speak for rows of a new chunk.

    Attributes:
        before: The prediction.
        first: First row of the new chunk that it speaks for.
        stop: Row behind the last one.
        shift: Its own row is the new chunk's row plus this.
    """

    before: Prediction
    first: int
    stop: int
    shift: int

    def rows(self, actions: Array) -> Array:
        """Its actions for these rows. Shape (stop - first, D_a)."""
        return actions[self.first + self.shift : self.stop + self.shift]


class Past:
    """Predictions whose chunks entered the queue, oldest first.

    Args:
        checks: The table.
    """

    def __init__(self, checks: Sequence[VoteCheck] = VOTE_CHECKS) -> None:
        self._checks = tuple(checks)
        self._kept: list[Prediction] = []

    def note(self, prediction: Prediction) -> None:
        """A chunk has entered the queue; what no row of a later one can meet is forgotten."""
        begun_ns = _ns(prediction.metadata.action_start_time_s)
        self._kept = [one for one in self._kept if _end_ns(one) > begun_ns]
        self._kept.append(prediction)

    def votes(self, now: Now, *, first: int) -> list[Votes]:
        """Who speaks for rows of a new chunk, oldest first.

        Args:
            now: The new chunk, and what holds.
            first: First row of it that can still be executed.
        """
        linked = self._linked(now.metadata.predecessor_chunk_id)
        found = (
            self._of(prediction, now, first=first, linked=prediction.metadata.chunk_id in linked)
            for prediction in self._kept
        )
        return [vote for vote in found if vote is not None]

    def _linked(self, chunk_id: str) -> set[str]:
        """Ids along the chain of predecessors."""
        before = {one.metadata.chunk_id: one.metadata.predecessor_chunk_id for one in self._kept}
        found: set[str] = set()
        while chunk_id and chunk_id not in found:
            found.add(chunk_id)
            chunk_id = before.get(chunk_id, "")
        return found

    def _of(self, prediction: Prediction, now: Now, *, first: int, linked: bool) -> Votes | None:
        old, new = prediction.metadata, now.metadata
        period_ns, start_ns = _ns(new.action_period_s), _ns(new.action_start_time_s)
        shift_ns = start_ns - _ns(old.action_start_time_s)
        if shift_ns < 0 or shift_ns % period_ns or _ns(old.action_period_s) != period_ns:
            return None
        shift, stop = shift_ns // period_ns, first
        while stop + shift < len(prediction.drawn) and all(
            check.holds(Asked(prediction, now, start_ns + stop * period_ns, linked))
            for check in self._checks
        ):
            stop += 1
        return Votes(prediction, first, stop, shift) if stop > first else None


def blend(candidate: Candidate, votes: Sequence[Votes], joining: JoiningSettings) -> Proposal:
    """The weighted mean of all predictions of each row: a chunk of its own, without authority.

    Weights are exp(-decay i), i = 0 at the oldest prediction of a row or at the newest; of the
    running average, `newest` of each prediction and the rest of what was before it. Rotations are
    averaged in their two columns and made orthonormal again; where the mean is no rotation the
    row is NaN, and the first layer refuses it.

    Args:
        candidate: The new prediction.
        votes: Earlier ones, oldest first, at least one.
        joining: Rule and weights.
    """
    own = candidate.actions
    blended = np.array(own)
    if own.ndim == 2 and own.shape[1] == ACTION_DIM:
        for row in range(min(vote.first for vote in votes), min(len(own), _last(votes))):
            said = [
                vote.before.drawn[row + vote.shift]
                for vote in votes
                if vote.first <= row < vote.stop
            ]
            blended[row] = _mean([*said, own[row]], joining)
    metadata = _renamed(candidate.metadata)
    return Proposal(metadata=metadata, actions=blended, selected_by=joining.rule)


def nearest_first(
    candidates: Sequence[Candidate], votes: Sequence[Votes], joining: JoiningSettings
) -> list[int]:
    """Candidates in the order in which they are tried: the nearest to the previous plan first.

    The distance is the weighted sum of squares over the rows that both speak for; weights are
    exp(-decay i) from the first of them on, and a turn counts by `LEVER_M`. Equal distances leave
    the order of the draw; what has no distance comes last. Without a previous plan: as drawn.

    Args:
        candidates: Of one invocation, as drawn.
        votes: Earlier predictions, oldest first; the newest is the previous plan.
        joining: Decay.
    """
    order = list(range(len(candidates)))
    if not votes:
        return order
    plan = votes[-1]
    away = [_distance(candidate.actions, plan, joining.decay) for candidate in candidates]
    return sorted(order, key=lambda index: (away[index], index))


def join(
    drawn: Sequence[Candidate], index: int, votes: Sequence[Votes], joining: JoiningSettings
) -> Proposal:
    """What is proposed when it is the turn of candidate `index`, by the order of the rule.

    Args:
        drawn: Candidates of one invocation.
        index: Its place in the order.
        votes: Earlier predictions, oldest first.
        joining: The rule.

    Raises:
        ContractError: There is no such candidate.
    """
    if joining.rule == BIDIRECTIONAL:
        index = nearest_first(drawn, votes, joining)[index]
    elif joining.rule in BLENDS and votes:
        return blend(drawn[index], votes, joining)
    return propose(drawn, index)


def rest_of_plan(votes: Sequence[Votes], *, rows: int) -> tuple[Array, Array]:
    """What a new chunk starts from: actions (K, D_a) and their weights (K,), 1 or, of no plan, 0.

    All commands of the previous plan from row 0 on, also those behind its execution horizon; then
    its last one again. Arguments are those of `prefix`.
    """
    actions, weights = np.zeros((rows, ACTION_DIM)), np.zeros(rows)
    if votes:
        said = votes[-1].before.commanded[votes[-1].shift :]
        actions[:], weights[:] = said[np.minimum(np.arange(rows), len(said) - 1)], 1.0
    return actions, weights


def prefix(votes: Sequence[Votes], *, rows: int, frozen: int) -> tuple[Array, Array]:
    """What a new chunk is drawn to go on from: actions (K, D_a) and their weights (K,).

    The previous plan's commands weigh 1 where they will be executed while the policy thinks, then
    c (e^c - 1) / (e - 1) with c falling evenly to 0 behind the last row that it speaks for.

    Args:
        votes: Earlier predictions from row 0 on, oldest first; the newest is the previous plan.
        rows: K.
        frozen: Rows that the previous plan still covers by plan.
    """
    actions, weights = np.zeros((rows, ACTION_DIM)), np.zeros(rows)
    if votes:
        plan = votes[-1]
        said = plan.rows(plan.before.commanded)
        overlap, fixed = len(said), min(frozen, len(said))
        share = (overlap - np.arange(fixed, overlap)) / (overlap - fixed + 1)
        actions[:overlap] = said
        weights[:fixed] = 1.0
        weights[fixed:overlap] = share * np.expm1(share) / math.expm1(1.0)
    return actions, weights


def _last(votes: Sequence[Votes]) -> int:
    return max(vote.stop for vote in votes)


def _renamed(metadata: ChunkMetadata) -> ChunkMetadata:
    changed = {**vars(metadata), "chunk_id": f"{metadata.chunk_id}/{BLEND}"}
    return ChunkMetadata(**changed)


def _mean(said: list[Array], joining: JoiningSettings) -> Array:
    """Mean of the predictions of one row, oldest first. Shapes (D_a,)."""
    weights = _weights(len(said), joining)
    mean: Array = weights @ np.stack(said) / weights.sum()
    mean[ROTATION] = rotation_to_6d(rotation_from_6d(mean[ROTATION]))
    return mean


def _weights(predictions: int, joining: JoiningSettings) -> Array:
    """Of predictions of one row, oldest first. Shape (n,)."""
    ranks = np.arange(predictions, dtype=float)
    if joining.rule == RUNNING_AVERAGE:
        weights: Array = joining.newest * (1.0 - joining.newest) ** ranks[::-1]
        weights[0] = (1.0 - joining.newest) ** ranks[-1]  # nothing was there to blend it into
        return weights
    if joining.rule == ENSEMBLE_NEWEST:
        ranks = ranks[::-1]
    return np.exp(-joining.decay * ranks)


def _distance(actions: Array, plan: Votes, decay: float) -> float:
    own, said = actions[plan.first : plan.stop], plan.rows(plan.before.commanded)
    if own.shape != said.shape:
        return math.inf
    scale = np.ones(ACTION_DIM)
    scale[ROTATION] = LEVER_M
    weights = np.exp(-decay * np.arange(len(said)))
    found = float(weights @ np.sum((scale * (own - said)) ** 2, axis=1))
    return found if math.isfinite(found) else math.inf


def _end_ns(prediction: Prediction) -> int:
    own = prediction.metadata
    return _ns(own.action_start_time_s) + len(prediction.drawn) * _ns(own.action_period_s)


def _ns(time_s: float) -> int:
    return round(time_s * NS_PER_S)
