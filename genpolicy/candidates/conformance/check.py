"""The conformance kit: what a policy behind the wire does, before any gate asks it.

A minute on recorded moments; nothing moves. Each finding holds, fails, or is not known, says what
was seen, and which gate asks for it. None of it is a verdict of a gate.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from genpolicy.candidates.conformance.plausible import (
    copied,
    nearest,
    shuffled_share,
    slopes,
    turned_away,
)
from genpolicy.candidates.conformance.recorded_starts import RecordedStarts
from genpolicy.candidates.wire.extension import Capabilities, NoiseName
from genpolicy.candidates.wire.faults import PolicyError
from genpolicy.candidates.wire.remote import Invocation, RemotePolicy
from genpolicy.contract.chunk import actions_sha256
from genpolicy.contract.latency import Term
from genpolicy.seeds import stream
from genpolicy.statistics.intervals import clopper_pearson, order_statistic_interval

Array = NDArray[np.float64]
Judged = Literal["holds", "fails", "unknown"]

AGAIN = 16
"""Moments that are asked a second time, and after a new start."""
FEWEST = 20
"""Moments below which nothing is said of units: a slope of few is anything."""
SAME_SCALE = 3.0
"""A slope beyond a factor of three either way is another unit, sign or spread: a weak policy's
slope is still nearer to 1, a wrong unit's is 10 times off."""
KNOWS_THE_MOMENT = 0.001
OFF_TURN_SHARE = 0.5
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


@dataclass(frozen=True)
class Conformance:
    """What was found of one candidate.

    Attributes:
        candidate: Its name.
        moments: Recorded moments that it was asked about, each of another episode.
        candidates: Chunks asked for at each.
        checkpoint: What it says that it serves; None where it does not.
        answers_sha256: Of its chunks at the moments that were asked twice: what it is, by what it
            does. None where it did not repeat itself.
        findings: In the order of the gates.
    """

    candidate: str
    moments: int
    candidates: int
    checkpoint: str | None
    answers_sha256: str | None
    findings: tuple[Finding, ...]

    @property
    def failed(self) -> list[Finding]:
        """What fails."""
        return [finding for finding in self.findings if finding.judged == "fails"]

    def as_json(self) -> dict[str, Any]:
        """For a file."""
        return asdict(self)


class _Asked:
    """Answers by moment, and what went wrong."""

    def __init__(self) -> None:
        self.answers: dict[int, Invocation] = {}
        self.faults: Counter[str] = Counter()
        self.last = ""

    def ask(self, policy: RemotePolicy, starts: RecordedStarts, row: int, candidates: int) -> None:
        """One moment; a fault is counted."""
        name: NoiseName = ("conformance", row)
        try:
            self.answers[row] = policy.invoke(
                starts.observations[row], noise=name, candidates=candidates
            )
        except PolicyError as error:
            self.faults[str(error.fault)] += 1
            self.last = error.found


def check(
    policy: RemotePolicy,
    starts: RecordedStarts,
    *,
    candidates: int,
    deadline_s: float,
    restarted: Callable[[], RemotePolicy] | None,
    earlier: str | None = None,
) -> Conformance:
    """Ask a policy about recorded moments, again in another order, and after a new start.

    Args:
        policy: Behind the wire.
        starts: Moments.
        candidates: N, chunks of an invocation.
        deadline_s: What an answer may take, s.
        restarted: Ends its process and starts another; None where we did not start it.
        earlier: `answers_sha256` of an earlier check; None for none.
    """
    first = _Asked()
    for row in range(len(starts)):
        first.ask(policy, starts, row, candidates)
    told = policy.told
    again = _again(policy, starts, first, candidates)
    after: _Asked | None = None
    restart_fault = ""
    if restarted is not None:
        try:
            after = _again(restarted(), starts, first, candidates)
        except PolicyError as error:
            restart_fault = str(error)
    repeats = _repeats("repeats", first, again, "asked again in another order on a new line")
    digest = _digest(again) if repeats.judged == "holds" else None
    findings = [
        _answers(first, len(starts)),
        repeats,
        _restarts(first, after, restart_fault),
        _seeded(told, repeats, first),
        _same(digest, earlier),
        _counted(told),
        *_plausible(first, starts, told),
        _spans(told),
        _in_time(first, deadline_s),
    ]
    return Conformance(
        policy.entry.name, len(starts), candidates, told.checkpoint, digest, tuple(findings)
    )


