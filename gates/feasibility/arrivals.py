"""What reaches the controller stub, and whether every generated action is accounted for."""

from collections.abc import Iterable

import numpy as np
import pandas as pd

from gates.again import changed_since_gate_b
from gates.bounds import counted_interval
from gates.criterion import Measured, criterion
from gates.evidence import Evidence, MissingEvidenceError, counts
from gates.feasibility.settings import HELD_OUT, SHADOW, FeasibilitySettings
from gates.recount import Subset
from gates.words import percent
from genpolicy.evidence.rows.shadow import ShadowCountRow, ShadowStubRow

STUB = f"{SHADOW}/stub.parquet"


@criterion(
    "<=",
    question="How many stale actions arrived at the stub?",
    look_at="Timing: freshness is not enforced before the controller.",
    per_candidate=True,
    always=True,
)
def stub_stale(evidence: Evidence, settings: FeasibilitySettings, candidate: str) -> Measured:
    """Stale actions that arrived at the stub."""
    return _stub(evidence, settings, candidate, "stale")


@criterion(
    "<=",
    question="Does whoever was brought still answer as at Gate B?",
    look_at="Policy process: it is another one than was judged; see what it reads beside files.",
    per_candidate=True,
    always=True,
)
def changed_answers(evidence: Evidence, settings: FeasibilitySettings, candidate: str) -> Measured:
    """Fixtures of Gate B that its server answers otherwise in the shadow test."""
    return changed_since_gate_b(evidence, SHADOW, candidate, ("shadow",))


def at_the_stub(rows: pd.DataFrame, *columns: str) -> tuple[float, float]:
    """Actions of these kinds that arrived at the controller stub, and all that arrived.

    Raises:
        MissingEvidenceError: Nothing arrived, or a count is no number or below zero.
    """
    arrivals = float(counts(rows, "arrivals").sum())
    if arrivals <= 0:
        raise MissingEvidenceError("nothing arrived at the stub")
    return sum(float(counts(rows, column).sum()) for column in columns), arrivals


def require_played(rows: pd.DataFrame, column: str, planned: Iterable[str]) -> None:
    """A count of some conditions says nothing of those that are not in it.

    Raises:
        MissingEvidenceError: A planned condition has no row.
    """
    if absent := sorted(set(planned) - set(rows[column])):
        raise MissingEvidenceError(f"nothing is counted of {', '.join(absent)}")


def _played(evidence: Evidence, settings: FeasibilitySettings, candidate: str) -> pd.DataFrame:
    rows = evidence.of(STUB, ShadowStubRow, candidate)
    require_played(rows, "fixture", (HELD_OUT, *settings.required_fixtures))
    return rows


def _stub(
    evidence: Evidence, settings: FeasibilitySettings, candidate: str, column: str
) -> Measured:
    rows = _played(evidence, settings, candidate)
    bad, arrivals = at_the_stub(rows, column)
    recount = Subset(STUB).summed(rows, (column,), "arrivals")
    return Measured(bad, counted=f"{bad:g} of {arrivals:g} arrivals", recount=recount)


@criterion(
    "<=",
    question="How many invalid actions arrived at the stub?",
    look_at="Feasibility: something bypasses admission.",
    per_candidate=True,
    always=True,
)
def stub_invalid(evidence: Evidence, settings: FeasibilitySettings, candidate: str) -> Measured:
    """Actions of no admitted chunk that arrived at the stub."""
    return _stub(evidence, settings, candidate, "invalid")


@criterion(
    "<=",
    question="How often can something bad still arrive?",
    look_at="Evaluator: too few observations for this bound; run more shadow invocations.",
    per_candidate=True,
    always=True,
)
def stub_violation_upper(
    evidence: Evidence, settings: FeasibilitySettings, candidate: str
) -> Measured:
    """Exact upper bound of the share of observations after which something bad arrives.

    Actions of one observation arrive or fail together, so the observations are the trials.
    """
    rows = _played(evidence, settings, candidate)
    bad, _ = at_the_stub(rows, "stale", "invalid")
    # The same observations are played in every fixture, and deliver at most one chunk in each.
    observations = float(counts(rows, "delivered").max())
    if observations <= 0:
        raise MissingEvidenceError("no observation delivered a chunk")
    bad = min(bad, observations)
    interval = counted_interval(bad, observations, confidence=settings.confidence)
    limit = settings.limits.of.get("stub_violation_upper")
    if bad == 0 and limit and limit.limit is not None and not interval[1] <= limit.limit:
        raise MissingEvidenceError(
            f"none bad of {observations:g} observations that delivered bounds it by "
            f"{percent(interval[1])} only"
        )
    text = f"{bad:g} of {observations:g} observations that delivered; exact upper bound"
    counted = f"{bad:g} of {observations:g} observations"
    return Measured(interval[1], interval, text, counted=counted)


@criterion(
    "<=",
    question="Is every generated action executed, discarded by reason, or queued?",
    look_at="Evaluator: actions vanish or appear; read the counts per fixture.",
    per_candidate=True,
    always=True,
)
def conservation_error(
    evidence: Evidence, settings: FeasibilitySettings, candidate: str
) -> Measured:
    """Actions unaccounted for, over all fixtures."""
    rows = evidence.of(f"{SHADOW}/counts.parquet", ShadowCountRow, candidate)
    require_played(rows, "fixture", (HELD_OUT, *settings.required_fixtures))
    error = unaccounted(rows, ["fixture"])
    if float(rows["generated"].sum()) <= 0:
        raise MissingEvidenceError("nothing was generated")
    return Measured(error, caveat="generated = executed + discarded by reason + still queued")


def unaccounted(frame: pd.DataFrame, keys: list[str]) -> float:
    """Sum over runs of |generated - executed - queued - discarded|.

    Raises:
        MissingEvidenceError: A run states its totals differently in different rows, or a count
            is below zero.
    """
    names = ("generated", "executed", "queued", "count")
    stated = np.stack([counts(frame, name) for name in names], axis=1)
    runs = frame[keys].groupby(keys)
    _, first, member = np.unique(runs.ngroup(), return_index=True, return_inverse=True)
    totals = stated[first, :3]
    other = np.flatnonzero(np.any(stated[:, :3] != totals[member], axis=1))
    if len(other):
        run = [run for run, _ in runs][int(member[other].min())]
        raise MissingEvidenceError(f"{run} states several totals")
    counted = np.bincount(member, weights=stated[:, 3], minlength=len(first))
    return float(sum(abs(totals[:, 0] - totals[:, 1] - totals[:, 2] - counted)))
