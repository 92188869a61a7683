"""One look: a question to judged reports and their evidence, and what was found.

A criterion that is broken speaks, and so does a rule that a query states; what holds is a number.
What was asked and is open is not decided; what nobody recorded or judged is said to be so. Neither
is a finding either way, and neither holds.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from gates.bounds import upper_quantile, wide_interval
from gates.diagnosis.reports import NoAnswer, Reports
from gates.doubt import sentence
from gates.evidence import MissingEvidenceError
from gates.readable import between, limit_text, measured_text
from gates.report import Answer, Gate, report_path
from genpolicy.errors import GenpolicyError

Interval = tuple[float, float]


class NotJudgedError(MissingEvidenceError):
    """A gate whose evidence is asked for is not judged."""


@dataclass(frozen=True)
class Number:
    """One number, and where it stands.

    Attributes:
        what: What it is.
        value: As it was measured, with its interval where it has one.
        counted: The independent units that it rests on.
        where: Report or table, and what in it.
        limit: What it is held against; empty where nobody limits it.
        verdict: Of the criterion; empty likewise.
    """

    what: str
    value: str
    counted: str
    where: str
    limit: str = ""
    verdict: str = ""


@dataclass(frozen=True)
class Look:
    """A look at one candidate: what a query fills in.

    Attributes:
        reports: What there is.
        candidate: Whom it is about; empty where no gate has judged one.
        numbers: What was found.
        causes: What speaks, as sentences.
        undecided: What was asked, and has no answer either way.
        unknown: What cannot be said, and why.
        waits_for: Why something could not be asked yet: a gate that is not judged.
    """

    reports: Reports
    candidate: str
    numbers: list[Number] = field(default_factory=list)
    causes: list[str] = field(default_factory=list)
    undecided: list[str] = field(default_factory=list)
    unknown: list[str] = field(default_factory=list)
    waits_for: list[str] = field(default_factory=list)

    def criteria(self, *names: str) -> None:
        """Ask criteria by name; one that is broken is a cause."""
        for name in names:
            answer = self._answered(name)
            if answer is not None and answer.verdict == "FAIL":
                why = f" {sentence(answer.caveat)}" if answer.caveat else ""
                self.causes.append(
                    f"{answer.id}: {measured_text(answer)}, required {limit_text(answer)}.{why}"
                )
            elif answer is not None and answer.verdict != "PASS":
                self.undecided.append(_open(answer))

    def shown(self, *names: str) -> None:
        """Ask criteria that say how bad the symptom is, and not where it comes from."""
        for name in names:
            self._answered(name)

    def rows(self, gate: Gate, path: str, row: type, *, all_methods: bool = False) -> pd.DataFrame:
        """Rows of a table that a judged gate rests on, of the candidate or of everybody.

        Raises:
            NotJudgedError: The gate is not judged.
            MissingEvidenceError: The table has no such row.
        """
        if gate not in self.reports.judged:
            raise NotJudgedError(self.reports.missing[gate])
        if all_methods:
            return self.reports.evidence.rows(path, row)
        return self.reports.evidence.of(path, row, self.candidate)

    def ask(self, rule: Callable[["Look"], None]) -> None:
        """Let a rule read evidence; what is missing is said, and stops no other rule."""
        try:
            rule(self)
        except (MissingEvidenceError, GenpolicyError) as error:
            said = self.waits_for if isinstance(error, NotJudgedError) else self.unknown
            if str(error) not in said:
                said.append(str(error))

    def number(self, what: str, value: str, counted: str, where: str) -> None:
        """Show a number that no criterion limits."""
        self.numbers.append(Number(what, value, counted, where))

    def _answered(self, name: str) -> Answer | None:
        found = self.reports.answer(name, self.candidate)
        if isinstance(found, NoAnswer):
            said = self.waits_for if found.waits else self.unknown
            if found.why not in said:
                said.append(found.why)
            return None
        of = f" of {found.candidate}" if found.candidate else ""
        self.numbers.append(
            Number(
                what=found.question,
                value=value_text(found),
                counted=found.counted,
                where=f"{report_path(name[0])}: {found.id}{of}",
                limit=limit_text(found),
                verdict=found.verdict,
            )
        )
        return found


def value_text(answer: Answer) -> str:
    """What was measured, with its interval."""
    if answer.interval is None or answer.measured is None:
        return measured_text(answer)
    return f"{measured_text(answer)} ({between(answer)})"


def share_of(hits: pd.Series, clusters: pd.Series, *, confidence: float) -> tuple[float, Interval]:
    """Share of hits, and its exact interval over clusters, wide to both sides.

    Raises:
        MissingEvidenceError: No rows.
    """
    marked, drawn = hits.to_numpy(dtype=np.float64), clusters.to_numpy()
    share, low, high = wide_interval(marked, drawn, confidence=confidence)
    return share, (low, high)


def p95_of(
    values: pd.Series, clusters: pd.Series, *, confidence: float, rng: np.random.Generator
) -> tuple[float, Interval]:
    """95 % quantile, and its interval over clusters.

    Raises:
        MissingEvidenceError: Too few to bound it.
    """
    found = values.to_numpy(dtype=np.float64)
    return upper_quantile(found, clusters.to_numpy(), 0.95, confidence=confidence, rng=rng)


def _open(answer: Answer) -> str:
    """What is open, and why if the gate says so."""
    why = f": {answer.caveat}" if answer.caveat else ""
    return f"{answer.id} is {answer.verdict}, required {limit_text(answer)}{why}"
