"""The limits of the cause: one for each question, with its reason and its owner.

A question that a criterion of Gate A asks as well takes that criterion's limit, so each limit is
written once in `params.yaml`. Where there is no ladder, the packaged defaults hold: a test keeps
their numbers equal to `params.yaml`, and their reasons speak of no task.
"""

import functools
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from math import isfinite
from typing import Any

from gates.report import OWNERS
from genpolicy.errors import ConfigError
from genpolicy.integrity.documents import parse_yaml

DEFAULTS = "default_limits.yaml"
SHARED = (
    "clock_residual_s", "calibration_residual_m", "label_disagreement", "held_out_situations",
    "multimodal_situations", "persistence_margin", "strata_effect", "told_share",
    "mode_success_lower", "mode_feasible_share",
)  # fmt: skip
"""Questions whose limit stands among the criteria of Gate A."""
OWN = (
    "clock_disorder", "rate_deviation", "gap_share", "frozen_s", "jitter_share", "lag_drift_rows",
    "gain_factor", "gain_epoch_factor", "magnitude_factor", "frame_angle_rad", "swapped_columns",
    "faulty_episodes_share", "supported_episodes", "supported_share", "denial_share",
    "two_mode_episodes", "two_mode_share", "two_mode_chance", "incoherent_share", "noise_ratio",
    "noise_spread_m", "white_share", "strata_p", "strata_effect_lower", "nearly_equal_effect",
    "everything_handicap", "cause_agreement", "contradicted_situations", "confirmed_share",
)  # fmt: skip
"""Questions that only the cause asks."""


@dataclass(frozen=True)
class Limit:
    """A limit with the reason for it and the owner who answers for it."""

    limit: float
    reason: str
    owner: str


@dataclass(frozen=True)
class CauseLimits:
    """Every limit of the cause.

    Attributes:
        by_question: Limit of each question.
        confidence: Coverage of every interval whose end is held to one of them.
    """

    by_question: Mapping[str, Limit]
    confidence: float

    def __getitem__(self, question: str) -> float:
        return self.by_question[question].limit

    def as_json(self) -> dict[str, dict[str, list[Any]]]:
        """In the form of `params.yaml`: by owner, limit and reason of each question."""
        result: dict[str, dict[str, list[Any]]] = {}
        for question, item in self.by_question.items():
            result.setdefault(item.owner, {})[question] = [item.limit, item.reason]
        return result


def limits_of(
    cause: Any, criteria: Mapping[str, Any], *, confidence: float, where: str
) -> CauseLimits:
    """Limits from the settings of Gate A.

    Args:
        cause: `owner: {question: [limit, reason]}` of the questions that only the cause asks.
        criteria: Thresholds of Gate A by criterion, each with `limit`, `reason` and `owner`; those
            of the shared questions are taken, others left alone.
        confidence: Coverage of every interval.
        where: For errors.

    Raises:
        ConfigError: A question without a limit, an unknown one, or a limit that is none.
    """
    found = _entries(cause, where=where)
    for question in sorted(set(found) - set(OWN)):
        raise _wrong(f"{where}.{question}", "a limit of no question", f"one of {', '.join(OWN)}")
    for question in SHARED:
        if question in criteria:
            item = criteria[question]
            found[question] = Limit(float(item.limit), str(item.reason), str(item.owner))
    return _whole(found, confidence, where)


@functools.cache
def default_limits() -> CauseLimits:
    """The packaged limits, for an audit without a ladder.

    Every question that a criterion asks as well asks for them: fifteen times in one judgement.
    """
    text = files("gates.cause").joinpath(DEFAULTS).read_bytes()
    document = dict(parse_yaml(text, where=DEFAULTS))
    confidence = float(document.pop("confidence"))
    return _whole(_entries(document, where=DEFAULTS), confidence, DEFAULTS)


def _whole(found: dict[str, Limit], confidence: float, where: str) -> CauseLimits:
    for question in (*SHARED, *OWN):
        if question not in found:
            raise _wrong(f"{where}.{question}", "missing", "a limit, a reason and an owner")
    return CauseLimits({question: found[question] for question in (*SHARED, *OWN)}, confidence)


def _entries(section: Any, *, where: str) -> dict[str, Limit]:
    if not isinstance(section, Mapping):
        raise _wrong(where, type(section).__name__, "`owner: {question: [limit, reason]}`")
    result: dict[str, Limit] = {}
    for owner, questions in section.items():
        if owner not in OWNERS or not isinstance(questions, Mapping):
            raise _wrong(f"{where}.{owner}", "no owner with questions", f"{', '.join(OWNERS)}")
        for question, value in questions.items():
            place = f"{where}.{owner}.{question}"
            if question in result:
                raise _wrong(place, "a second limit", "one limit per question")
            result[str(question)] = _limit(value, str(owner), place)
    return result


def _limit(value: Any, owner: str, where: str) -> Limit:
    match value:
        case [int() | float() as limit, str() as reason] if reason and isfinite(limit):
            if not isinstance(limit, bool):
                return Limit(float(limit), reason, owner)
    raise _wrong(where, repr(value), "[limit, reason], a number and a sentence")


def _wrong(where: str, found: str, expected: str) -> ConfigError:
    return ConfigError(
        where=where, found=found, expected=expected, action="Correct the limits of the cause."
    )
