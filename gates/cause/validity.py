"""Does each mode succeed, and is it feasible? And what was found, whatever the outcomes."""

from gates.cause.answers import Answer, CauseName, Diagnosis, Layer, Named
from gates.cause.components import followed
from gates.cause.limits import CauseLimits
from gates.cause.numbers import Numbers
from gates.cause.structure import thin
from gates.cause.told import QUESTION
from genpolicy.audit.rows import ModeOutcome
from genpolicy.statistics.intervals import clopper_pearson

SUCCESS_UNDECIDED = "success_undecided"


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
    return answers, _choice(numbers, limits, {mode.mode for mode in valid})


def _choice(numbers: Numbers, limits: CauseLimits, valid: set[str]) -> Diagnosis | None:
    """What is wrong with the choices between modes; None if one of them is between valid modes.

    Modes are a choice only where they stand beside each other under one observation. One that
    surely fails is none; one of which too few episodes are known leaves the choice open.
    """
    pairs = [{row.mode, row.other} for row in numbers.alternatives]
    if any(pair <= valid for pair in pairs) or _valid_together(numbers, limits):
        return None
    if not pairs:
        text = "No situation holds two of the modes: record more, from fewer starts."
        return thin(text, kind="linking")
    weak = [mode.mode for mode in numbers.modes if _fails(mode, limits)]
    if all(pair & set(weak) for pair in pairs):
        names = ", ".join(weak)
        text = (
            f"Leave out the episodes of {names}, which do not succeed or are not feasible often "
            "enough; what remains has one mode."
        )
        return Diagnosis(CauseName.UNIMODAL, names, "one_valid_mode", text)
    known = min(mode.episodes for mode in numbers.modes)
    text = (
        f"{' '.join(found_words(numbers, limits))} Whether two of them succeed in "
        f"{limits['mode_success_lower']:.0%} is not decided, by as few as {known} episodes of a "
        "mode: record more of each."
    ).strip()
    return Diagnosis(CauseName.INSUFFICIENT_SUPPORT, "outcome", SUCCESS_UNDECIDED, text)


def _fails(mode: ModeOutcome, limits: CauseLimits) -> bool:
    """Whether a mode surely succeeds too rarely, or is not feasible."""
    feasible = _feasible(mode, limits)
    rarely = not mode.success_upper - limits["mode_success_lower"] >= 0
    return rarely or (feasible is not None and feasible.red)


def _valid_together(numbers: Numbers, limits: CauseLimits) -> bool:
    """Whether the choices of all starts together are between modes that succeed.

    Where each start has modes of its own, a dozen episodes of each prove nothing, and all of them
    together do: the most frequent modes of all starts are taken together, and so are the second
    ones. Frequencies know nothing of outcomes. No mode may stay below the limit by itself.
    """
    limit = limits["mode_success_lower"]
    by_name = {mode.mode: mode for mode in numbers.modes}
    starts = [
        sorted((by_name[name] for name in start), key=_frequent) for start in _starts(numbers)
    ]
    chosen = [mode for start in starts for mode in start]
    if len(starts) < 2 or any(
        _fails(mode, limits) or mode.successes < limit * mode.episodes for mode in chosen
    ):
        return False
    for rank in (0, 1):
        same = [start[rank] for start in starts]
        lower, _ = clopper_pearson(sum(m.successes for m in same), sum(m.episodes for m in same))
        if not lower - limit >= 0:
            return False
    return True


def _frequent(mode: ModeOutcome) -> tuple[int, str]:
    return -mode.episodes, mode.mode


def _starts(numbers: Numbers) -> list[set[str]]:
    """Modes that are connected by situations that they share; each by itself is none."""
    starts: list[set[str]] = []
    for row in numbers.alternatives:
        pair = {row.mode, row.other}
        touching = [start for start in starts if start & pair]
        starts = [start for start in starts if not start & pair]
        starts.append(pair.union(*touching))
    return starts


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
    name, tried = best.variable.replace("_", " "), len({row.variable for row in numbers.told})
    of = f"Of {tried} variable{'s' if tried > 1 else ''} {name}"
    if not best.told > 0:
        return f"{of} tells most of them, and no more than a guess."
    return (
        f"{of} tells most of them: {best.told:.0%} of the wrong guesses ({best.told_lower:.0%} to "
        f"{best.told_upper:.0%}; {limits[QUESTION]:.0%} is too much)."
    )
