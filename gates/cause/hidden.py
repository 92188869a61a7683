"""Does a recorded variable, the order of recording or the past explain the modes?"""

import math

from gates.cause.answers import Answer, CauseName, Diagnosis, Named, Topic
from gates.cause.limits import CauseLimits
from gates.cause.numbers import Numbers
from gates.cause.told import HISTORY, SEQUENCE, UNRECORDED, teller, told
from gates.words import percent
from genpolicy.audit.rows import Stratum
from genpolicy.audit.variable import EPISODE_VARIABLES, INSIDE

DATA_VARIABLES = ("calibration_epoch",)
# Which variable to name when several explain the modes equally well, most concrete first; all
# others (observed ones) come before the last three, which anything else may shine through.
CONCRETE = (
    "phase", "object", "operator", "calibration_epoch", "episode_order", SEQUENCE,
    "time_in_episode", HISTORY,
)  # fmt: skip
LEAST_CONCRETE = 3
START = "start_position."
OBSERVED = "observed_variable"
# Time and the past show whatever else was recorded: they must explain more to be named.
EVERYTHING = ("time_in_episode", HISTORY)
SHOWN = 8


def hidden(numbers: Numbers, limits: CauseLimits) -> Named:
    """Variables that explain the modes significantly or tell them, and what the foremost says."""
    clear = [row for row in numbers.strata if _clear(row, limits)]
    # Those that are held to the limit come first, so that no red one is ever left out.
    clear.sort(key=lambda row: (not _held(row, limits), -_number(row.effect), row.variable))
    answers = [_answer(row, limits) for row in clear[:SHOWN]]
    tested = [row for row in numbers.strata if row.p_adjusted is not None and row.n > 0]
    if tested and not any(_held(row, limits) for row in clear):
        row = min(tested, key=lambda item: (_number(item.p_adjusted), item.variable))
        answers.insert(
            0,
            Answer(
                "strata_effect", Topic.HIDDEN,
                "largest share that a variable surely explains beyond chance", 0.0,
                limits["strata_effect"],
                note=f"none of {len(numbers.strata)}; smallest adjusted p "
                f"{_number(row.p_adjusted):.3g} ({_plain(row.variable)})",
                counted=f"all {len(numbers.strata)} variables",
            ),
        )  # fmt: skip
    found = [row for row in clear if _wide_of(row, limits)]
    answers += told(numbers.told, limits)
    if found:
        return answers, _said(_foremost(found, limits))
    return answers, teller(numbers.told, limits)


def told_by_episode(numbers: Numbers, limits: CauseLimits) -> bool:
    """Whether something that holds for a whole episode explains the modes: then they last."""
    return any(
        _clear(row, limits) and _wide_of(row, limits) and _of_episode(row) for row in numbers.strata
    )


def _of_episode(row: Stratum) -> bool:
    """Not the past, nor what switches inside an episode, nor what a channel shows row by row."""
    known = row.variable in EPISODE_VARIABLES or row.variable.startswith(START)
    return known or not (row.observed or row.variable == HISTORY or INSIDE in row.detail)


def _number(value: float | None) -> float:
    """A number of a test; NaN, and never 0, where it is not known."""
    return math.nan if value is None else value


def _clear(row: Stratum, limits: CauseLimits) -> bool:
    return limits["strata_p"] - _number(row.p_adjusted) >= 0


def _held(row: Stratum, limits: CauseLimits) -> bool:
    """Whether its share is held to the limit: a large one must be clear of chance for that."""
    small = limits["strata_effect"] - _number(row.effect) >= 0
    return small or _wide_of(row, limits)


def _wide_of(row: Stratum, limits: CauseLimits) -> bool:
    """Whether the share that it explains is too large, and its interval clear of chance."""
    large = not limits["strata_effect"] - _number(row.effect) >= 0
    return large and not _reaches_chance(row, limits)


def _reaches_chance(row: Stratum, limits: CauseLimits) -> bool:
    """Whether chance explains as much; an interval that is not known shows no such thing."""
    return limits["strata_effect_lower"] - _number(row.effect_lower) > 0


def _answer(row: Stratum, limits: CauseLimits) -> Answer:
    """A large share whose interval reaches down to chance is shown without a limit."""
    lower, upper = _number(row.effect_lower), _number(row.effect_upper)
    seen = ", which the policy sees" if row.observed else ""
    detail = f"{row.detail}; " if row.detail else ""
    begins = f", its interval begins at {percent(lower)}"
    unsure = begins if _reaches_chance(row, limits) else ""
    return Answer(
        "strata_effect", Topic.HIDDEN,
        f"share of the modes that {_plain(row.variable)} explains{seen}", row.effect,
        limits["strata_effect"] if _held(row, limits) else None,
        note=f"{detail}{row.phase}, adjusted p {_number(row.p_adjusted):.3g}{unsure}",
        interval=(lower, upper) if math.isfinite(lower + upper) else None,
        counted=f"{row.n} episodes",
    )  # fmt: skip


def _said(row: Stratum) -> Diagnosis:
    effect = _number(row.effect)
    share = f"{row.variable} explains {effect:.0%} of the modes in {row.phase}"
    if row.variable in DATA_VARIABLES:
        text = f"{share}: correct the epochs."
        return Diagnosis(CauseName.DATA_DEFECT, row.variable, row.variable, text)
    if row.variable == SEQUENCE:
        how = "stored" if row.detail else "recorded"
        text = (
            f"The mode of {row.phase} follows from those of the episodes {how} just before and "
            f"after ({effect:.0%}): find out what was decided per session or in turns, record it, "
            "or draw it anew for every episode, then repeat the audit."
        )
        return Diagnosis(CauseName.HIDDEN_STATE, UNRECORDED, SEQUENCE, text)
    if row.variable == HISTORY:
        text = (
            f"The past explains {effect:.0%} of the modes in {row.phase} ({row.detail}): record "
            "what was decided there, or lengthen the observation history, then repeat the audit."
        )
        return Diagnosis(CauseName.HIDDEN_STATE, UNRECORDED, HISTORY, text)
    if row.observed:
        text = f"{share}, and the policy sees it: use the simple baselines."
        return Diagnosis(CauseName.UNIMODAL, row.variable, OBSERVED, text)
    text = f"{share}: add it to the observation or standardise it, then repeat the audit."
    return Diagnosis(CauseName.HIDDEN_STATE, row.variable, "stratum", text)


def _foremost(found: list[Stratum], limits: CauseLimits) -> Stratum:
    """The variable to name: the strongest, and of nearly equal ones the most concrete."""
    handicap = limits["everything_handicap"]
    best = max(_number(row.effect) - handicap * (row.variable in EVERYTHING) for row in found)
    near = [row for row in found if _number(row.effect) >= best - limits["nearly_equal_effect"]]

    def rank(row: Stratum) -> tuple[float, float, str]:
        name = row.variable
        place = CONCRETE.index(name) if name in CONCRETE else len(CONCRETE) - LEAST_CONCRETE - 0.5
        # What was recorded of an episode is as concrete as who demonstrated it.
        column = name not in CONCRETE and not row.observed and not name.startswith(START)
        place = CONCRETE.index("operator") if column else place
        return place, -_number(row.effect), name

    return min(near, key=rank)


def _plain(variable: str) -> str:
    return "the past" if variable == HISTORY else variable.replace("_", " ")
