"""What is said of a policy's answers: each finding holds, fails, or is not known."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from genpolicy.candidates.conformance.asked import Asked
from genpolicy.candidates.conformance.plausible import (
    copied,
    nearest,
    shuffled_share,
    slopes,
    turned_away,
)
from genpolicy.candidates.conformance.recorded_starts import RecordedStarts
from genpolicy.candidates.wire.extension import Capabilities
from genpolicy.contract.latency import Term
from genpolicy.seeds import stream
from genpolicy.statistics.intervals import clopper_pearson, order_statistic_interval

Array = NDArray[np.float64]
Judged = Literal["holds", "fails", "unknown"]
Admissible = Callable[[Array, Array], tuple[bool, str]]
"""`(chunk (K, 10), newest observation (D_o,))`: whether it passes every layer, and why not."""

FEWEST = 20
"""Moments below which nothing is said of units: a slope of few is anything."""
SAME_SCALE = 3.0
"""A slope beyond a factor of three either way is another unit, sign or spread: a weak policy's
slope is still nearer to 1, a wrong unit's is 10 times off."""
KNOWS_THE_MOMENT = 0.001
ONE_IN_TWO = 0.5
SAMPLER_TERMS = (Term.PREPROCESS, Term.ENCODE, Term.SAMPLE)


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at.

    Attributes:
        name: Its name.
        judged: Whether it holds.
        gate: Letter of the gate that asks for it.
        said: What was seen.
    """

    name: str
    judged: Judged
    gate: str
    said: str


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
    if repeats.judged == "fails" or (draws and not told.seeded):
        takes = "it says that it can be seeded" if told.seeded else "it takes no name of the noise"
        return Finding("seeded", "fails", "B", f"its chunks differ from draw to draw; {takes}")
    if not draws:
        said = "it draws nothing: all candidates are equal"
    else:
        said = "noise of one name gave one chunk"
    return Finding("seeded", repeats.judged, "B", said)


def unchanged(digest: str | None, earlier: str | None) -> Finding:
    """Whether it answers as in an earlier check."""
    if earlier is None:
        return Finding("unchanged", "unknown", "B", "no earlier check was named (--earlier)")
    if digest == earlier:
        return Finding("unchanged", "holds", "B", "it answers as in the earlier check")
    return Finding("unchanged", "fails", "B", "it answers otherwise than in the earlier check")


def evaluations(told: Capabilities) -> Finding:
    """Whether it counts how often its network ran."""
    if told.counts_evaluations:
        return Finding("evaluations", "holds", "B", "it counts its network evaluations")
    return Finding("evaluations", "unknown", "B", "it does not say how often its network ran")


def plausible(asked: Asked, starts: RecordedStarts) -> list[Finding]:
    """Whether its chunks speak of the moment, in the units that were declared."""
    names = ("follows_observation", "scale", "orientation", "own_answers")
    rows = [row for row, one in sorted(asked.answers.items()) if np.isfinite(one.actions).all()]
    if len(rows) < FEWEST:
        said = f"{len(rows)} finite answers, {FEWEST} are needed"
        return [Finding(name, "unknown", "D", said) for name in names]
    drawn = np.stack([asked.answers[row].actions for row in rows])
    recorded = starts.chunks[rows]
    chunks = nearest(drawn, recorded)
    share = shuffled_share(drawn, recorded, rng=stream(0, "conformance", "shuffle"))
    copies = copied(drawn, recorded)
    return [
        Finding(
            names[0], "holds" if share <= KNOWS_THE_MOMENT else "fails", "D",
            f"as near to other moments' recordings in {share:.4f} of the shuffles, at most "
            f"{KNOWS_THE_MOMENT}",
        ),
        _scale(chunks, recorded, follows=share <= KNOWS_THE_MOMENT),
        _turned(chunks, recorded),
        Finding(
            names[3], "fails" if copies else "holds", "D",
            f"{copies} of {len(rows)} moments answered with the recording itself",
        ),
    ]  # fmt: skip


def _scale(chunks: Array, recorded: Array, *, follows: bool) -> Finding:
    found = slopes(chunks, recorded, rng=stream(0, "conformance", "slopes"))
    text = ", ".join(
        f"{one.name} {one.slope:.3g} ({one.low:.3g} to {one.high:.3g})" for one in found
    )
    said = f"recorded per declared unit, 1 is right: {text}"
    if not found:
        return Finding("scale", "unknown", "D", "nothing moves in the recordings")
    wrong = [
        one.name for one in found
        if np.isnan(one.slope) or one.high < 1.0 / SAME_SCALE or one.low > SAME_SCALE
    ]  # fmt: skip
    if wrong:
        return Finding("scale", "fails", "D", f"{said}; wrong: {', '.join(wrong)}")
    inside = all(one.low >= 1.0 / SAME_SCALE and one.high <= SAME_SCALE for one in found)
    # Of many chunks that know nothing the nearest lie on the line too.
    return Finding("scale", "holds" if inside and follows else "unknown", "D", said)


def _turned(chunks: Array, recorded: Array) -> Finding:
    off, compared = turned_away(chunks, recorded)
    low, high = clopper_pearson(off, compared)
    judged: Judged = "unknown"
    if low > ONE_IN_TWO:
        judged = "fails"
    elif high < ONE_IN_TWO:
        judged = "holds"
    said = f"at {off} of {compared} turned farther from the recording than recordings are apart"
    return Finding("orientation", judged, "D", said)


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


def spans(told: Capabilities) -> Finding:
    """Whether it measures its own latency terms."""
    missing = [str(term) for term in SAMPLER_TERMS if term not in told.spans]
    if missing:
        said = f"it does not measure {', '.join(missing)}: unknown, not zero"
        return Finding("spans", "unknown", "C", said)
    return Finding("spans", "holds", "C", f"it measures {', '.join(told.spans)}")


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
