"""Conditioning: does something that was, or could have been, recorded explain the modes?"""

import math

import numpy as np

from gates.bounds import counted_interval
from gates.cause import CauseName
from gates.cause.told import COLUMNS, counts, surely
from gates.criterion import Measured, criterion
from gates.doubt import OPEN_COLUMNS
from gates.evidence import Evidence, numbers
from gates.need.cause import as_the_cause, found_cause
from gates.need.settings import AUDIT, VALID_CAUSE, NeedSettings
from gates.words import percent
from genpolicy.audit.documents import SUMMARY
from genpolicy.audit.rows import Prediction


@criterion(
    "<=",
    question="Does phase, object, operator or epoch explain the modes?",
    look_at="Conditioning: a recorded variable explains the modes; give it to the policy.",
)
def strata_effect(evidence: Evidence, settings: NeedSettings) -> Measured:
    """Largest effect among strata that explain modes for sure; 0 if none does."""
    return as_the_cause("strata_effect", evidence, settings)


@criterion(
    "<=",
    question="Can the mode be told from what the policy does not see?",
    look_at="Conditioning: a variable, the order or the past tells the mode; observe it.",
)
def told_share(evidence: Evidence, settings: NeedSettings) -> Measured:
    """Wrong guesses at the mode of held-out episodes that the best teller takes away, as a share.

    Judged by the end of the interval that speaks against the limit: the upper one below it, the
    lower one above it. Where an interval lies astride, nothing can be said.
    """
    frame = evidence.rows(f"{AUDIT}/predictions.parquet", Prediction)
    least = settings.limits.number("told_share", otherwise=math.inf)
    names = list(Prediction.__dataclass_fields__)
    records = frame[names].to_dict("records")
    rows = [Prediction(**{str(name): value for name, value in row.items()}) for row in records]
    frame = frame[[counts(row, rows, least) for row in rows]]
    alone = _open_columns(rows, least)
    if rows and frame.empty:
        return Measured(0.0, caveat=f"by itself no recorded column beats a guess{alone}")
    lower, upper = numbers(frame, "told_lower"), numbers(frame, "told_upper")
    beyond = bool(np.any(lower > least))
    row = int(np.argmax(lower if beyond else upper))
    interval = (float(lower[row]), float(upper[row]))
    chosen = frame.iloc[row]
    counted = f"{chosen['n']} episodes"
    text = f"{chosen['variable']} in {chosen['phase']}, {counted} that had a choice"
    if beyond:
        return Measured(interval[0], interval, f"{text}; lower end", counted=counted)
    if least - interval[1] >= 0:
        return Measured(interval[1], interval, f"{text}; upper end{alone}", counted=counted)
    text = f"not decided: the limit lies inside the interval of {text}"
    return Measured(None, interval, text, counted=counted)


def _open_columns(rows: list[Prediction], limit: float) -> str:
    """Recorded columns that may tell too much, and are not held to the limit.

    Of many columns an interval reaches beyond the limit now and then, so that none is held to it
    by itself, nor the best of all where that beats no guess; whoever signs is told which they are.
    """
    open_ = [row for row in rows if surely(row, limit) is None and not counts(row, rows, limit)]
    told = []
    for row in sorted(open_, key=lambda row: (-row.told_upper, row.variable, row.phase)):
        who = "the best of all" if row.variable == COLUMNS else row.variable
        ends = f"{percent(row.told_lower)} to {percent(row.told_upper)}"
        told.append(f"{who} in {row.phase} ({ends})")
    return f"; {OPEN_COLUMNS}{', '.join(told)}" if told else ""


@criterion(
    ">=",
    question="Does the audit attribute the modes to the task itself?",
    look_at="Conditioning: the audit found another cause than valid modes; remove it first.",
    always=True,
)
def cause_accepted(evidence: Evidence, settings: NeedSettings) -> Measured:
    """1 if the audit attributes the modes to the task itself, 0 if to something else.

    Too little to say is neither: whoever records more may still be right.
    """
    cause = found_cause(evidence, settings)
    if cause.name is CauseName.INSUFFICIENT_SUPPORT:
        return Measured(None, caveat=f"not decided: {cause.next_action}")
    return Measured(float(cause.name == VALID_CAUSE), caveat=f"cause: {cause.text}")


@criterion(
    "<=",
    question="Do the modes collapse when the phase is seen?",
    look_at="Conditioning: the phase explains the modes; give it to the policy.",
)
def phase_collapse_share(evidence: Evidence, settings: NeedSettings) -> Measured:
    """Upper bound of the share of episodes whose modes the task phase takes away."""
    summary = evidence.document(AUDIT, SUMMARY)
    without, seen = summary.modes_without_phase, summary.modes_with_phase
    if without == 0:
        return Measured(0.0, caveat="no episode has modes without the phase")
    lost = max(0, without - seen)
    interval = counted_interval(lost, without, confidence=settings.confidence)
    text = (
        f"episodes with modes: {without} without the phase, {seen} with it; upper bound. With "
        "one phase only both are the same, because there is nothing to look at"
    )
    counted = f"{lost} of {without} episodes"
    return Measured(interval[1], interval, text, counted=counted, point=lost / without)
