"""How much of the mode can be told from what the policy does not see, and is that too much?

The end of the interval that speaks against the limit is held to it: what is told for sure beyond
the limit is a hidden state, what is surely below is none, and what lies astride is not decided.
"""

from collections.abc import Sequence
from dataclasses import replace

from gates.cause.answers import Answer, CauseName, Diagnosis, Topic
from gates.cause.limits import CauseLimits
from gates.words import percent
from genpolicy.audit.rows import Prediction

QUESTION = "told_share"
PREDICTED, UNDECIDED = "prediction", "undecided"
# What no column says; the strata give it the same name and kind.
UNRECORDED, SEQUENCE, HISTORY = "unrecorded", "recording_sequence", "history"
EPOCH = "calibration_epoch"
# Which to name of several that tell nearly as much, most concrete first; others come before the
# last two, which anything else shines through.
CONCRETE = (
    "object", "operator", EPOCH, "previous_episodes", "previous_episodes_of_operator",
    "every_other_episode", "episode_order", "recording_sequence", "everything_together", "history",
)  # fmt: skip
EVERYTHING = 2
OTHER_PHASE = "mode_of_"
# The best of all recorded columns, which are one question; by itself a column is not left open.
COLUMNS = "recorded_columns"
SHOWN = 8


def surely(row: Prediction, limit: float) -> bool | None:
    """Whether a variable tells more than the limit; None where its interval lies astride."""
    if row.told_lower > limit:
        return True
    return False if limit - row.told_upper >= 0 else None


def told(rows: Sequence[Prediction], limits: CauseLimits) -> list[Answer]:
    """What tells most, each by the end of its interval that decides."""
    limit = limits[QUESTION]
    ranked = sorted(
        rows, key=lambda row: (not counts(row, rows, limit), -_judged(row, limit), row.variable)
    )
    return [
        Answer(
            QUESTION, Topic.HIDDEN,
            f"what {row.variable.replace('_', ' ')} tells of the mode, beyond a guess",
            _judged(row, limit), limit if counts(row, rows, limit) else None,
            note=f"{percent(row.told)} ({percent(row.told_lower)} to {percent(row.told_upper)}) in "
            f"{row.phase}, {row.n} held-out episodes; {_end(row, limit)}",
        )
        for row in ranked[:SHOWN]
    ]  # fmt: skip


def teller(rows: Sequence[Prediction], limits: CauseLimits) -> Diagnosis | None:
    """The variable that surely tells too much, else the one of which that is not decided."""
    limit = limits[QUESTION]
    beyond = [_by_name(row, rows) for row in rows if surely(row, limit)]
    if beyond:
        return _hidden(_foremost(beyond, limits["nearly_equal_effect"]))
    open_ = [_by_name(row, rows) for row in rows if _is_open(row, rows, limit)]
    return _undecided(max(open_, key=lambda row: row.told_upper), limit) if open_ else None


def is_column(variable: str) -> bool:
    """Whether it is a recorded column, which the audit knows by no name of its own."""
    known = variable in (*CONCRETE, COLUMNS)
    return not known and not variable.startswith(OTHER_PHASE)


def counts(row: Prediction, rows: Sequence[Prediction], limit: float) -> bool:
    """Whether a row is held to the limit; of several columns only the best is, or a sure one."""
    return surely(row, limit) is not None or _is_open(row, rows, limit)


def _is_open(row: Prediction, rows: Sequence[Prediction], limit: float) -> bool:
    """Whether a variable may tell too much.

    Of several recorded columns only the best is asked about. Which one that is rests on the same
    episodes, so its share scatters more than its interval says: where there are episodes enough
    to show a column that tells too much (its interval is narrower than half the limit), it must
    by itself beat a guess at the level that all columns share.
    """
    if surely(row, limit) is not None:
        return False
    if row.variable != COLUMNS:
        return not is_column(row.variable) or not _best(rows, row.phase)
    best = [r for r in rows if (r.variable, r.phase) == (row.detail, row.phase)]
    telling = row.told_upper - row.told < limit / 2.0
    # NaN proves nothing.
    return not telling or not best or not best[0].told_lower <= 0.0


def _best(rows: Sequence[Prediction], phase: str) -> bool:
    """Whether the best of several columns was asked about in this phase."""
    return any((row.variable, row.phase) == (COLUMNS, phase) for row in rows)


def _by_name(row: Prediction, rows: Sequence[Prediction]) -> Prediction:
    """The column that was the best of all, with what the choice of it left to tell."""
    if row.variable != COLUMNS:
        return row
    named = [r for r in rows if (r.variable, r.phase) == (row.detail, row.phase)]
    return replace(row, variable=row.detail) if named else row


def _judged(row: Prediction, limit: float) -> float:
    return row.told_lower if surely(row, limit) else row.told_upper


def _end(row: Prediction, limit: float) -> str:
    return {True: "judged by the lower end", False: "judged by the upper end", None: "undecided"}[
        surely(row, limit)
    ]


def _foremost(rows: Sequence[Prediction], close: float) -> Prediction:
    best = max(row.told for row in rows)

    def rank(row: Prediction) -> tuple[float, float, str]:
        known = row.variable in CONCRETE
        place = CONCRETE.index(row.variable) if known else len(CONCRETE) - EVERYTHING - 0.5
        place = CONCRETE.index("operator") if is_column(row.variable) else place
        return place, -row.told, row.variable

    return min((row for row in rows if row.told >= best - close), key=rank)


def _hidden(row: Prediction) -> Diagnosis:
    text = (
        f"{row.variable.replace('_', ' ')} tells the mode of held-out episodes in {row.phase}: it "
        f"takes away {row.told:.0%} of the wrong guesses (at least {row.told_lower:.0%}). Observe "
        "it, standardise it, or draw it anew for every episode; then repeat the audit."
    )
    if row.variable in (SEQUENCE, HISTORY):
        return Diagnosis(CauseName.HIDDEN_STATE, UNRECORDED, row.variable, text)
    name = CauseName.DATA_DEFECT if row.variable == EPOCH else CauseName.HIDDEN_STATE
    return Diagnosis(name, row.variable, PREDICTED, text)


def _undecided(row: Prediction, limit: float) -> Diagnosis:
    text = (
        f"{row.variable.replace('_', ' ')} may tell the mode in {row.phase}: it takes away between "
        f"{row.told_lower:.0%} and {row.told_upper:.0%} of the wrong guesses, and {limit:.0%} is "
        f"too much; {row.n} episodes do not decide it: record more."
    )
    return Diagnosis(CauseName.INSUFFICIENT_SUPPORT, row.variable, UNDECIDED, text)
