"""The trial itself: are starts matched, can the test come out either way, does it succeed?"""

import math

from gates.claim import trainings
from gates.criterion import Measured, criterion
from gates.evidence import Evidence, MissingEvidenceError
from gates.stress.rollouts import (
    NOMINAL,
    STRESS,
    StressSettings,
    rollouts,
    success_lower,
)
from gates.stress.stopped import ran, require_as_said, starts_of, stopped_by
from gates.verdicts import rounded
from gates.words import percent
from genpolicy.evidence.documents.stress import POWER, Power

SIMULATED = 4000
"""Trials of one world of the power table, as the stage draws them; the table does not count them.
Not imported: every gate would stand on all that the stage runs."""


@criterion(
    "<=",
    question="Did all methods begin from identical states?",
    look_at="Evaluator: starts differ, so the methods cannot be compared; fix the resets.",
    per_candidate=True,
    always=True,
)
def unmatched_starts(evidence: Evidence, settings: StressSettings, candidate: str) -> Measured:
    """States after reset, by start, condition and hash, that candidate and baseline do not share.

    Every seed has every planned start in every condition, which is asked before: of so many starts
    the report speaks, since one start is one draw in however many conditions it is met.
    """
    if (blocks := ran(evidence, settings)) is not None:
        require_as_said(evidence, blocks, STRESS)
    own = _starts(evidence, settings, candidate)
    unmatched = {name: len(own ^ _starts(evidence, settings, name)) for name in settings.baselines}
    seeds = rollouts(evidence, settings, candidate)["seed"].nunique()
    starts, conditions = (len({key[place] for key in own}) for place in (1, 0))
    text = f"{starts} starts in {conditions} conditions by state hash, {trainings(seeds)}; "
    text += ", ".join(f"{name} {n}" for name, n in unmatched.items())
    return Measured(float(sum(unmatched.values())), caveat=text)


def _starts(evidence: Evidence, settings: StressSettings, method: str) -> set[tuple[str, int, str]]:
    # Those of a baseline are asked for with every candidate.
    key = ("starts", method, settings.perturbations, settings.planned_starts, settings.block)
    return evidence.once(key, lambda: _starts_of(evidence, settings, method))


def _starts_of(
    evidence: Evidence, settings: StressSettings, method: str
) -> set[tuple[str, int, str]]:
    rows = rollouts(evidence, settings, method)[["seed", "perturbation", "start", "start_sha256"]]
    if rows[["seed", "perturbation", "start"]].duplicated().any():
        raise MissingEvidenceError(f"{method} has two rows of one seed, condition and start")
    if rows["start_sha256"].eq("").any():
        raise MissingEvidenceError(f"{method} has a start without hash")
    planned = set(range(starts_of(evidence, settings, method)))
    for (seed, condition), part in rows.groupby(["seed", "perturbation"]):
        where = f"{method}, seed {seed}, {condition}"
        if set(part["start"]) != planned:
            raise MissingEvidenceError(
                f"{where}: {len(set(part['start']) ^ planned)} starts lack or nobody planned them"
            )
        # A reset that ignores its start gives one state under many numbers: one start.
        if (states := part["start_sha256"].nunique()) < len(planned):
            raise MissingEvidenceError(f"{where}: {states} states for {len(planned)} starts")
    return set(zip(rows["perturbation"], rows["start"], rows["start_sha256"], strict=True))


@criterion(
    ">=",
    question="Would a gain worth having be found, and none where there is none, at this size?",
    look_at="Evaluator: too few starts for this margin; plan more before looking at results.",
    always=True,
)
def verdict_reachable(evidence: Evidence, settings: StressSettings) -> Measured:
    """Share of simulated trials that end right: where the planned effect holds, and the margin.

    Too little power at the planned effect says nothing bad of anybody: more starts decide. A test
    that promotes without a gain is broken, and more starts do not mend it.
    """
    return reachable(evidence.document(STRESS, POWER), settings)


def reachable(power: Power, settings: StressSettings) -> Measured:
    """Share of the simulated trials of a power table that end right.

    The lower of two: promotion in the world of the planned effect, and return in the worlds in
    which the gain is at most the margin. `genpolicy plan` asks the same before a rollout.

    Args:
        power: The table.
        settings: With the limits of the gate, of which one is the power that is asked.

    Raises:
        MissingEvidenceError: The table is for another test, or lacks one of these worlds. Or the
            planned effect is found less often than is asked, by a test that returns often enough
            where there is no gain: a trial of this size shows nothing.
    """
    for key, stated, planned in (
        ("margin", power.margin, settings.margin),
        ("alpha", power.alpha, settings.alpha),
        ("pairs", power.pairs, settings.planned_starts),
    ):
        if not math.isclose(stated, planned, rel_tol=1e-9):
            raise MissingEvidenceError(f"the power table is for another {key}")
    if not power.rows:
        raise MissingEvidenceError("the power table has no rows")
    worlds = {(row.baseline_success, row.candidate_success): row for row in power.rows}
    without = {w: row for w, row in worlds.items() if not w[1] - w[0] > settings.margin + 1e-9}
    if settings.planned_effect not in worlds or not without:
        raise MissingEvidenceError("the power table lacks the planned effect or a world without")
    promote = worlds[settings.planned_effect].promote_share
    back = min(row.return_share for row in without.values())
    baseline, candidate = settings.planned_effect
    text = (
        f"{settings.measure} of {percent(candidate)} against {percent(baseline)} is promoted in "
        f"{percent(promote)} of simulated trials; a gain of at most the margin is returned in "
        f"{percent(back)}"
    )
    if len(settings.baselines) > 1:
        text += (
            f". That is over one simple method; over all {len(settings.baselines)}, each as good, "
            "it is found less often: see `genpolicy plan`"
        )
    limit = settings.limits.of.get("verdict_reachable")
    asked = limit.limit if limit and limit.limit is not None else 0.0
    # Rounded as it is judged: whatever fails by the return share is never called too small.
    sound = rounded(back) >= asked
    if sound and not promote >= asked:
        raise MissingEvidenceError(f"too few starts to find the planned effect: {text}")
    return Measured(min(promote, back), caveat=text, counted=f"{SIMULATED} simulated trials")


@criterion(
    ">=",
    question="Does it succeed undisturbed?",
    look_at="Generator training: it fails undisturbed; look at samples before stress.",
    per_candidate=True,
)
def nominal_success_lower(evidence: Evidence, settings: StressSettings, candidate: str) -> Measured:
    """Lower bound of success without perturbation."""
    if stopped := stopped_by(evidence, settings, candidate, "nominal_success_lower"):
        return stopped
    return success_lower(evidence, settings, candidate, (NOMINAL,))
