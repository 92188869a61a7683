"""What a diagnosis stands on: reports that were proved just now, and the evidence they bind."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from gates.evidence import Evidence
from gates.printed import worst
from gates.proof import SPECS, Rung, prove_all
from gates.report import GATES, Answer, Gate, GateReport, read_report, stage_of
from gates.reproducibility.settings import MATCHING
from gates.settings import (
    Waiver,
    read_limits,
    read_params,
    read_settings,
    waived_criterion,
    waived_question,
)
from genpolicy.errors import BadInputError

OF_EVIDENCE = GATES[:-1]
"""Gates of measured evidence."""
UNASKED = "unasked_checks"
"""The criterion of Gate A that stands for all questions to the data; each may be waived."""
UNPROVED = ("REFUSED", "NOT JUDGED")
EVERYBODY = ""
"""In place of a candidate, where no gate has judged one yet."""


@dataclass(frozen=True)
class NoAnswer:
    """Why a criterion has no answer.

    Attributes:
        why: As a sentence without its end.
        waits: Whether an answer is still to come; of what was waived none is.
    """

    why: str
    waits: bool


@dataclass(frozen=True)
class Reports:
    """The judged reports of one repository.

    Attributes:
        root: Repository root.
        judged: Reports that are what the files say, by gate.
        missing: Why the others cannot be used, and what to do, by gate.
        untrue: Exit code of a report that lies here and is not what the files say; 0 without one.
        evidence: What lies below the root.
    """

    root: Path
    judged: Mapping[Gate, GateReport]
    missing: Mapping[Gate, str]
    untrue: int
    evidence: Evidence

    @property
    def candidates(self) -> tuple[str, ...]:
        """Everybody whom a gate has judged; `EVERYBODY` alone where none has."""
        reports = (self.judged[gate] for gate in OF_EVIDENCE if gate in self.judged)
        return tuple(dict.fromkeys(name for one in reports for name in one.candidates)) or (
            EVERYBODY,
        )

    def answer(self, name: str, candidate: str) -> Answer | NoAnswer:
        """A criterion as it was answered, of a candidate or of the whole gate.

        Args:
            name: Gate and criterion: `D.hold_share_upper`.
            candidate: Whose; what is asked of the whole gate is the same for all.

        Returns:
            The answer; where there is none, why.
        """
        gate, wanted = gate_and_id(name)
        report = self.judged.get(gate)
        if report is None:
            return NoAnswer(self.missing[gate], waits=True)
        found = [c for c in report.criteria if c.id == wanted]
        own = next((c for c in found if c.candidate in (None, candidate)), None)
        if own is not None:
            return own
        if _of_each(gate, wanted) and candidate not in report.candidates:
            if candidate == EVERYBODY:
                return NoAnswer(f"gate {gate} asks {wanted} of each candidate", waits=True)
            why = f"{candidate} does not stand at gate {gate}: it did not pass below"
            return NoAnswer(why, waits=True)
        said = " ".join(self.not_asked(name, candidate)).rstrip(".")
        why = said or f"it was not asked for {wanted}, which does not apply here"
        return NoAnswer(f"gate {gate}: {why}", waits=False)

    def not_asked(self, name: str, candidate: str) -> tuple[str, ...]:
        """What a judged gate was kept from asking, by whose word and why.

        What only those are asked who were brought, or only who was trained here, is no exception:
        of anybody else there is nothing to ask.

        Args:
            name: Gate and criterion: `B.unmatched_keys`.
            candidate: Whose.

        Returns:
            Sentences; none where the criterion was asked whole, or where the gate is not judged.
        """
        gate, wanted = gate_and_id(name)
        if gate not in self.judged:
            return ()
        settings = self.settings(gate)
        waiver = settings.limits.waived.get(wanted)
        if waiver is not None:
            return (waived_criterion(wanted, waiver),)
        if wanted == UNASKED:
            waived = settings.waived_checks.items()
            return tuple(
                waived_question(check, Waiver(reason, owner))
                for owner, checks in waived
                for check, reason in checks.items()
            )
        if self.is_excepted(name, candidate):
            return (f"{wanted} was not asked of {candidate}: {self.unmatched[candidate]}.",)
        return ()

    def is_excepted(self, name: str, candidate: str) -> bool:
        """Whether matching was not asked of a candidate, by a written exception."""
        gate, wanted = gate_and_id(name)
        return gate == "B" and wanted in MATCHING and candidate in self.unmatched

    @property
    def unmatched(self) -> Mapping[str, str]:
        """Candidates that are compared by exception, and who answers for it, until when and why."""
        if "B" not in self.judged:
            return {}
        return {
            name: f"it is unmatched, which the {entry.owner} owner answers for until "
            f"{entry.expires} ({entry.reason})"
            for name, entry in self.settings("B").unmatched.items()
        }

    def settings(self, gate: Gate) -> Any:
        """Settings of a gate, with the limits that it judged by."""
        if gate not in self._settings:
            params, spec = read_params(self.root), SPECS[gate]
            settings = read_settings(params, stage_of(gate), spec.settings)
            self._settings[gate] = settings.under(read_limits(params, gate, spec.criteria))
        return self._settings[gate]

    @cached_property
    def _settings(self) -> dict[Gate, Any]:
        """What was read of them: a walk asks for the same hundreds of times."""
        return {}


def gate_and_id(name: str) -> tuple[Gate, str]:
    """Gate and criterion of a name such as `D.hold_share_upper`.

    Raises:
        KeyError: No gate of that letter.
    """
    letter, _, wanted = name.partition(".")
    return {str(gate): gate for gate in GATES}[letter], wanted


def read_reports(root: Path) -> Reports:
    """Prove every report that lies here.

    Raises:
        ConfigError: `params.yaml` is missing or malformed.
    """
    rungs = prove_all(root)
    judged = {r.gate: read_report(root, r.gate)[0] for r in rungs if r.verdict not in UNPROVED}
    missing = {r.gate: _why(r, judged) for r in rungs if r.verdict in UNPROVED}
    refused = {r.exit_code for r in rungs if r.verdict == "REFUSED"}
    return Reports(root, judged, missing, worst(refused), Evidence(root))


def require_candidates(reports: Reports, candidate: str) -> tuple[str, ...]:
    """Whom to ask about: one by name, or everybody.

    Raises:
        BadInputError: No gate has judged anybody of that name.
    """
    known = reports.candidates
    if not candidate:
        return known
    if candidate not in known:
        raise BadInputError(
            where="--candidate",
            found=repr(candidate),
            expected=", ".join(filter(None, known)) or "nobody: no gate has judged a candidate yet",
            action="Name one of them, or leave it out.",
        )
    return (candidate,)


def _of_each(gate: Gate, wanted: str) -> bool:
    """Whether a gate asks a criterion of each candidate."""
    return any(item.id == wanted and item.per_candidate for item in SPECS[gate].criteria)


def _why(rung: Rung, judged: Mapping[Gate, GateReport]) -> str:
    gate = rung.gate
    if rung.verdict == "REFUSED":
        return f"gate {gate} cannot be used: {rung.note.rstrip('.')}"
    for below in GATES[: GATES.index(gate)]:
        if below in judged and judged[below].verdict != "PASS":
            said = judged[below].verdict
            return (
                f"gate {gate} is not judged: gate {below} says {said}, and nothing behind it is "
                "built"
            )
    return f"gate {gate} is not judged here: run `dvc repro {stage_of(gate)}`, or `make ladder`"
