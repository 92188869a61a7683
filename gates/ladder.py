"""The whole ladder: all five judges, and how far a repository has come."""

from dataclasses import dataclass
from pathlib import Path

from gates import gate_e
from gates.chain import limit_text, measured_text, verify_report
from gates.models import GATES, Gate, GateReport, report_path
from gates.registry import LOWER, Judge, judge_with
from gates.verdicts import first_unmet
from genpolicy.errors import GenpolicyError, IntegrityError, RefusedError

JUDGES: dict[Gate, Judge] = {**LOWER, "E": Judge(gate_e.SPEC, gate_e.Params, gate_e.judge)}
NAMES: dict[Gate, str] = {
    "A": "need",
    "B": "reproducibility",
    "C": "feasibility and time",
    "D": "matched simulation and stress",
    "E": "trial card",
}


@dataclass(frozen=True)
class Rung:
    """One gate as proved now.

    Attributes:
        gate: Letter.
        name: What it asks for.
        verdict: Verdict of the proved report; `NOT JUDGED` without a report, `REFUSED` if the
            report is not what the files say.
        decided_by: The criterion that decided, measured against its limit; empty after PASS.
        note: Decision of the report, or why it is refused.
        report: Path of the report.
        exit_code: Exit code that this state stands for.
    """

    gate: Gate
    name: str
    verdict: str
    decided_by: str
    note: str
    report: str
    exit_code: int


def judge(root: Path, gate: Gate) -> GateReport:
    """Report of a gate from the files below `root`; writes nothing.

    Raises:
        ConfigError: The section of `params.yaml` is missing or wrong.
        IntegrityError: Evidence that is not what it claims to be.
    """
    return judge_with(root, JUDGES[gate])


def decided_text(report: GateReport) -> str:
    """The criterion that decided, in one phrase; empty after PASS."""
    decided = first_unmet(report.criteria, report.verdict)
    if decided is None:
        return ""
    of = f" ({decided.candidate})" if decided.candidate else ""
    return f"{decided.id}{of}: {measured_text(decided)}, required {limit_text(decided)}"


def prove_all(root: Path) -> list[Rung]:
    """State of every gate, each proved again from the bytes up."""
    rungs = []
    hashes: dict[str, str] = {}
    for gate in GATES:
        path = report_path(gate)
        if not (root / path).is_file():
            rungs.append(
                Rung(gate, NAMES[gate], "NOT JUDGED", "", f"no {path}", path, 3),
            )
            continue
        try:
            report, digest = verify_report(root, gate, upstream=dict(hashes), judging=judge)
        except GenpolicyError as error:
            code = error.exit_code if isinstance(error, RefusedError | IntegrityError) else 2
            rungs.append(Rung(gate, NAMES[gate], "REFUSED", "", str(error), path, code))
            continue
        hashes[gate] = digest
        code = 0 if report.verdict == "PASS" else 3
        text = decided_text(report)
        rungs.append(Rung(gate, NAMES[gate], report.verdict, text, report.decision, path, code))
    return rungs
