"""Candidates whose rollouts were stopped before the planned end: derived again, and believed so.

Fewer starts than planned are missing evidence, unless the rows themselves show that no outcome of
the rest could have made the candidate pass (`genpolicy.statistics.possible`). Then it failed,
and cannot be promoted. What the stage says of it (`blocks.json`) decides nothing, and must agree.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Protocol, cast

from gates.criterion import Measured
from gates.evidence import Evidence, MissingEvidenceError
from genpolicy.errors import ContractError
from genpolicy.evidence.blocks_run import blocks_document
from genpolicy.evidence.documents.stress import BLOCKS
from genpolicy.evidence.rows.stress import RolloutRow
from genpolicy.statistics.planned_blocks import Rule
from genpolicy.statistics.possible import (
    Ended,
    Out,
    Seen,
    due,
    out_after,
    seen_of,
)

ROLLOUTS = "artifacts/stress/rollouts.parquet"
"""Of the training that is judged; who ran how far is asked of no other."""


class Planned(Protocol):
    """What is asked of the settings of Gate D."""

    @property
    def rule(self) -> Rule | None:
        """By what a candidate is stopped; None where all starts are one block."""
        ...

    @property
    def baselines(self) -> tuple[str, ...]:
        """Simple methods."""
        ...

    @property
    def planned_starts(self) -> int:
        """Starts that are planned."""
        ...


@dataclass(frozen=True)
class Stop:
    """A candidate that was stopped.

    Attributes:
        candidate: Its name.
        ran: Starts that it ran.
        planned: Starts that were planned.
        out: Why it could no longer pass.
    """

    candidate: str
    ran: int
    planned: int
    out: Out

    def __str__(self) -> str:
        return (
            f"{self.candidate} was stopped: {self.ran} of {self.planned} starts were run, since it "
            f"could no longer pass ({self.out.said})"
        )


class StoppedError(MissingEvidenceError):
    """What would be measured of all planned starts, of a candidate that was stopped.

    Attributes:
        stop: How far it ran, and why no further.
    """

    def __init__(self, stop: Stop) -> None:
        super().__init__(str(stop))
        self.stop = stop


@dataclass(frozen=True)
class Ran:
    """How far each method of a comparison in blocks ran.

    Attributes:
        rule: What was planned.
        seen: Rollouts by method.
    """

    rule: Rule
    seen: Mapping[str, Seen]

    @property
    def candidates(self) -> list[str]:
        """Who stands for promotion and was run."""
        return [name for name in self.seen if name not in self.rule.simple]

    @property
    def last(self) -> int:
        """Starts that every simple method has to have: all that are planned, while anybody is in.

        Of whom rollouts are missing nobody knows that it was out.
        """
        try:
            stops = [self.stop_of(name) for name in self.candidates]
        except MissingEvidenceError:
            return self.rule.starts
        own = [stop.ran for stop in stops if stop is not None]
        return max(own) if own and len(own) == len(stops) else self.rule.starts

    def stop_of(self, candidate: str) -> Stop | None:
        """Why a candidate was stopped; None of one that ran all that was planned.

        Raises:
            MissingEvidenceError: It ran less, and its rows do not show that it was out; or a simple
                method ran less than it.
        """
        ran = self.seen[candidate].starts
        if ran >= self.rule.starts:
            return None
        if self.rule.number(ran) is None:
            raise MissingEvidenceError(
                f"{candidate} has {ran} of {self.rule.starts} starts, and no block of "
                f"{self.rule.block} ends there: rollouts of it are missing"
            )
        try:
            out = out_after(self.rule, self.seen, candidate, ran)
        except ContractError as error:
            raise MissingEvidenceError(str(error)) from error
        if out is None:
            raise MissingEvidenceError(
                f"{candidate} has {ran} of {self.rule.starts} starts, and after {ran} it could "
                "still have passed: rollouts of it are missing"
            )
        return Stop(candidate, ran, self.rule.starts, out)


def ran(evidence: Evidence, settings: Planned) -> Ran | None:
    """How far each method ran, from its rows alone; None where all starts are one block.

    Raises:
        MissingEvidenceError: No rows, or a method has other starts in one condition than in
            another.
    """
    rule = settings.rule
    return None if rule is None else evidence.once(("ran", rule), lambda: _ran(evidence, rule))


def _ran(evidence: Evidence, rule: Rule) -> Ran:
    rows = cast(Iterable[Ended], evidence.rows(ROLLOUTS, RolloutRow).itertuples(index=False))
    try:
        return Ran(rule, seen_of(rows, rule))
    except ContractError as error:
        raise MissingEvidenceError(str(error)) from error


def starts_of(evidence: Evidence, settings: Planned, method: str) -> int:
    """How many starts a method has to have; all that are planned, unless nobody was left.

    Raises:
        StoppedError: It is a candidate that was stopped.
        MissingEvidenceError: As `ran`, or `Ran.stop_of`.
    """
    found = ran(evidence, settings)
    if found is None:
        return settings.planned_starts
    if method in settings.baselines:
        return found.last
    stop = found.stop_of(method) if method in found.seen else None
    if stop is not None:
        raise StoppedError(stop)
    return settings.planned_starts


def require_as_said(evidence: Evidence, ran: Ran, folder: str) -> None:
    """What the stage says of its blocks is what the rows say, and each method ran what was due.

    Raises:
        MissingEvidenceError: They differ, or the stage says nothing; or as `Ran.stop_of`.
    """
    for name in ran.candidates:
        ran.stop_of(name)  # of who ran less and was not out, and of a simple method that ran less
    wanted = due(ran.rule, ran.seen, ran.candidates)
    for method, starts in wanted.items():
        found = ran.seen[method].starts if method in ran.seen else 0
        if found != starts:
            raise MissingEvidenceError(
                f"{method} ran {found} starts, where by its rows {starts} of "
                f"{ran.rule.starts} were due"
            )
    said, expected = evidence.document(folder, BLOCKS), blocks_document(ran.rule, ran.seen)
    for name in ("block", "starts", "last", "out"):
        told, own = getattr(said, name), getattr(expected, name)
        if told != own:
            raise MissingEvidenceError(
                f"{folder}/{BLOCKS.file}: {name} is {told}, by the rows {own}"
            )


def stopped_by(
    evidence: Evidence, settings: Planned, candidate: str, criterion: str
) -> Measured | None:
    """What a criterion measures of a candidate that was stopped by it; None of any other.

    The number is what it would be at the planned end at the best, so that it stands for all of it.

    Raises:
        MissingEvidenceError: As `ran`, or `Ran.stop_of`.
    """
    found = ran(evidence, settings)
    stop = found.stop_of(candidate) if found and candidate in found.seen else None
    if stop is None or stop.out.criterion != criterion:
        return None
    counted = f"{stop.ran} of {stop.planned} starts"
    return Measured(stop.out.value, caveat=str(stop), counted=counted)
