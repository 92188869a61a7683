"""The cause: the first red layer in the order of diagnosis decides, and says what to do next.

Order: clocks and frames, calibration, labels, support, modes at all, persistence, recorded
variables, validity of each mode. A later layer is not believed while an earlier one is red.
"""

from collections.abc import Callable, Sequence
from pathlib import Path

from gates.cause.answers import NEXT, Answer, Cause, CauseName, Diagnosis, Layer, Named
from gates.cause.components import components, looked_in, others, unreadable
from gates.cause.hidden import hidden
from gates.cause.limits import CauseLimits
from gates.cause.numbers import Numbers, folder_numbers
from genpolicy.audit.rows import ModeOutcome
from genpolicy.errors import ConfigError

IN_METRES = ("calibration_residual_m", "noise_spread_m")
__all__ = ["Answer", "Cause", "CauseName", "Layer", "cause_of", "name_cause"]


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
        draws: The same of resampled data; the confidence is the share that names the same cause.
        limits: One for each question.

    Raises:
        ConfigError: A limit lies below what the audit looked for.
    """
    _check_floors(numbers, limits)
    answers: list[Answer] = []
    verdict = Diagnosis(CauseName.VALID_MODES, "", "", NEXT)
    red = Layer.NONE
    for layer, judge in LAYERS.items():
        found, said = judge(numbers, limits)
        answers += found
        if said is not None and red is Layer.NONE:
            verdict, red = said, layer
    same = [(v.name, v.variable) == (verdict.name, verdict.variable) for v in _all(draws, limits)]
    return Cause(
        name=verdict.name,
        variable=verdict.variable,
        kind=verdict.kind,
        layer=red,
        next_action=f"{verdict.next_action}{others(numbers, red)}",
        answers=tuple(answers),
        confidence=sum(same) / len(same) if same else None,
    )


def _all(draws: Sequence[Numbers], limits: CauseLimits) -> list[Diagnosis]:
    return [_first_red(draw, limits) for draw in draws]


def _first_red(numbers: Numbers, limits: CauseLimits) -> Diagnosis:
    for judge in LAYERS.values():
        said = judge(numbers, limits)[1]
        if said is not None:
            return said
    return Diagnosis(CauseName.VALID_MODES, "", "", NEXT)


def _check_floors(numbers: Numbers, limits: CauseLimits) -> None:
    for question, floor in sorted(numbers.floors.items()):
        # Floors may have been converted to metres and back.
        if not limits[question] - floor * (1.0 - 1e-9) >= 0:
            raise ConfigError(
                where=f"the limit of {question}",
                found=f"{limits[question]:g}",
                expected=f"at least {floor:g}, from where on the audit looks",
                action="Raise the limit, or lower the audit's floor and audit again.",
            )


def _data(numbers: Numbers, limits: CauseLimits) -> Named:
    answers, verdict = [], None
    for item in numbers.findings:
        in_metres = item.question in IN_METRES
        answer = Answer(
            question=item.question,
            layer=Layer.DATA,
            what=f"{item.kind} {item.variable}".replace("_", " ").strip(),
            measured=item.measured,
            limit=limits[item.question] * (numbers.metre if in_metres else 1.0),
            unit=numbers.unit if in_metres else item.unit,
            note=item.where,
        )
        answers.append(answer)
        if answer.red and verdict is None:
            verdict = Diagnosis(CauseName.DATA_DEFECT, item.variable, item.kind, item.action)
    return answers, verdict


def _labels(numbers: Numbers, limits: CauseLimits) -> Named:
    labels, limit = numbers.labels, limits["label_disagreement"]
    known = labels.replays > 0
    answer = Answer(
        question="label_disagreement",
        layer=Layer.LABELS,
        what="labels that disagree with a replay, upper bound",
        measured=labels.upper if known else None,
        limit=limit if known else None,
        note=f"{labels.disagreements} of {labels.replays} replayed"
        if known
        else "no replay: labels are taken as they are",
    )
    if not answer.red:
        return [answer], None
    if labels.disagreements == 0:
        text = (
            f"Replay more episodes: {labels.replays} without a disagreement only show a share "
            f"below {labels.upper:.3f}."
        )
        return [answer], Diagnosis(CauseName.INSUFFICIENT_SUPPORT, "outcome", "replay", text)
    text = (
        f"{labels.disagreements} of {labels.replays} labels disagree with the replay: label again "
        "from the replay and repeat the audit."
    )
    return [answer], Diagnosis(CauseName.LABEL_CONTAMINATION, "outcome", "replay", text)


def _support(numbers: Numbers, limits: CauseLimits) -> Named:
    counts = numbers.counts

    def least(question: str, what: str, measured: float, note: str = "") -> Answer:
        return Answer(question, Layer.SUPPORT, what, measured, limits[question], ">=", note=note)

    answers = [
        least(
            "supported_episodes",
            "held-out episodes with enough comparable demonstrations",
            counts.analysed_episodes,
        ),
        least(
            "held_out_situations",
            "held-out situations with enough of them",
            counts.analysed,
        ),
        least(
            "supported_share",
            "share of held-out situations with enough of them",
            counts.share,
            f"{counts.analysed} of {counts.queries}",
        ),
    ]
    red = next((answer for answer in answers if answer.red), None)
    if red is None:
        return answers, None
    if red.question == "supported_share":
        found = f"{counts.share:.0%} of the held-out situations have"
        needed = f"{limits[red.question]:.0%}"
    else:
        what = "episodes" if red.question == "supported_episodes" else "situations"
        found, needed = f"{red.measured:g} held-out {what} have", f"{limits[red.question]:g}"
    return answers, _thin(
        f"Only {found} enough comparable training episodes ({needed} needed): record more, from "
        "fewer starts."
    )


def _structure(numbers: Numbers, limits: CauseLimits) -> Named:
    counts, kept = numbers.counts, numbers.kept
    needed = max(limits["two_mode_episodes"], limits["two_mode_share"] * counts.primary_episodes)
    modes = Answer(
        "two_mode_episodes", Layer.STRUCTURE, "held-out episodes with several modes",
        counts.two_mode_episodes, needed, ">=",
        note=f"{counts.two_mode} situations; {counts.resolved} more have clusters that the "
        "observation tells apart",
    )  # fmt: skip
    long_enough = Answer(
        "multimodal_situations", Layer.STRUCTURE,
        "situations that go on long enough to see them persist", kept.n,
        limits["multimodal_situations"], ">=",
    )  # fmt: skip
    margin = Answer(
        "persistence_margin", Layer.STRUCTURE,
        "episodes that keep their mode a chunk later, beyond what chance reaches in 95 of 100",
        kept.observed - kept.null_q95 if kept.n else None, limits["persistence_margin"], ">=",
        note=f"{kept.observed:.2f} against {kept.null_q95:.2f}" if kept.n else "not measured",
    )  # fmt: skip
    persistent = Answer(
        "multimodal_situations", Layer.STRUCTURE, "situations whose modes persist",
        counts.persistent, limits["multimodal_situations"], ">=",
    )  # fmt: skip
    answers = [modes, *components(numbers), long_enough, margin, persistent]
    white = (
        counts.noise_ratio - limits["noise_ratio"] >= 0
        and counts.noise_spread - limits["noise_spread_m"] * numbers.metre >= 0
    )
    if modes.red or (white and long_enough.red):
        absent, verdict = _absent(numbers, limits, white=white)
        return [*answers, absent], verdict
    if long_enough.red or persistent.red:
        number = kept.n if long_enough.red else counts.persistent
        # Clusters that fall apart are noise, however many there are.
        if margin.red and not long_enough.red:
            return answers, _noise("Clusters do not persist over a chunk")
        return answers, _thin(
            f"Only {number} situations with several modes "
            f"{'go on long enough to see whether the modes' if long_enough.red else 'are seen to'} "
            f"persist ({limits['multimodal_situations']:g} needed): record more, from fewer "
            "starts.",
            kind="persistence",
        )
    return answers, _noise("Clusters do not persist over a chunk") if margin.red else None


def _absent(numbers: Numbers, limits: CauseLimits, *, white: bool) -> tuple[Answer, Diagnosis]:
    """No modes were found; is that enough to say that there are none?"""
    counts, unread = numbers.counts, unreadable(numbers)
    answer = Answer(
        "denial_share", Layer.STRUCTURE,
        "share of situations with enough demonstrations to deny modes", counts.share,
        limits["denial_share"], ">=", note="modes may hide in the others",
    )  # fmt: skip
    if answer.red:
        text = (
            f"No modes were found in the {counts.share:.0%} of the held-out situations that have "
            "enough comparable training episodes; the others may hold some "
            f"({limits['denial_share']:.0%} needed to deny it): record more, from fewer starts."
        )
        return answer, _thin(text)
    if white:
        return answer, _noise("The spread is noise from action to action")
    if counts.incoherent - limits["incoherent_situations"] >= 0:
        return answer, _noise("Clusters do not persist over a chunk")
    if unread:
        text = (
            f"No modes were found, but those of {', '.join(unread)} could not be looked for: "
            "record the commands so that they can be read, and repeat the audit."
        )
        return answer, Diagnosis(CauseName.INSUFFICIENT_SUPPORT, unread[0], "component", text)
    decided = counts.resolved > counts.two_mode
    text = (
        "Use the simple baselines: no two separate actions were found under one observation, in "
        f"{looked_in(numbers)}."
    )
    kind = "observation_decides" if decided else ""
    return answer, Diagnosis(CauseName.UNIMODAL, "", kind, text)


def _validity(numbers: Numbers, limits: CauseLimits) -> Named:
    modes = numbers.modes
    answers = [
        Answer("modes", Layer.VALIDITY, "modes followed over situations", len(modes), 2.0, ">=")
    ]
    valid: list[ModeOutcome] = []
    for mode in modes:
        success, feasible = _success(mode, limits), _feasible(mode, limits)
        answers.append(success)
        if feasible is not None:
            answers.append(feasible)
        if success.holds and (feasible is None or feasible.holds):
            valid.append(mode)
    if len(modes) < 2:
        text = "The situations overlap too little to follow a mode: record more, from fewer starts."
        return answers, _thin(text, kind="linking")
    if all(mode.episodes == 0 for mode in modes):
        text = "Record whether each episode succeeded: without it no mode can be called valid."
        return answers, Diagnosis(CauseName.INSUFFICIENT_SUPPORT, "outcome", "not_recorded", text)
    if len(valid) >= 2:
        return answers, None
    weak = ", ".join(mode.mode for mode in modes if mode not in valid)
    text = (
        f"Leave out the episodes of {weak}, which do not succeed or are not feasible often "
        "enough; what remains has one mode."
    )
    return answers, Diagnosis(CauseName.UNIMODAL, weak, "one_valid_mode", text)


def _success(mode: ModeOutcome, limits: CauseLimits) -> Answer:
    known = mode.episodes > 0
    return Answer(
        "mode_success_lower", Layer.VALIDITY, f"success of {mode.mode}, lower bound",
        mode.success_lower if known else None, limits["mode_success_lower"], ">=",
        note=f"{mode.successes} of {mode.episodes} succeed" if known else "not recorded",
    )  # fmt: skip


def _feasible(mode: ModeOutcome, limits: CauseLimits) -> Answer | None:
    if mode.checked == 0:
        return None
    return Answer(
        "mode_feasible_share", Layer.VALIDITY, f"feasible chunks of {mode.mode}",
        mode.admissible / mode.checked, limits["mode_feasible_share"], ">=",
        note=f"{mode.admissible} of {mode.checked}",
    )  # fmt: skip


def _thin(text: str, *, kind: str = "neighbourhoods") -> Diagnosis:
    return Diagnosis(CauseName.INSUFFICIENT_SUPPORT, "", kind, text)


def _noise(what: str) -> Diagnosis:
    text = f"{what}: use chunked behaviour cloning, which averages it out."
    return Diagnosis(CauseName.POINTWISE_NOISE, "", "", text)


LAYERS: dict[Layer, Callable[[Numbers, CauseLimits], Named]] = {
    Layer.DATA: _data,
    Layer.LABELS: _labels,
    Layer.SUPPORT: _support,
    Layer.STRUCTURE: _structure,
    Layer.HIDDEN: hidden,
    Layer.VALIDITY: _validity,
}
