"""Gate B's evidence of what a brought policy answers at recorded moments: the conformance kit's.

Answers are written down and findings derived from them, by the functions of `check-candidate`, so
that a proof can do the second again without the candidate and hold the first against it.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from genpolicy.candidates.conformance.asked import Asked, asked_again, asked_first, repeated
from genpolicy.candidates.conformance.check import Answered, findings_of, question
from genpolicy.candidates.conformance.finding import Finding
from genpolicy.candidates.conformance.recorded_starts import RecordedStarts
from genpolicy.candidates.wire.extension import Capabilities
from genpolicy.candidates.wire.faults import PolicyError
from genpolicy.candidates.wire.policy import WirePolicy
from genpolicy.candidates.wire.remote import Invocation
from genpolicy.contract.action import ACTION_DIM
from genpolicy.evidence.documents.conformance import Conformance
from genpolicy.evidence.rows.brought import AGAIN, ANEW, FIRST, AnswerRow

CANDIDATES = 4
"""Chunks at a moment: several ways may be right, and the nearest is held against the recording."""


@dataclass(frozen=True)
class FirstStart:
    """Answers of one start: at every moment, and at some of them again in another order."""

    first: Asked
    again: Asked


def first_session(policy: WirePolicy, starts: RecordedStarts) -> FirstStart:
    """Ask about every moment, then about some of them again."""
    number, remote = drawn(stochastic=policy.stochastic), policy.remote
    if isinstance(remote, PolicyError):
        return FirstStart(_unanswered(remote, range(len(starts))), Asked())
    first = asked_first(remote, starts, number)
    return FirstStart(first, asked_again(remote, starts, first, number))


def second_session(policy: WirePolicy, starts: RecordedStarts, before: FirstStart) -> Asked:
    """Ask the same ones again, after a new start."""
    number, remote = drawn(stochastic=policy.stochastic), policy.remote
    if isinstance(remote, PolicyError):
        rows = [row for row in repeated(starts.apart) if row in before.first.answers]
        return _unanswered(remote, rows)
    return asked_again(remote, starts, before.first, number)


def _unanswered(fault: PolicyError, rows: Iterable[int]) -> Asked:
    """Of a server that is not there: the same fault at each moment."""
    asked = Asked()
    asked.failures = dict.fromkeys(rows, (str(fault.fault), fault.found))
    return asked


def drawn(*, stochastic: bool) -> int:
    """Chunks that are asked for at a moment."""
    return CANDIDATES if stochastic else 1


def conformance_of(
    starts: RecordedStarts,
    told: Capabilities,
    session: FirstStart,
    anew: Asked | None,
    *,
    candidates: int,
) -> Conformance:
    """The document of one candidate.

    Args:
        starts: The moments.
        told: What its server says that it can.
        session: Answers of the first start.
        anew: Answers after a new start; None where it is not started here.
        candidates: Chunks asked for at a moment.
    """
    asked = question(starts, dataset="", candidates=candidates)
    return Conformance(
        episodes=starts.apart,
        moments=len(starts),
        candidates=candidates,
        observations_sha256=asked.observations_sha256,
        seeded=told.seeded,
        counts_evaluations=told.counts_evaluations,
        most_candidates=told.candidates,
        findings=findings_of(starts, Answered(session.first, session.again, anew), told),
    )


def answer_rows(
    method: str, starts: RecordedStarts, session: FirstStart, anew: Asked | None
) -> list[AnswerRow]:
    """What was answered, session by session, in the order in which it was asked."""
    parts = {FIRST: session.first, AGAIN: session.again, ANEW: anew or Asked()}
    return [
        AnswerRow(method, name, row, str(starts.episodes[row]), *_told(asked, row))
        for name, asked in parts.items()
        for row in sorted({*asked.answers, *asked.failures}, reverse=name != FIRST)
    ]


def _told(asked: Asked, row: int) -> tuple[str, str, int, int | None, tuple[float, ...]]:
    answer = asked.answers.get(row)
    if answer is None:
        return (*asked.failures[row], 0, None, ())
    actions = tuple(answer.actions.reshape(-1).tolist())
    return "", "", len(answer.actions), answer.evaluations, actions


def findings_again(
    rows: Iterable[AnswerRow], starts: RecordedStarts, stated: Conformance
) -> Sequence[Finding]:
    """What follows from written answers, derived again.

    Args:
        rows: Of one candidate.
        starts: The moments, cut from the dataset again.
        stated: What its document says that its server can.

    Raises:
        ValueError: The numbers of an answer are no chunks.
    """
    asked: Mapping[str, Asked] = {FIRST: Asked(), AGAIN: Asked(), ANEW: Asked()}
    for row in rows:
        into = asked[row.session]
        if row.fault:
            into.failures[row.moment] = (row.fault, row.said)
        else:
            into.answers[row.moment] = invocation_of(row)
    anew = asked[ANEW]
    started = bool(anew.answers or anew.failures)
    told = Capabilities(seeded=stated.seeded, counts_evaluations=stated.counts_evaluations)
    answered = Answered(asked[FIRST], asked[AGAIN], anew if started else None)
    return findings_of(starts, answered, told)


def invocation_of(row: AnswerRow) -> Invocation:
    """A written answer as it came; how long it took is not written.

    Raises:
        ValueError: Its numbers are no chunks.
    """
    actions = np.array(row.actions).reshape(row.candidates, -1, ACTION_DIM)
    return Invocation(actions, row.evaluations, {}, 0.0, 1)
