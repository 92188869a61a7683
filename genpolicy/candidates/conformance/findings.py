"""What is said of a policy's answers: each finding holds, fails, or is not known."""

from collections import Counter
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from genpolicy.candidates.conformance.asked import Asked
from genpolicy.candidates.conformance.finding import ONE_IN_TWO, Finding, Judged
from genpolicy.candidates.conformance.recorded_starts import RecordedStarts
from genpolicy.candidates.wire.extension import Capabilities
from genpolicy.candidates.wire.spans import EXPECTED_TERMS, of_others_s
from genpolicy.statistics.intervals import clopper_pearson, order_statistic_interval

Array = NDArray[np.float64]
Admissible = Callable[[Array, Array], tuple[bool, str]]
"""`(chunk (K, 10), newest observation (D_o,))`: whether it passes every layer, and why not."""

CLOCKS_APART = 1e-3
"""Part by which the clocks of two machines may run apart, and more than any two do."""
MESSAGE_S = 0.01
"""What reading and writing a message may take beside the terms, a busy machine allowed for:
`serve-policy` takes 1 to 3 ms."""


def answers(asked: Asked, moments: int) -> Finding:
    """Whether every moment was answered, by numbers."""
    finite = sum(bool(np.isfinite(one.actions).all()) for one in asked.answers.values())
    if asked.faults:
        counted = ", ".join(f"{kind} {number}" for kind, number in sorted(asked.faults.items()))
        said = f"{len(asked.answers)} of {moments} moments answered; {counted}: {asked.last}"
        return Finding("answers", "fails", "B", said)
    if finite < moments:
        said = f"{moments - finite} of {moments} answers hold a number that is none"
        return Finding("answers", "fails", "B", said)
    return Finding("answers", "holds", "B", f"{moments} of {moments} moments answered")


def repeats(name: str, first: Asked, second: Asked, how: str) -> Finding:
    """Whether what was asked twice was answered the same, to the bit."""
    if second.faults or not second.answers:
        judged: Judged = "fails" if second.faults else "unknown"
        last = second.last or "nothing was answered before"
        return Finding(name, judged, "B", f"no answer when {how}: {last}")
    other = [
        float(np.abs(answer.actions - first.answers[row].actions).max())
        for row, answer in second.answers.items()
        if answer.actions.tobytes() != first.answers[row].actions.tobytes()
    ]
    if other:
        said = f"{len(other)} of {len(second.answers)} differ when {how}, by up to {max(other):.3g}"
        return Finding(name, "fails", "B", said)
    return Finding(name, "holds", "B", f"{len(second.answers)} equal to the bit when {how}")


def restarts(first: Asked, after: Asked | None, fault: str) -> Finding:
    """Whether it is the same after a new start; `fault` is why it did not start."""
    if fault:
        return Finding("restarts", "fails", "B", fault)
    if after is None:
        said = "it was not started here, so it cannot be started again"
        return Finding("restarts", "unknown", "B", said)
    return repeats("restarts", first, after, "started anew")


def seeded(told: Capabilities, repeats: Finding, asked: Asked) -> Finding:
    """Whether what it draws can be named and drawn again."""
    draws = any(
        len(one.actions) > 1 and (one.actions[1:] != one.actions[:1]).any()
        for one in asked.answers.values()
    )
    if not asked.answers:
        return Finding("seeded", "unknown", "B", "nothing was answered")
    if repeats.judged == "fails" or (draws and not told.seeded):
        takes = "it says that it can be seeded" if told.seeded else "it takes no name of the noise"
        return Finding("seeded", "fails", "B", f"its chunks differ from draw to draw; {takes}")
    if not draws:
        said = "it draws nothing: all candidates are equal"
    else:
        said = "noise of one name gave one chunk"
    return Finding("seeded", repeats.judged, "B", said)


def unchanged(digest: str | None, earlier: str | None, *, complete: bool) -> Finding:
    """Whether it answers as in an earlier check; `complete` where nothing was left unanswered."""
    if earlier is None:
        return Finding("unchanged", "unknown", "B", "no earlier check was named (--earlier)")
    if not complete:
        return Finding("unchanged", "unknown", "B", "not all that is compared was answered")
    if digest == earlier:
        return Finding("unchanged", "holds", "B", "it answers as in the earlier check")
    return Finding("unchanged", "fails", "B", "it answers otherwise than in the earlier check")


def evaluations(told: Capabilities, first: Asked, again: Asked) -> Finding:
    """Whether it counts how often its network ran, alike for equal noise."""
    if not told.counts_evaluations:
        return Finding("evaluations", "unknown", "B", "it does not say how often its network ran")
    other = [
        f"{first.answers[row].evaluations} and {answer.evaluations}"
        for row, answer in again.answers.items()
        if answer.evaluations != first.answers[row].evaluations
    ]
    if other:
        said = f"it counts otherwise for the same noise at {len(other)} moments: {other[0]}"
        return Finding("evaluations", "fails", "B", said)
    counts = {one.evaluations for one in first.answers.values() if one.evaluations is not None}
    if not counts:
        return Finding("evaluations", "unknown", "B", "nothing was answered")
    said = f"it counts {_range(counts)} for a sample, which nobody else can"
    return Finding("evaluations", "holds", "B", said)


