"""The cause: the first red topic in the order of diagnosis decides, and says what to do next.

Order: clocks and frames, calibration, labels, support, modes at all, persistence, recorded
variables, validity of each mode. A later topic is not believed while an earlier one is red.
"""

import math
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

from gates.cause.answers import (
    NEXT,
    Answer,
    Cause,
    CauseName,
    Diagnosis,
    Named,
    Topic,
    in_words,
)
from gates.cause.components import beside, others
from gates.cause.confidence import confidence_of
from gates.cause.hidden import hidden
from gates.cause.limits import CauseLimits
from gates.cause.numbers import Numbers, Residual
from gates.cause.reading import folder_numbers
from gates.cause.structure import structure, support
from gates.cause.validity import beside_the_choice, found_words, validity
from gates.words import percent, share_of
from genpolicy.errors import ConfigError
from genpolicy.statistics.intervals import clopper_pearson

# What is said of modes; a defect that is found stands, and so does what is missing.
CLAIMS = (
    CauseName.VALID_MODES, CauseName.HIDDEN_STATE, CauseName.UNIMODAL, CauseName.POINTWISE_NOISE,
)  # fmt: skip
UNSTABLE = "unstable"
IN_METRES = ("calibration_residual_m", "noise_spread_m")
RESIDUALS = {
    "clock_residual_s": "clock offset left after realignment, largest of streams and epochs",
    "calibration_residual_m": "calibration residual, largest of epochs",
}
__all__ = ["Answer", "Cause", "CauseName", "Topic", "cause_of", "deciding_answer", "name_cause"]


def cause_of(evidence: Path, limits: CauseLimits) -> Cause:
    """The cause from the written evidence of an audit.

    Args:
        evidence: Folder that the audit wrote.
        limits: One for each question.

    Raises:
        BadInputError: A file is missing or damaged.
        ConfigError: A limit lies below what the audit looked for.
    """
    return name_cause(*folder_numbers(evidence), limits)


def name_cause(numbers: Numbers, draws: Sequence[Numbers], limits: CauseLimits) -> Cause:
    """The cause from the numbers of an audit, every question with its number and its limit.

    Args:
        numbers: What was measured.
        draws: The same of resampled data; the confidence rests on the share that names the
            same cause.
        limits: One for each question.

    Raises:
        ConfigError: A limit lies below what the audit looked for.
    """
    check_reach(numbers, limits)
    answers: list[Answer] = []
    verdict = Diagnosis(CauseName.VALID_MODES, "", "", NEXT)
    red = Topic.NONE
    for topic, judge in TOPICS.items():
        found, said = judge(numbers, limits)
        answers += found
        if said is not None and red is Topic.NONE:
            verdict, red = said, topic
    again = _all(draws, limits)
    same = [(v.name, v.variable) == (verdict.name, verdict.variable) for v in again]
    if again:
        answer, said = _agreement(verdict, again, limits)
        answers.append(answer)
        if said is not None:
            same = [_contradicts(other, verdict) for other in again]
            verdict, red = said, Topic.AGREEMENT
    return Cause(
        name=verdict.name,
        variable=verdict.variable,
        kind=verdict.kind,
        topic=red,
        next_action=f"{verdict.next_action}{others(numbers, red)}",
        answers=tuple(answers),
        confidence=confidence_of(verdict.name, red, (sum(same), len(same)), numbers),
        agreeing=(sum(same), len(same)),
        found=found_words(numbers, limits),
        beside=beside(numbers, red),
    )


def deciding_answer(question: str, numbers: Numbers, limits: CauseLimits) -> Answer | None:
    """The answer to a question on which it rests whether its limit is kept.

    The one furthest beyond the limit; where all that are known keep it, one that is not known, else
    the one nearest to it. Those without a limit are only shown; modes beside a choice are held to
    it here, and not where the cause is named.

    Returns:
        None where no number is held to the limit.

    Raises:
        ConfigError: A limit lies below what the audit looked for.
    """
    check_reach(numbers, limits)
    found = [answer for judge in TOPICS.values() for answer in judge(numbers, limits)[0]]
    found += beside_the_choice(numbers, limits)
    held = [item for item in found if item.question == question and item.limit is not None]

    def margin(item: Answer) -> tuple[bool, float]:
        if item.measured is None or item.limit is None:
            return False, math.inf
        left = item.limit - item.measured
        return not item.red, left if item.comparison == "<=" else -left

    return min(held, key=margin, default=None)


def _all(draws: Sequence[Numbers], limits: CauseLimits) -> list[Diagnosis]:
    return [_first_red(draw, limits) for draw in draws]


def _first_red(numbers: Numbers, limits: CauseLimits) -> Diagnosis:
    for judge in TOPICS.values():
        said = judge(numbers, limits)[1]
        if said is not None:
            return said
    return Diagnosis(CauseName.VALID_MODES, "", "", NEXT)


def _contradicts(other: Diagnosis, verdict: Diagnosis) -> bool:
    """Whether it names another cause; another variable is none, nor is leaving it open."""
    return other.name not in (verdict.name, CauseName.INSUFFICIENT_SUPPORT)


