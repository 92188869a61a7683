"""What must hold whatever is gained: recovery, the stub, the balance, the independent checker."""

from collections.abc import Iterator
from dataclasses import dataclass

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
    failures can speak against it: where the upper bound of another condition is lower, it is
    what is measured. What nobody called for is asked over all conditions together too, since a few
    entries in each would never be judged; and a phase may show that it is bad, whatever others do.

    What speaks against one group keeps the gate from a PASS. Of many groups one does so by luck,
    so that recovery is shown to be bad only where a bound at the level over their number
    (Bonferroni) lies below the limit: the better end of the interval. In between, more starts
    decide.
    """
    rows = recoveries(evidence, settings, candidate)
    limit = settings.limits.of.get("recovery_success_lower")
    least = limit.limit if limit and limit.limit is not None else 0.0
    if len(rows) == 0:
        raise MissingEvidenceError("not exercised: recovery began on 0 starts, in any condition")
    return shown_by(rows, least=least, confidence=settings.confidence)


def shown_by(rows: pd.DataFrame, *, least: float, confidence: float) -> Measured:
    """What entries into recovery show, in whatever group they show least.

    Args:
        rows: Entries of one candidate, at least one; columns of `RecoveryRow`.
        least: The limit.
        confidence: Coverage of an interval of one group.

    Raises:
        MissingEvidenceError: They are too few to show anything.
    """
    groups = list(groups_of(rows))
    asked = [
        group.measured(rows, least=least, among=len(groups), confidence=confidence)
        for group in groups
    ]
    found = [one for one in asked if one is not None]
    if not found:
        most = rows.groupby("perturbation")["start"].nunique().max()
        raise MissingEvidenceError(
            f"hardly exercised: recovery began on at most {most} starts of a condition; had each "
            "recovered, less than the limit were shown"
        )
    # What is shown to be bad is not hidden by what is not shown yet.
    return min(found, key=lambda one: (not one.bad, one.bound)).said


@dataclass(frozen=True)
class Found:
    """What one group shows.

    Attributes:
        bad: Whether it shows that recovery is below the limit.
        bound: What is held against the limit.
        said: The same, as the gate says it.
    """

    bad: bool
    bound: float
    said: Measured


@dataclass(frozen=True)
class Group:
    """Entries that are judged together.

    Attributes:
        where: In words.
        subset: Which they are.
        must_show: Whether they must show that recovery is good, where they can.
    """

    where: str
    subset: Subset
    must_show: bool

    def measured(
        self, rows: pd.DataFrame, *, least: float, among: int, confidence: float
    ) -> Found | None:
        """What the group shows; None where it is too small for either.

        Args:
            rows: All entries of a candidate.
            least: The limit.
            among: How many groups are looked at.
            confidence: Coverage of an interval of one group.
        """
        part = self.subset.of(rows)
        starts = part["start"].nunique()
        reach, _ = counted_interval(starts, starts, confidence=confidence)
        enough = self.must_show and reach >= least
        # Starts show that it is good; that it is bad, rollouts of one start may show together.
        together = not enough and part["perturbation"].nunique() > 1
        units = part["perturbation"] + part["start"].astype(str) if together else part["start"]
        recovered, clusters = RECOVERED.holds(part), units.to_numpy()
        # The count of what is judged at its better end is rounded up.
        _, lower, upper = share_interval(
            recovered, clusters, confidence=confidence, favourable=enough
        )
        bound, end = (lower, "at worst") if enough else (upper, "at best")
        against = bound < least
        if not enough and not against:
            return None
        recount = self.subset.counted(part, RECOVERED)
        share = part_said(recount, "recoveries")
        counted = f"{units.nunique()} rollouts" if together else f"{starts} starts"
        text = f"worst in {self.where}: {share} on {counted}, {end} {percent(bound)}"
        if against:
            wide = 1.0 - (1.0 - confidence) / among
            _, _, upper = share_interval(recovered, clusters, confidence=wide, favourable=False)
            text += f"; as one of {among} groups that are looked at, at best {percent(upper)}"
        said = Measured(bound, (lower, upper), text, counted=counted, recount=recount)
        return Found(against and upper < least, bound, said)


def groups_of(rows: pd.DataFrame) -> Iterator[Group]:
    """By condition, by what nobody called for, and by phase; each looked at by itself."""
    for condition in sorted(set(rows["perturbation"])):
        yield Group(str(condition), within(RECOVERIES, str(condition)), True)
    uncalled = Subset(RECOVERIES, (is_none("perturbation", DRILL),))
    if uncalled.of(rows)["perturbation"].nunique() > 1:
        yield Group(f"all conditions but {DRILL}", uncalled, True)
    for phase in sorted(set(rows["phase"])):
        of_phase = Subset(RECOVERIES, (is_one("phase", str(phase)),))
        yield Group(f"phase {phase}", of_phase, False)


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
    error = unaccounted(evidence, settings, candidate)
    return Measured(error, caveat="generated = executed + discarded by reason + still queued")


def unaccounted(evidence: Evidence, settings: StressSettings, method: str) -> float:
    """Actions of a method that vanished or appeared, over the conditions.

    Raises:
        MissingEvidenceError: A planned condition has no row, or nothing was generated.
    """
    names = ("generated", "executed", "discarded", "queued")
    path = f"{STRESS}/conservation.parquet"
    rows = evidence.of(path, ConservationRow, method)
    require_played(rows, "perturbation", settings.perturbations)
    generated, executed, discarded, queued = (counts(rows, name) for name in names)
    if generated.sum() <= 0:
        raise MissingEvidenceError("nothing was generated")
    error = float(np.abs(generated - executed - discarded - queued).sum())
    reasons = evidence.of(f"{STRESS}/counts.parquet", StressCountRow, method)
    by_reason = (
        reasons.assign(count=counts(reasons, "count")).groupby("perturbation")["count"].sum()
    )
    stated = rows.assign(discarded=discarded).groupby("perturbation")["discarded"].sum()
    return error + float(stated.sub(by_reason, fill_value=0.0).abs().sum())


@criterion(
    "<=",
    question="What does the independent checker find in the journals?",
    look_at="Evaluator: executor and independent checker disagree; read the violations.",
    always=True,
)
def checker_violations(evidence: Evidence, settings: StressSettings) -> Measured:
    """Violations that the independent checker found in the journals."""
    return checked_violations(evidence, STRESS, JOURNALS)
