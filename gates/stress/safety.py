"""What must hold whatever is gained: recovery, the stub, the balance, the independent checker."""

from collections.abc import Iterator

import numpy as np
import pandas as pd

from gates.again import changed_since_gate_b
from gates.bounds import counted_interval, share_interval
from gates.criterion import Measured, criterion
from gates.evidence import Evidence, MissingEvidenceError, counts
from gates.feasibility.arrivals import at_the_stub, require_played
from gates.feasibility.proof import checked_violations
from gates.recount import Subset, is_none, is_one, part_said
from gates.stress.recoveries import RECOVERED, RECOVERIES, recoveries
from gates.stress.rollouts import DRILL, JOURNALS, STRESS, StressSettings, within
from gates.words import percent
from genpolicy.evidence.rows.stress import ConservationRow, StressCountRow, StressStubRow

STUB = f"{STRESS}/stub.parquet"


def began_to_recover(evidence: Evidence, settings: StressSettings, candidate: str) -> str:
    """That recovery began, and how often it did; empty where it never did.

    Asked where recovery was declared not to matter.
    """
    rows = recoveries(evidence, settings, candidate)
    return f"recovery began {len(rows):,} times" if len(rows) else ""


@criterion(
    ">=",
    question="When recovery begins, does it help, by more than new samples?",
    look_at="Recovery: read by phase and cause how it ended, and whether the policy went on.",
    per_candidate=True,
    applies=began_to_recover,
)
def recovery_success_lower(
    evidence: Evidence, settings: StressSettings, candidate: str
) -> Measured:
    """Lowest lower bound of the share of entries that recovered, over the conditions.

    An entry is recovered by its own primitive, after which the policy took over and succeeded
    (`RecoveryRow`). Few entries of a condition cannot show that recovery is good there, so a
    condition is judged where as many starts, had each recovered, would show the limit; but enough
    failures can show that it is bad: where the upper bound of another condition is lower, it is
    what is measured. What nobody called for is asked over all conditions together too, since a few
    entries in each would never be judged; and a phase may show that it is bad, whatever others do.
    """
    rows = recoveries(evidence, settings, candidate)
    limit = settings.limits.of.get("recovery_success_lower")
    least = limit.limit if limit and limit.limit is not None else 0.0
    if len(rows) == 0:
        raise MissingEvidenceError("not exercised: recovery began on 0 starts, in any condition")
    found = []
    for where, subset, must_show in _groups(rows):
        part = subset.of(rows)
        starts = part["start"].nunique()
        reach, _ = counted_interval(starts, starts, confidence=settings.confidence)
        enough = must_show and reach >= least
        # Starts show that it is good; that it is bad, rollouts of one start may show together.
        together = not enough and part["perturbation"].nunique() > 1
        units = part["perturbation"] + part["start"].astype(str) if together else part["start"]
        _, lower, upper = share_interval(
            RECOVERED.holds(part),
            units.to_numpy(),
            confidence=settings.confidence,
            favourable=enough,  # the count of what is judged at its better end is rounded up
        )
        bound, end = (lower, "at worst") if enough else (upper, "at best")
        recount = subset.counted(part, RECOVERED)
        share = part_said(recount, "recoveries")
        counted = f"{units.nunique()} rollouts" if together else f"{starts} starts"
        text = f"worst in {where}: {share} on {counted}, {end} {percent(bound)}"
        if enough or bound < least:
            said = Measured(bound, (lower, upper), text, counted=counted, recount=recount)
            found.append((bound, said))
    if not found:
        most = rows.groupby("perturbation")["start"].nunique().max()
        raise MissingEvidenceError(
            f"hardly exercised: recovery began on at most {most} starts of a condition; had each "
            "recovered, less than the limit were shown"
        )
    return min(found, key=lambda one: one[0])[1]


def _groups(rows: pd.DataFrame) -> Iterator[tuple[str, Subset, bool]]:
    """Entries that are judged together, and whether they must show that recovery is good."""
    for condition in sorted(set(rows["perturbation"])):
        yield str(condition), within(RECOVERIES, str(condition)), True
    uncalled = Subset(RECOVERIES, (is_none("perturbation", DRILL),))
    if uncalled.of(rows)["perturbation"].nunique() > 1:
        yield f"all conditions but {DRILL}", uncalled, True
    for phase in sorted(set(rows["phase"])):
        yield f"phase {phase}", Subset(RECOVERIES, (is_one("phase", str(phase)),)), False


@criterion(
    "<=",
    question="Does whoever was brought still answer as at Gate B?",
    look_at="Policy process: it is another one than was judged; see what it reads beside files.",
    per_candidate=True,
    always=True,
)
def changed_answers(evidence: Evidence, settings: StressSettings, candidate: str) -> Measured:
    """Fixtures of Gate B that its server answers otherwise in a condition of the comparison."""
    return changed_since_gate_b(evidence, STRESS, candidate, settings.perturbations)


@criterion(
    "<=",
    question="How many stale or invalid actions reached the stub?",
    look_at="Feasibility: a stale or rejected action reached the controller; stop here.",
    per_candidate=True,
    always=True,
)
def stub_violations(evidence: Evidence, settings: StressSettings, candidate: str) -> Measured:
    """Stale or invalid actions that arrived at the controller stub."""
    rows = evidence.of(STUB, StressStubRow, candidate)
    require_played(rows, "perturbation", settings.perturbations)
    bad, arrivals = at_the_stub(rows, "stale", "invalid")
    counted = f"{bad:g} of {arrivals:g} arrivals"
    recount = Subset(STUB).summed(rows, ("stale", "invalid"), "arrivals")
    return Measured(bad, caveat="stale or invalid", counted=counted, recount=recount)


@criterion(
    "<=",
    question="Is every generated action executed, discarded by reason, or queued?",
    look_at="Evaluator: actions vanish or appear; read the counts per perturbation.",
    per_candidate=True,
    always=True,
)
def conservation_error(evidence: Evidence, settings: StressSettings, candidate: str) -> Measured:
    """Actions unaccounted for: generated - executed - discarded - queued, and by reason."""
    names = ("generated", "executed", "discarded", "queued")
    path = f"{STRESS}/conservation.parquet"
    rows = evidence.of(path, ConservationRow, candidate)
    require_played(rows, "perturbation", settings.perturbations)
    generated, executed, discarded, queued = (counts(rows, name) for name in names)
    if generated.sum() <= 0:
        raise MissingEvidenceError("nothing was generated")
    error = float(np.abs(generated - executed - discarded - queued).sum())
    reasons = evidence.of(f"{STRESS}/counts.parquet", StressCountRow, candidate)
    by_reason = (
        reasons.assign(count=counts(reasons, "count")).groupby("perturbation")["count"].sum()
    )
    stated = rows.assign(discarded=discarded).groupby("perturbation")["discarded"].sum()
    error += float(stated.sub(by_reason, fill_value=0.0).abs().sum())
    return Measured(error, caveat="generated = executed + discarded by reason + still queued")


@criterion(
    "<=",
    question="What does the independent checker find in the journals?",
    look_at="Evaluator: executor and independent checker disagree; read the violations.",
    always=True,
)
def checker_violations(evidence: Evidence, settings: StressSettings) -> Measured:
    """Violations that the independent checker found in the journals."""
    return checked_violations(evidence, STRESS, JOURNALS)