def _agreement(
    verdict: Diagnosis, draws: Sequence[Diagnosis], limits: CauseLimits
) -> tuple[Answer, Diagnosis | None]:
    """Whether most resampled audits that name a cause name another than the whole data do."""
    against = [said for said in draws if _contradicts(said, verdict)]
    same = sum(said.name is verdict.name for said in draws)
    total = same + len(against)
    answer = Answer(
        "cause_agreement", Topic.AGREEMENT,
        "resampled audits that name the same cause, of those that name one",
        same / total if total else None,
        limits["cause_agreement"] if verdict.name in CLAIMS else None, ">=",
        note=f"{share_of(same, total)}; {len(draws) - total} leave it open",
    )  # fmt: skip
    if not answer.red:
        return answer, None
    words = Counter(_words(said) for said in against)
    other, count = min(words.items(), key=lambda item: (-item[1], item[0]))
    instead = min(said.next_action for said in against if _words(said) == other)
    text = (
        f"All recordings together say {_words(verdict)}, but of the resampled audits {same} say "
        f"{verdict.name.value}, {len(against)} another cause, and {count} of them {other}. If that "
        f"is so: {instead} Otherwise record more, from fewer starts."
    )
    return answer, Diagnosis(CauseName.INSUFFICIENT_SUPPORT, "", UNSTABLE, text)


def _words(said: Diagnosis) -> str:
    if said.name is CauseName.DATA_DEFECT:
        return in_words(said.name, said.variable, said.kind)
    return in_words(said.name, said.variable or said.kind)


def check_reach(numbers: Numbers, limits: CauseLimits) -> None:
    """Refuse limits that would be without effect on this evidence.

    Raises:
        ConfigError: A limit lies below what the audit looked for, or above where modes were taken
            back.
    """
    # Both may have been converted to metres and back.
    for question, floor in sorted(numbers.floors.items()):
        if not limits[question] - floor * (1.0 - 1e-9) >= 0:
            where = f"at least {floor:g}, from where on the audit looks"
            raise _without_effect(question, limits, where, "Raise the limit, or lower the floor")
    for question, ceiling in sorted(numbers.ceilings.items()):
        if not ceiling * (1.0 + 1e-9) - limits[question] >= 0:
            where = f"at most {ceiling:g}, from where on the audit takes modes back"
            raise _without_effect(question, limits, where, "Lower the limit, or raise the ceiling")


def _without_effect(question: str, limits: CauseLimits, expected: str, action: str) -> ConfigError:
    return ConfigError(
        where=f"the limit of {question}",
        found=f"{limits[question]:g}",
        expected=expected,
        action=f"{action} in the audit's settings and audit again.",
    )


def _data(numbers: Numbers, limits: CauseLimits) -> Named:
    answers, verdict = [], None
    for item in numbers.findings:
        in_metres = item.question in IN_METRES
        answer = Answer(
            question=item.question,
            topic=Topic.DATA,
            what=f"{item.kind} {item.variable}".replace("_", " ").strip(),
            measured=item.measured,
            limit=limits[item.question] * (numbers.metre if in_metres else 1.0),
            unit=numbers.unit if in_metres else item.unit,
            note=item.where,
        )
        answers.append(answer)
        if answer.red and verdict is None:
            verdict = Diagnosis(CauseName.DATA_DEFECT, item.variable, item.kind, item.action)
    # What stands out and is harmless says nothing of the other epochs and streams.
    red = {answer.question for answer in answers if answer.red}
    for question, residual in numbers.residuals.items():
        if question not in red:
            answers.append(_residual(question, residual, numbers, limits))
    return answers, verdict


def _residual(question: str, residual: Residual, numbers: Numbers, limits: CauseLimits) -> Answer:
    """A residual where no finding speaks of it: what noise explains is never red.

    One beyond the limit that does not stand out of what the episodes scatter by is not known to
    lie on either side.
    """
    in_metres = question in IN_METRES
    limit = limits[question] * (numbers.metre if in_metres else 1.0)
    value = residual.value
    known = value is not None and limit - value >= 0
    note = "nothing stands out of what the episodes scatter by"
    if value is None:
        note = residual.why
    elif not known:
        note = f"{value:.4g} is beyond the limit, and {note}: too little to say"
    return Answer(
        question, Topic.DATA, RESIDUALS[question], value if known else None, limit,
        unit=numbers.unit if in_metres else "s", note=note,
    )  # fmt: skip


def _labels(numbers: Numbers, limits: CauseLimits) -> Named:
    labels, limit = numbers.labels, limits["label_disagreement"]
    known = labels.replays > 0
    ends = clopper_pearson(labels.disagreements, labels.replays, limits.confidence)
    answer = Answer(
        question="label_disagreement",
        topic=Topic.LABELS,
        what="labels that disagree with a replay, upper bound",
        measured=ends[1] if known else None,
        limit=limit if known else None,
        note=share_of(labels.disagreements, labels.replays, "replayed")
        if known
        else "no replay: labels are taken as they are",
        interval=ends if known else None,
        counted=f"{labels.disagreements} of {labels.replays} replays",
    )
    if not answer.red:
        return [answer], None
    if labels.disagreements == 0:
        text = (
            f"Replay more episodes: {labels.replays} without a disagreement only show a share "
            f"below {percent(ends[1])}."
        )
        return [answer], Diagnosis(CauseName.INSUFFICIENT_SUPPORT, "outcome", "replay", text)
    text = (
        f"{labels.disagreements} of {labels.replays} labels disagree with the replay: label again "
        "from the replay and repeat the audit."
    )
    return [answer], Diagnosis(CauseName.LABEL_CONTAMINATION, "outcome", "replay", text)


TOPICS: dict[Topic, Callable[[Numbers, CauseLimits], Named]] = {
    Topic.DATA: _data,
    Topic.LABELS: _labels,
    Topic.SUPPORT: support,
    Topic.STRUCTURE: structure,
    Topic.HIDDEN: hidden,
    Topic.VALIDITY: validity,
}
