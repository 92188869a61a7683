"""The conformance kit: what a policy behind the wire does, before any gate asks it.

A minute on recorded moments; nothing moves. Each finding holds, fails, or is not known, says what
was seen, and which gate asks for it. None of it is a verdict of a gate.
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from genpolicy.candidates.conformance import findings as found
from genpolicy.candidates.conformance.asked import (
    Asked,
    asked_again,
    asked_first,
    repeated,
    round_trips,
)
from genpolicy.candidates.conformance.finding import Finding
from genpolicy.candidates.conformance.findings import Admissible
from genpolicy.candidates.conformance.recorded_starts import RecordedStarts
from genpolicy.candidates.conformance.units import plausible
from genpolicy.candidates.wire.extension import Capabilities
from genpolicy.candidates.wire.faults import PolicyError
from genpolicy.candidates.wire.remote import RemotePolicy
from genpolicy.contract.chunk import actions_sha256
from genpolicy.integrity.hashing import sha256_bytes


@dataclass(frozen=True)
class Question:
    """What a candidate is asked.

    Attributes:
        dataset: SHA-256 of the manifest of the dataset.
        episodes: Of which each gives one moment first, and further ones behind those.
        moments: Recorded moments.
        candidates: Chunks asked for at each.
        observations_sha256: Of the observations at the moments that are asked twice.
    """

    dataset: str
    episodes: int
    moments: int
    candidates: int
    observations_sha256: str


def question(starts: RecordedStarts, *, dataset: str, candidates: int) -> Question:
    """What is asked of whoever is checked at these moments."""
    again = np.ascontiguousarray(starts.observations[repeated(starts.apart)])
    digest = sha256_bytes(again.tobytes())
    return Question(dataset, starts.apart, len(starts), candidates, digest)


@dataclass(frozen=True)
class Conformance:
    """What was found of one candidate.

    Attributes:
        candidate: Its name.
        asked: What it was asked; answers to something else are not to be compared.
        checkpoint: What it says that it serves; None where it does not.
        answers_sha256: Of its chunks at the moments that were asked twice: what it is, by what it
            does. None where it did not repeat itself, or left one out.
        findings: In the order of the gates.
    """

    candidate: str
    asked: Question
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


@dataclass(frozen=True)
class Answered:
    """What was answered to a question.

    Attributes:
        first: At every moment.
        again: At some of them a second time, in another order, on a new line.
        after: At the same ones after a new start; None where nobody could start it anew.
        restart_fault: Why it did not start anew; empty if it did.
    """

    first: Asked
    again: Asked
    after: Asked | None
    restart_fault: str = ""


def findings_of(starts: RecordedStarts, answered: Answered, told: Capabilities) -> list[Finding]:
    """What answers alone say: the same again, and in the declared units. Gate B asks for each.

    No clock has a say in it, so that equal answers give equal findings.

    Args:
        starts: The moments.
        answered: What was answered there.
        told: What the server says that it can.
    """
    first = answered.first
    how = "asked again in another order on a new line"
    repeats = found.repeats("repeats", first, answered.again, how)
    return [
        found.answers(first, len(starts)),
        repeats,
        found.restarts(first, answered.after, answered.restart_fault),
        found.seeded(told, repeats, first),
        found.evaluations(told, first, answered.again),
        *plausible(first, starts),
    ]


def check(
    policy: RemotePolicy,
    starts: RecordedStarts,
    *,
    asked: Question,
    deadline_s: float,
    restarted: Callable[[], RemotePolicy] | None,
    earlier: str | None = None,
    admissible: Admissible | None = None,
    said: Sequence[Finding] = (),
) -> Conformance:
    """Ask a policy about recorded moments, again in another order, and after a new start.

    Args:
        policy: Behind the wire.
        starts: Moments.
        asked: What is asked; see `question`.
        deadline_s: What an answer may take, s.
        restarted: Ends its process and starts another; None where we did not start it.
        earlier: `answers_sha256` of an earlier check; None for none.
        admissible: Whether a chunk passes every layer of the task; None where there is none.
        said: What was found of its entry.
    """
    candidates = asked.candidates
    wire = round_trips(policy)
    first = asked_first(policy, starts, candidates)
    told = policy.told
    again = asked_again(policy, starts, first, candidates)
    after: Asked | None = None
    restart_fault = ""
    if restarted is not None:
        try:
            after = asked_again(restarted(), starts, first, candidates)
        except PolicyError as error:
            restart_fault = error.seen
    answered = Answered(first, again, after, restart_fault)
    of_answers = findings_of(starts, answered, told)
    repeats = next(one for one in of_answers if one.name == "repeats")
    complete = sorted(again.answers) == repeated(starts.apart)
    digest = _digest(again) if repeats.judged == "holds" and complete else None
    of_each = first.before(starts.apart)
    findings = [
        *said,
        *of_answers,
        found.unchanged(digest, earlier, complete=complete),
        found.admissible(of_each, starts, admissible),
        found.spans(told, of_each, wire),
        found.in_time(of_each, deadline_s),
    ]
    return Conformance(policy.entry.name, asked, told.checkpoint, digest, tuple(findings))


def _digest(asked: Asked) -> str:
    return actions_sha256(np.stack([asked.answers[row].actions for row in sorted(asked.answers)]))