def _again(policy: RemotePolicy, starts: RecordedStarts, first: _Asked, candidates: int) -> _Asked:
    """Some of the moments a second time, last one first, on a line of its own."""
    policy.close()
    asked = _Asked()
    for row in sorted(first.answers, reverse=True)[:: max(1, len(first.answers) // AGAIN)]:
        asked.ask(policy, starts, row, candidates)
    return asked


def _answers(asked: _Asked, moments: int) -> Finding:
    finite = sum(bool(np.isfinite(one.actions).all()) for one in asked.answers.values())
    if asked.faults:
        counted = ", ".join(f"{kind} {number}" for kind, number in sorted(asked.faults.items()))
        said = f"{len(asked.answers)} of {moments} moments answered; {counted}: {asked.last}"
        return Finding("answers", "fails", "B", said)
    if finite < moments:
        said = f"{moments - finite} of {moments} answers hold a number that is none"
        return Finding("answers", "fails", "B", said)
    return Finding("answers", "holds", "B", f"{moments} of {moments} moments answered")


def _repeats(name: str, first: _Asked, second: _Asked, how: str) -> Finding:
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


def _restarts(first: _Asked, after: _Asked | None, fault: str) -> Finding:
    if fault:
        return Finding("restarts", "fails", "B", fault)
    if after is None:
        said = "it was not started here, so it cannot be started again"
        return Finding("restarts", "unknown", "B", said)
    return _repeats("restarts", first, after, "started anew")


def _seeded(told: Capabilities, repeats: Finding, asked: _Asked) -> Finding:
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


def _same(digest: str | None, earlier: str | None) -> Finding:
    if earlier is None:
        return Finding("unchanged", "unknown", "B", "no earlier check was named (--earlier)")
    if digest == earlier:
        return Finding("unchanged", "holds", "B", "it answers as in the earlier check")
    return Finding("unchanged", "fails", "B", "it answers otherwise than in the earlier check")


def _counted(told: Capabilities) -> Finding:
    if told.counts_evaluations:
        return Finding("evaluations", "holds", "B", "it counts its network evaluations")
    return Finding("evaluations", "unknown", "B", "it does not say how often its network ran")


def _plausible(asked: _Asked, starts: RecordedStarts, told: Capabilities) -> list[Finding]:
    names = ("follows_observation", "scale", "orientation", "own_answers")
    rows = [row for row, one in sorted(asked.answers.items()) if np.isfinite(one.actions).all()]
    if len(rows) < FEWEST:
        said = f"{len(rows)} finite answers, {FEWEST} are needed"
        return [Finding(name, "unknown", "D", said) for name in names]
    drawn = np.stack([asked.answers[row].actions for row in rows])
    recorded = starts.chunks[rows]
    chunks = nearest(drawn, recorded)
    share = shuffled_share(chunks, recorded, rng=stream(0, "conformance", "shuffle"))
    copies = copied(drawn, recorded)
    return [
        Finding(
            names[0], "holds" if share <= KNOWS_THE_MOMENT else "fails", "D",
            f"as near to other moments' recordings in {share:.4f} of the shuffles, at most "
            f"{KNOWS_THE_MOMENT}",
        ),
        _scale(chunks, recorded),
        _turned(chunks, recorded),
        Finding(
            names[3], "fails" if copies else "holds", "D",
            f"{copies} of {len(rows)} moments answered with the recording itself",
        ),
    ]  # fmt: skip


def _scale(chunks: Array, recorded: Array) -> Finding:
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
    return Finding("scale", "holds" if inside else "unknown", "D", said)


def _turned(chunks: Array, recorded: Array) -> Finding:
    off, compared = turned_away(chunks, recorded)
    low, high = clopper_pearson(off, compared)
    judged: Judged = "unknown"
    if low > OFF_TURN_SHARE:
        judged = "fails"
    elif high < OFF_TURN_SHARE:
        judged = "holds"
    said = f"at {off} of {compared} turned farther from the recording than recordings are apart"
    return Finding("orientation", judged, "D", said)


def _spans(told: Capabilities) -> Finding:
    missing = [str(term) for term in SAMPLER_TERMS if term not in told.spans]
    if missing:
        said = f"it does not measure {', '.join(missing)}: unknown, not zero"
        return Finding("spans", "unknown", "C", said)
    return Finding("spans", "holds", "C", f"it measures {', '.join(told.spans)}")


def _in_time(asked: _Asked, deadline_s: float) -> Finding:
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


def _digest(asked: _Asked) -> str:
    return actions_sha256(np.stack([asked.answers[row].actions for row in sorted(asked.answers)]))
