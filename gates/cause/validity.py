"""Does each mode succeed, and is it feasible? And what was found, whatever the outcomes."""

from gates.cause.answers import Answer, CauseName, Diagnosis, Layer, Named
from gates.cause.components import followed
from gates.cause.limits import CauseLimits
from gates.cause.numbers import Numbers
from gates.cause.structure import thin
from gates.cause.told import QUESTION
from genpolicy.audit.rows import ModeOutcome


def validity(numbers: Numbers, limits: CauseLimits) -> Named:
    """Every mode's success and feasibility."""
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
        return answers, thin(text, kind="linking")
    if all(mode.episodes == 0 for mode in modes):
        text = (
            f"{' '.join(found_words(numbers, limits))} Whether these modes are valid is not "
            "recorded: record whether each episode succeeded."
        ).strip()
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


def found_words(numbers: Numbers, limits: CauseLimits) -> tuple[str, ...]:
    """What was found of modes and of what tells them, a sentence each; none without modes.

    It says nothing of validity, and stands whatever the outcomes are.
    """
    counts, modes = numbers.counts, numbers.modes
    if counts.two_mode_episodes == 0:
        return ()
    several = f"{len(modes)} modes of {followed(numbers) or 'the action'}" if modes else "Modes"
    lines = [
        f"{several} were found in {counts.two_mode_episodes} of {counts.primary_episodes} held-out "
        "episodes that could be looked at."
    ]
    if numbers.kept.n:
        lines.append(
            f"{numbers.kept.observed:.0%} of the episodes keep their mode a chunk later, "
            f"{numbers.kept.null_q95:.0%} is what chance reaches."
        )
    return (*lines, _tells(numbers, limits))


def _tells(numbers: Numbers, limits: CauseLimits) -> str:
    """The variable that tells most of the modes, or that none was recorded."""
    if not numbers.told:
        return "No variable was recorded that could tell them."
    best = max(numbers.told, key=lambda row: (row.told, row.variable))
    return (
        f"Of {len({row.variable for row in numbers.told})} variables "
        f"{best.variable.replace('_', ' ')} tells most of them: {best.told:.0%} of the wrong "
        f"guesses ({best.told_lower:.0%} to {best.told_upper:.0%}; {limits[QUESTION]:.0%} is too "
        "much)."
    )