def _range(counts: set[int]) -> str:
    return f"{min(counts)}" if len(counts) == 1 else f"{min(counts)} to {max(counts)}"


def admissible(asked: Asked, starts: RecordedStarts, passes: Admissible | None) -> Finding:
    """At how many moments a candidate passes all layers from rest; recorded chunks beside it."""
    if passes is None:
        said = "no registered task has these observations"
        return Finding("admissible", "unknown", "C", said)
    reasons: Counter[str] = Counter()
    some, recorded = 0, 0
    for row, answer in sorted(asked.answers.items()):
        seen = starts.observations[row, -1]
        verdicts = [passes(chunk, seen) for chunk in answer.actions]
        some += any(passed for passed, _ in verdicts)
        reasons.update(reason for passed, reason in verdicts if not passed)
        recorded += passes(starts.chunks[row], seen)[0]
    moments = len(asked.answers)
    low, high = clopper_pearson(some, moments)
    judged: Judged = "holds" if low > ONE_IN_TWO else "fails" if high < ONE_IN_TWO else "unknown"
    why = "".join(f"; {reason} {number}" for reason, number in reasons.most_common(3))
    said = (
        f"one chunk or more passes all layers from rest at {some} of {moments} moments, the "
        f"recorded one at {recorded}{why}"
    )
    return Finding("admissible", judged, "C", said)


def spans(told: Capabilities, asked: Asked, wire: list[float]) -> Finding:
    """Whether it measures its own latency terms, and what it says can be.

    Its terms together are shorter than the answer took. What is longer than they are is the wire
    and the writing of messages; where that is most of it, at most moments, the terms leave
    something out.

    Args:
        told: What it says that it measures.
        asked: Its answers.
        wire: Round trips of a ping, s; empty where none was answered.
    """
    missing = [str(term) for term in EXPECTED_TERMS if term not in told.spans]
    if missing:
        said = f"it does not measure {', '.join(missing)}: unknown, not zero"
        return Finding("spans", "unknown", "C", said)
    answers = list(asked.answers.values())
    if not answers:
        return Finding("spans", "unknown", "C", "nothing was answered")
    lasted = np.array([one.seconds for one in answers])
    claimed = np.array([sum(one.spans_s.values()) for one in answers])
    impossible = int(np.sum(claimed > lasted * (1.0 + CLOCKS_APART)))
    if impossible:
        at = int(np.argmax(claimed - lasted))
        said = (
            f"at {impossible} of {len(answers)} moments its terms are longer than the answer "
            f"took: {1e3 * claimed[at]:.3g} of {1e3 * lasted[at]:.3g} ms"
        )
        return Finding("spans", "fails", "C", said)
    messages = np.array([one.messages for one in answers])
    besides = lasted - claimed - messages * (max(wire, default=0.0) + MESSAGE_S)
    low, _ = order_statistic_interval(besides - claimed, ONE_IN_TWO)
    said = (
        f"it measures {', '.join(told.spans)}: {1e3 * float(np.median(claimed)):.3g} of "
        f"{1e3 * float(np.median(lasted)):.3g} ms; {_wire(wire)}{_of_others(asked)}"
    )
    if low <= 0.0:
        return Finding("spans", "holds", "C", said)
    # Without a ping it may be the wire that takes so long.
    judged: Judged = "fails" if wire else "unknown"
    return Finding("spans", judged, "C", f"{said}; most of the time is in none of them")


def _of_others(asked: Asked) -> str:
    """What the ladder does with terms that are not the model's."""
    each = [of_others_s(one.spans_s) for one in asked.answers.values()]
    if not each[0]:
        return ""
    stated_s = float(np.median([sum(one.values()) for one in each]))
    return (
        f"; of it {', '.join(each[0])} {1e3 * stated_s:.3g} ms, which the ladder counts as sample: "
        "its own of that name are the cell's, and come on top"
    )


def _wire(wire: list[float]) -> str:
    if not wire:
        return "it answers no ping"
    return f"a ping takes up to {1e3 * max(wire):.3g} ms"


def in_time(asked: Asked, deadline_s: float) -> Finding:
    """Whether answers come before the deadline, at the worse end of the 95th percentile."""
    seconds = np.array([one.seconds for one in asked.answers.values()])
    low, high = order_statistic_interval(seconds, 0.95)
    known = f"{1e3 * low:.3g} to {1e3 * high:.3g} ms" if np.isfinite(high) else "unbounded"
    said = (
        f"median {1e3 * float(np.median(seconds)):.3g} ms, 95th percentile {known}; the deadline "
        f"is {1e3 * deadline_s:g} ms" if len(seconds) else "nothing was answered"
    )  # fmt: skip
    if asked.faults["late"] or low > deadline_s:
        return Finding("in_time", "fails", "C", f"{asked.faults['late']} never answered; {said}")
    return Finding("in_time", "holds" if high <= deadline_s else "unknown", "C", said)
