"""The cost: deadlines, latency, holds, rejections, fallback, people, stops, and force.

Each must be within its limit in every planned condition; the share of the fallback not in the
drill, which calls for it on every start. Where one rollout holds many trials
(ticks, invocations), the starts are drawn again, whole; where it holds one, the bound is exact.
"""

from dataclasses import replace

import numpy as np
import pandas as pd

from gates.bounds import draws_for_quantile, share_interval, upper_quantile
from gates.criterion import Measured, criterion
from gates.distilled import spent
from gates.evidence import Evidence, MissingEvidenceError, counts, flags, numbers
from gates.floors import OLDEST_ACTION_S
from gates.recount import AtLeast, Subset, Term, is_one
from gates.report import Recount
from gates.stress.contact import touched
from gates.stress.invoked import INVOKED, invocations
from gates.stress.rollouts import (
    CURVES,
    DRILL,
    FAULTS,
    INVOCATIONS,
    NOMINAL,
    ROLLOUTS,
    STRESS,
    Interval,
    StressSettings,
    in_every_condition,
    rollouts,
    success_lower,
)
from gates.stress.stopped import stopped_by
from gates.words import duration, number, percent, three
from genpolicy.evidence.documents.stress import DISTILLED
from genpolicy.evidence.rows.stress import FaultRow
from genpolicy.statistics.clustered import ratio_interval

STOPS = ("collision", "force_stop")
"""Outcomes (`genpolicy.evidence.stress.state`) that stay until a person resets the cell."""
TOO_OLD = "beyond the maximum action age"
"""Said of a first answer that comes when nothing of it may be executed any more."""
WARM = AtLeast("invocation", 1)
"""Of an invocation: not the first of its session."""
STEPPED_IN = AtLeast("interventions", 1)
STOPPED = is_one("outcome", *STOPS)


@criterion(
    "<=",
    question="How often does it miss its deadline?",
    look_at="Timing: the sampler is too slow for the period; fewer NFE, or prefetch.",
    per_candidate=True,
)
def deadline_miss_upper(evidence: Evidence, settings: StressSettings, candidate: str) -> Measured:
    """Upper bound of the share of invocations that miss their deadline."""
    found = _share_of(evidence, settings, candidate, "deadline_misses", INVOKED)
    said = _faults(evidence, candidate)
    return replace(found, caveat=f"{found.caveat}; {said}") if said else found


def _faults(evidence: Evidence, candidate: str) -> str:
    """How many of its misses are faults of its process, by kind; empty of one that has none."""
    if not evidence.bind(FAULTS):
        return ""
    rows = evidence.rows(FAULTS, FaultRow)
    own = rows[rows["method"] == candidate]
    if len(own) == 0:
        return ""
    kinds = own.assign(count=counts(own, "count")).groupby("fault", sort=True)["count"].sum()
    told = ", ".join(f"{kind} {count:g}" for kind, count in kinds.items() if kind)
    return f"of them because its process failed: {told or 'none'}"


@criterion(
    "<=",
    question="How long until an answer arrives?",
    look_at="Timing: answers come when their chunk is over; read latency by term in gate B.",
    per_candidate=True,
    derived=lambda settings: min(settings.usable_s, settings.oldest_s, OLDEST_ACTION_S),
)
def latency_p95_s(evidence: Evidence, settings: StressSettings, candidate: str) -> Measured:
    """Upper bound of the end-to-end latency that 95 % of the warm invocations keep, s.

    The first invocation of a session is cold and before any motion; it is said apart, and so is
    what a distilled candidate's training took, which bought the answer's speed.
    """
    rows = invocations(evidence, settings, candidate)
    latency = numbers(rows, "latency_s")
    if not np.all(latency >= 0):
        raise MissingEvidenceError("a latency is negative: the clocks are wrong")
    rolled = rollouts(evidence, settings, candidate)

    def measure(part: pd.DataFrame, subset: Subset, condition: str) -> tuple[Interval, Recount]:
        if len(part) == 0:
            raise MissingEvidenceError(f"no warm invocation in {condition}: no answer to be timed")
        point, ends = upper_quantile(
            numbers(part, "latency_s"),
            part["start"].to_numpy(),
            0.95,
            confidence=settings.confidence,
            rng=settings.draws("D", "latency", candidate, condition),
        )
        return (point, *ends), subset.counted(part)

    of = Subset(INVOCATIONS, (WARM,))
    found = in_every_condition(rows, of, settings.perturbations, measure, duration)
    cold_s = float(latency[~WARM.holds(rows)].max(initial=0.0))
    text = f"{found.caveat}; {_cold(cold_s, settings.oldest_s)}"
    for condition in settings.perturbations:
        if said := _uninvoked(rolled, condition):
            text = f"{text}; {said}"
    # Missing where nothing that was compared has a teacher.
    if evidence.bind(f"{STRESS}/{DISTILLED.file}"):
        training = evidence.document(STRESS, DISTILLED).get(candidate)
        text = f"{text}; {spent(training)}" if training else text
    return replace(found, caveat=text)


