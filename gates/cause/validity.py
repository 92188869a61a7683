"""Does each mode succeed, and is it feasible? And what was found, whatever the outcomes."""

import functools
from dataclasses import replace

from gates.cause.answers import Answer, CauseName, Diagnosis, Named, Topic
from gates.cause.components import followed
from gates.cause.limits import CauseLimits
from gates.cause.numbers import Numbers
from gates.cause.structure import thin
from gates.cause.told import QUESTION
from gates.words import share_of
from genpolicy.audit.rows import ModeOutcome
from genpolicy.statistics.intervals import clopper_pearson

SUCCESS_UNDECIDED = "success_undecided"


def validity(numbers: Numbers, limits: CauseLimits) -> Named:
    """Every mode's success and feasibility; held to the limit are those of the best choice.

    One good choice is enough, so modes beside it are shown without a limit. Where there is none
    all are held to it.
    """
    modes = numbers.modes
    count = Answer("modes", Topic.VALIDITY, "modes followed over situations", len(modes), 2.0, ">=")
    chosen = _best_choice(numbers, limits)
    together = [] if chosen else _together(numbers, limits)
    answers = [count, *together]
    for mode in modes:
        beside = chosen and mode.mode not in chosen
        for answer in (_success(mode, limits), _feasible(mode, limits)):
            spoken_for = together and answer.question == "mode_success_lower"
            answers.append(replace(answer, limit=None) if beside or spoken_for else answer)
    if len(modes) < 2:
        text = "The situations overlap too little to follow a mode: record more, from fewer starts."
        return answers, thin(text, kind="linking")
    if all(mode.episodes == 0 for mode in modes):
        text = (
            f"{' '.join(found_words(numbers, limits))} Whether these modes are valid is not "
            "recorded: record whether each episode succeeded."
        ).strip()
        return answers, Diagnosis(CauseName.INSUFFICIENT_SUPPORT, "outcome", "not_recorded", text)
    return answers, None if chosen or together else _no_choice(numbers, limits)


def _pairs(numbers: Numbers) -> list[set[str]]:
    """Modes that stand beside each other under one observation; only they are a choice."""
    return [{row.mode, row.other} for row in numbers.alternatives]


def _best_choice(numbers: Numbers, limits: CauseLimits) -> set[str]:
    """The pair of valid modes whose less successful one succeeds most; empty without one."""
    lowest = {
        mode.mode: _ends(mode.successes, mode.episodes, limits)[0]
        for mode in numbers.modes
        if _success(mode, limits).holds and not _feasible(mode, limits).red
    }
    valid = [pair for pair in _pairs(numbers) if pair <= set(lowest)]
    return max(
        valid, key=lambda pair: (min(lowest[name] for name in pair), sorted(pair)), default=set()
    )


def beside_the_choice(numbers: Numbers, limits: CauseLimits) -> list[Answer]:
    """Modes that stand beside the best choice, held to what no demonstration may fall below.

    The cause is a choice between valid modes whatever stands beside them. Whoever trains on all
    of the recordings trains on those as well, whatever their phase, so Gate A refuses a mode that
    surely fails (by its upper bound), or that is not feasible. Of one with few episodes nothing is
    claimed; one of which no outcome or no chunk is known is not known.
    """
    chosen, found = _best_choice(numbers, limits), []
    here = numbers.modes if chosen or _together(numbers, limits) else ()
    for mode in (*(mode for mode in here if mode.mode not in chosen), *numbers.elsewhere):
        success = _success(mode, limits)
        upper = _ends(mode.successes, mode.episodes, limits)[1]
        if success.measured is None:
            found.append(success)
        elif not upper - limits["mode_success_lower"] >= 0:
            text = f"success of {mode.mode}, upper bound: it surely fails"
            found.append(replace(success, what=text, measured=upper))
        found.append(_feasible(mode, limits))
    return found


def _no_choice(numbers: Numbers, limits: CauseLimits) -> Diagnosis:
    """What is wrong with the choices between modes, none of which is between valid ones.

    A mode that surely fails is no part of one; one of which too few episodes are known leaves the
    choice open.
    """
    pairs = _pairs(numbers)
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
    upper = _ends(mode.successes, mode.episodes, limits)[1]
    rarely = not upper - limits["mode_success_lower"] >= 0
    return rarely or _feasible(mode, limits).red


def _together(numbers: Numbers, limits: CauseLimits) -> list[Answer]:
    """Success of the choices of all starts together; empty where that is not enough.

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
        return []
    answers = [
        _success_of(
            f"the {which} modes of all starts together",
            sum(start[rank].successes for start in starts),
            sum(start[rank].episodes for start in starts),
            limits,
        )
        for rank, which in enumerate(("most frequent", "second"))
    ]
    return answers if all(answer.holds for answer in answers) else []


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
    found = _success_of(mode.mode, mode.successes, mode.episodes, limits)
    return replace(found, mode=mode.mode)


def _success_of(who: str, successes: int, episodes: int, limits: CauseLimits) -> Answer:
    ends, known = _ends(successes, episodes, limits), episodes > 0
    return Answer(
        "mode_success_lower", Topic.VALIDITY, f"success of {who}, lower bound",
        ends[0] if known else None, limits["mode_success_lower"], ">=",
        note=f"{share_of(successes, episodes, 'episodes')} succeed" if known else "not recorded",
        interval=ends if known else None, counted=f"{successes} of {episodes} episodes",
    )  # fmt: skip


def _ends(successes: int, episodes: int, limits: CauseLimits) -> tuple[float, float]:
    return _interval(successes, episodes, limits.confidence)


@functools.lru_cache(maxsize=4096)
def _interval(successes: int, episodes: int, confidence: float) -> tuple[float, float]:
    """Resampled audits ask for the same counts hundreds of times."""
    return clopper_pearson(successes, episodes, confidence)


def _feasible(mode: ModeOutcome, limits: CauseLimits) -> Answer:
    known = mode.checked > 0
    return Answer(
        "mode_feasible_share", Topic.VALIDITY, f"feasible chunks of {mode.mode}",
        mode.admissible / mode.checked if known else None, limits["mode_feasible_share"], ">=",
        note=share_of(mode.admissible, mode.checked, "chunks") if known else "no chunk was checked",
        counted=f"{mode.admissible} of {mode.checked} chunks", mode=mode.mode,
    )  # fmt: skip


def found_words(numbers: Numbers, limits: CauseLimits) -> tuple[str, ...]:
    """What was found of modes and of what tells them, a sentence each; none without modes.

    It says nothing of validity, and stands whatever the outcomes are.
    """
    counts, modes = numbers.counts, numbers.modes
    if counts.two_mode_episodes == 0:
        return ()
    many = len(modes) > 1
    several = f"{len(modes)} modes of {followed(numbers) or 'the action'}" if many else "Modes"
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
