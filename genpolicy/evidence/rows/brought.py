"""Rows of what policies behind the wire answered: at recorded moments, and at Gate B's fixtures."""

from dataclasses import dataclass

FIRST, AGAIN, ANEW = "first", "again", "anew"
"""At every moment; some of them a second time; the same ones after a new start."""
BEFORE, AFTER = "before", "after"
"""Ahead of everything else that a server is asked, and behind it."""


@dataclass(frozen=True)
class AnswerRow:
    """`answers.parquet` of reload: one recorded moment, as a brought policy answered it.

    Attributes:
        method: The candidate.
        session: `first`, `again` or `anew`.
        moment: Number of the moment.
        episode_uuid: Episode that it lies in.
        fault: Kind of the fault that came in place of an answer; empty with an answer.
        said: What was seen of the fault.
        candidates: Chunks of the answer.
        evaluations: Network evaluations of a sample; None where its server does not count.
        actions: The chunks as mapped actions, candidate by candidate; empty without an answer.
    """

    method: str
    session: str
    moment: int
    episode_uuid: str
    fault: str
    said: str
    candidates: int
    evaluations: int | None
    actions: tuple[float, ...]


@dataclass(frozen=True)
class FixtureAgainRow:
    """`fixtures.parquet` of shadow and stress: a fixture of Gate B, asked again of one server.

    Attributes:
        method: The candidate.
        condition: What the server was started for: the shadow test, or a condition of stress.
        when: `before` or `after` everything else that it was asked there.
        row: Which fixture.
        answered: Whether an answer came.
        sha256: Of its chunks; empty without an answer.
    """

    method: str
    condition: str
    when: str
    row: int
    answered: bool
    sha256: str