def _uninvoked(rows: pd.DataFrame, condition: str) -> str:
    """How many rollouts of a condition began no invocation, as without any picture; or empty."""
    part = rows[rows["perturbation"] == condition]
    none = int((numbers(part, INVOKED) == 0).sum())
    return f"{none} of {len(part)} rollouts in {condition} without any invocation" if none else ""


def _cold(longest_s: float, oldest_s: float) -> str:
    """The first answer of a session, beside the oldest action that may be executed."""
    text = f"cold at most {duration(longest_s)}"
    return text if longest_s <= oldest_s else f"{text}, {TOO_OLD} of {duration(oldest_s)}"


@criterion(
    "<=",
    question="What share of time does it stand and wait?",
    look_at="Timing: the queue runs dry; look at misses, rejections and discards by reason.",
    per_candidate=True,
)
def hold_share_upper(evidence: Evidence, settings: StressSettings, candidate: str) -> Measured:
    """Upper bound of the share of ticks without any action."""
    return _share_of(evidence, settings, candidate, "hold_ticks", "ticks")


@criterion(
    "<=",
    question="How often is all of an answer rejected?",
    look_at="Feasibility: read the reasons; the generator leaves the feasible set in closed loop.",
    per_candidate=True,
)
def rejection_share_upper(evidence: Evidence, settings: StressSettings, candidate: str) -> Measured:
    """Upper bound of the share of invocations of which no candidate passes."""
    return _share_of(evidence, settings, candidate, "rejections", INVOKED)


@criterion(
    "<=",
    question="What share of time does the fallback drive?",
    look_at="Timing: the fallback does the work; read discards by reason.",
    per_candidate=True,
)
def fallback_share_upper(evidence: Evidence, settings: StressSettings, candidate: str) -> Measured:
    """Upper bound of the share of ticks driven by the fallback; not where it is drilled."""
    conditions = [name for name in settings.perturbations if name != DRILL]
    return _share_of(evidence, settings, candidate, "fallback_ticks", "ticks", conditions)


def _share_of(  # noqa: PLR0917
    evidence: Evidence,
    settings: StressSettings,
    candidate: str,
    part: str,
    whole: str,
    conditions: list[str] | None = None,
) -> Measured:
    """Upper bound of a share of ticks or invocations; the starts are the draws."""

    def measure(rows: pd.DataFrame, subset: Subset, condition: str) -> tuple[Interval, Recount]:
        hits, all_of = numbers(rows, part), numbers(rows, whole)
        if whole == INVOKED and np.any(all_of == 0):
            raise MissingEvidenceError(f"{_uninvoked(rows, condition)}: a share of none is unknown")
        if np.any(all_of <= 0) or np.any(hits > all_of) or np.any(hits < 0):
            raise MissingEvidenceError(f"{part} is no part of {whole}")
        starts, member = np.unique(rows["start"].to_numpy(), return_inverse=True)
        parts, wholes = np.zeros(len(starts)), np.zeros(len(starts))
        np.add.at(parts, member, hits)
        np.add.at(wholes, member, all_of)
        ends = ratio_interval(
            parts,
            wholes,
            confidence=settings.confidence,
            rng=settings.draws("D", part, candidate, condition),
        )
        return (float(hits.sum() / all_of.sum()), *ends), subset.summed(rows, (part,), whole)

    rows = rollouts(evidence, settings, candidate)
    planned = conditions or settings.perturbations
    return in_every_condition(rows, Subset(ROLLOUTS), planned, measure, percent)


@criterion(
    "<=",
    question="How often must a person step in?",
    look_at="Feasibility: recovery ends at a person too often; read recovery by phase.",
    per_candidate=True,
)
def intervention_upper(evidence: Evidence, settings: StressSettings, candidate: str) -> Measured:
    """Upper bound of the share of rollouts in which a person had to step in.

    Where people had the arm, their time for each success of the policy is said beside it.
    """
    if stopped := stopped_by(evidence, settings, candidate, "intervention_upper"):
        return stopped
    rows = rollouts(evidence, settings, candidate)
    counts(rows, "interventions")  # refused where one is below none
    found = _rollouts_with(rows, STEPPED_IN, settings)
    said = _persons_time(rows)
    return replace(found, caveat=f"{found.caveat}; {said}") if said else found


def _persons_time(rows: pd.DataFrame) -> str:
    """How long people had the arm; empty if nobody ever did."""
    had_s, successes = float(numbers(rows, "person_s").sum()), int(flags(rows, "success").sum())
    if np.any(numbers(rows, "person_s") < 0):
        raise MissingEvidenceError("a person had the arm for less than no time")
    if had_s == 0:
        return ""
    if successes == 0:
        return f"people had the arm for {three(had_s)} s, and nothing succeeded"
    each = three(had_s / successes)
    return f"people had the arm for {each} s for each of {number(successes)} successes"


@criterion(
    "<=",
    question="How often does it stop so that a person must reset the cell?",
    look_at="Contact controller: see which stop, collision or force, and in which phase.",
    per_candidate=True,
)
def reset_upper(evidence: Evidence, settings: StressSettings, candidate: str) -> Measured:
    """Upper bound of the share of rollouts that end in a protective stop."""
    if stopped := stopped_by(evidence, settings, candidate, "reset_upper"):
        return stopped
    rows = rollouts(evidence, settings, candidate)
    if rows["outcome"].eq("").any():
        raise MissingEvidenceError("a rollout has no outcome")
    return _rollouts_with(rows, STOPPED, settings)


def _rollouts_with(rows: pd.DataFrame, hit: Term, settings: StressSettings) -> Measured:
    """Exact upper bound of the share of rollouts that were hit, in every condition."""

    def measure(part: pd.DataFrame, subset: Subset, _: str) -> tuple[Interval, Recount]:
        interval = share_interval(
            hit.holds(part),
            part["start"].to_numpy(),
            confidence=settings.confidence,
            favourable=False,
        )
        return interval, subset.counted(part, hit)

    return in_every_condition(rows, Subset(ROLLOUTS), settings.perturbations, measure, percent)


@criterion(
    "<=",
    question="How hard does it touch?",
    look_at="Contact controller: look at stale actions and phase transitions, then gains.",
    per_candidate=True,
    applies=touched,
)
def force_peak_p95_n(evidence: Evidence, settings: StressSettings, candidate: str) -> Measured:
    """Upper bound of the peak contact force that 95 % of the rollouts keep, N.

    A policy that never touches shows nothing about force: as many starts must see contact, in any
    condition, as bound a p95.
    """
    rows = rollouts(evidence, settings, candidate)
    forces = numbers(rows, "force_peak_n")
    if not np.all(forces >= 0):
        raise MissingEvidenceError("a force is negative")
    seen = rows[forces > 0]["start"].nunique()
    fewest = draws_for_quantile(0.95, settings.confidence)
    if seen < fewest:
        raise MissingEvidenceError(
            f"hardly exercised: contact on {seen} of {rows['start'].nunique()} starts, in any "
            f"condition; {fewest} are needed to bound what 95 % keep"
        )

    def measure(part: pd.DataFrame, subset: Subset, condition: str) -> tuple[Interval, Recount]:
        point, ends = upper_quantile(
            numbers(part, "force_peak_n"),
            part["start"].to_numpy(),
            0.95,
            confidence=settings.confidence,
            rng=settings.draws("D", "force", candidate, condition),
        )
        return (point, *ends), subset.counted(part)

    found = in_every_condition(rows, Subset(ROLLOUTS), settings.perturbations, measure, _newtons)
    text = f"{found.caveat}; contact on {seen} starts, largest {_newtons(forces.max())}"
    return replace(found, caveat=text)


def _newtons(force_n: float) -> str:
    return f"{three(force_n)} N"


@criterion(
    ">=",
    question="Does it succeed under the worst perturbation?",
    look_at="Timing: see which perturbation breaks it, and its ages and discards.",
    per_candidate=True,
)
def stress_success_lower(evidence: Evidence, settings: StressSettings, candidate: str) -> Measured:
    """Lowest lower bound of success over the perturbations.

    Conditions that are milder or harder than the planned ones are shown beside it, not judged.
    """
    evidence.bind(CURVES)
    if stopped := stopped_by(evidence, settings, candidate, "stress_success_lower"):
        return stopped
    conditions = [name for name in settings.perturbations if name != NOMINAL]
    return success_lower(evidence, settings, candidate, conditions)
