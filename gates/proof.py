"""Proof of reports, and admission: what a stage calls before its first line of work.

A `verdict` field is never believed: every material is hashed, the judge runs again over the
evidence, and the whole report must come out the same: from the same code, parameters, recorded
runs and library versions. Stages, command line and Gate E all prove by this one implementation.
"""

import datetime
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from gates.card import judge as card
from gates.differences import first_difference
from gates.engine import GateSpec, judge_gate
from gates.feasibility import gate as feasibility
from gates.need import gate as need
from gates.overriders import require_in_force
from gates.pipeline import basis_of, changed_pages, changed_task, outputs_of
from gates.readable import found_text, limit_text
from gates.report import (
    GATES,
    NAMES,
    Gate,
    GateReport,
    read_report,
    report_path,
    stage_of,
    writer_of,
)
from gates.reproducibility import gate as reproducibility
from gates.stress import gate as stress
from gates.verdicts import decided_by, decided_text
from genpolicy.errors import ConfigError, GenpolicyError, IntegrityError, RefusedError
from genpolicy.integrity.hashing import sha256_file

SPECS: dict[Gate, GateSpec] = {
    "A": need.GATE,
    "B": reproducibility.GATE,
    "C": feasibility.GATE,
    "D": stress.GATE,
    "E": card.GATE,
}
STAGE_REQUIRES: dict[str, Gate | None] = {
    "task": None,
    "record": None,
    "ingest": None,
    "audit": None,
    "train_baselines": None,
    "measure_baselines": None,
    "train_factors": None,
    "measure_factors": None,
    "gate_a": None,
    "candidates": "A",
    "train_generators": "A",
    "reload": "A",
    "latency": "A",
    "gate_b": None,
    "shadow": "B",
    "gate_c": None,
    "wall_clock": "C",
    "stress": "C",
    "monitors": "C",
    "gate_d": None,
    "failure_search": "D",
    "card": "D",
    "gate_e": None,
}


@dataclass(frozen=True)
class Admission:
    """Why a stage may begin.

    Attributes:
        stage: The stage.
        reports: Proved and passed report of each gate below it.
        hashes: SHA-256 of those reports.
    """

    stage: str
    reports: dict[Gate, GateReport]
    hashes: dict[Gate, str]

    @property
    def candidates(self) -> tuple[str, ...]:
        """Methods that passed the highest gate below the stage; empty before Gate B.

        They are what the stage runs: a method that failed goes no further.
        """
        if not self.reports:
            return ()
        last = self.reports[max(self.reports)]
        return tuple(name for name, verdict in last.candidates.items() if verdict == "PASS")


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


def judge(root: Path, gate: Gate, *, today: datetime.date | None = None) -> GateReport:
    """Report of a gate from the files below `root`; writes nothing.

    Args:
        root: Repository root.
        gate: Which gate.
        today: Day on which a card is judged (Gate E); today (UTC) if not given.

    Raises:
        ConfigError: The section of `params.yaml` is missing or wrong.
        IntegrityError: Evidence that is not what it claims to be.
    """
    if gate != "E":
        return judge_gate(SPECS[gate], root)
    try:
        chain = card.Chain(*prove_chain(root, "D"))
    except GenpolicyError as error:
        chain = card.Chain({}, {}, str(error))
    return card.judge_card(root, chain, today=today)


def admit(stage: str, root: Path) -> Admission:
    """Let a stage begin, or refuse.

    Args:
        stage: Name of the stage; gate stages and those before Gate A need no gate.
        root: Repository root.

    Raises:
        ConfigError: No such stage, `params.yaml` is wrong, or a limit is overridden by somebody
            who may not, or no longer.
        IntegrityError: A report is malformed or of another schema version; run its gate again.
        RefusedError: A report is missing, untrue, or not PASS.
    """
    if stage not in STAGE_REQUIRES:
        raise ConfigError(
            where="stage",
            found=repr(stage),
            expected=f"one of {', '.join(STAGE_REQUIRES)}",
            action="Register the stage in gates.proof.STAGE_REQUIRES.",
        )
    needed = STAGE_REQUIRES[stage]
    reports, hashes = prove_chain(root, needed) if needed else ({}, {})
    require_in_force(root, reports)
    return Admission(stage, reports, hashes)


def prove_chain(root: Path, through: Gate) -> tuple[dict[Gate, GateReport], dict[Gate, str]]:
    """Prove every gate up to `through` and require PASS of each.

    Returns:
        Report and SHA-256 by gate.

    Raises:
        IntegrityError: A report is malformed or of another schema version.
        RefusedError: A report is missing, untrue, or not PASS.
    """
    reports: dict[Gate, GateReport] = {}
    hashes: dict[Gate, str] = {}
    for gate in GATES[: GATES.index(through) + 1]:
        reports[gate], hashes[gate] = verify_report(root, gate, upstream=hashes)
        require_pass(gate, reports[gate])
    return reports, hashes


def prove_all(root: Path) -> list[Rung]:
    """State of every gate, each proved again from the bytes up."""
    rungs = []
    reports: dict[Gate, GateReport] = {}
    hashes: dict[Gate, str] = {}

    def card_again(_root: Path, _gate: Gate) -> GateReport:
        """Gate E over the chain that was proved just now."""
        return card.judge_card(root, card.Chain(reports, hashes))

    for gate in GATES:
        path = report_path(gate)
        if not (root / path).is_file():
            rungs.append(Rung(gate, NAMES[gate], "NOT JUDGED", "", f"no {path}", path, 3))
            continue
        passed = gate == "E" and [r.verdict for r in reports.values()] == ["PASS"] * 4
        again = card_again if passed else judge
        try:
            report, digest = verify_report(root, gate, upstream=hashes, judging=again)
        except GenpolicyError as error:
            code = error.exit_code
            rungs.append(Rung(gate, NAMES[gate], "REFUSED", "", str(error), path, code))
            continue
        reports[gate], hashes[gate] = report, digest
        code = 0 if report.verdict == "PASS" else 3
        text = decided_text(report)
        rungs.append(Rung(gate, NAMES[gate], report.verdict, text, report.decision, path, code))
    return rungs


def verify_report(
    root: Path,
    gate: Gate,
    *,
    upstream: Mapping[Gate, str],
    judging: Callable[[Path, Gate], GateReport] = judge,
) -> tuple[GateReport, str]:
    """A report that is proved true, whatever its verdict, and the SHA-256 of its bytes.

    Args:
        root: Repository root.
        gate: Which gate.
        upstream: SHA-256 of the reports below, as proved before.
        judging: The judge to run again.

    Raises:
        IntegrityError: The report is malformed or of another schema version.
        RefusedError: It is missing, or what it says is not what the files say.
    """
    path = root / report_path(gate)
    if not path.exists() and not path.is_symlink():
        raise _refused(gate, "report", "missing", "a report", f"Run `dvc repro {stage_of(gate)}`.")
    report, digest = read_report(root, gate)
    _check_materials(root, gate, report)
    _check_upstream(gate, report, upstream)
    _check_basis(root, gate, report)
    _check_same(gate, report, judging(root, gate))
    page = changed_pages(root, gate)
    if page:
        action = f"Run `dvc repro {stage_of(gate)}`; never edit a page."
        raise _refused(gate, page, "another page", "the page printed when the gate ran", action)
    return report, digest


def require_pass(gate: Gate, report: GateReport) -> None:
    """Let only PASS through.

    Raises:
        RefusedError: Any other verdict; names the criterion that decided.
    """
    if report.verdict == "PASS":
        return
    decided = decided_by(report)
    if decided is None:
        raise _refused(gate, "verdict", report.verdict, "PASS", report.decision)
    name = f"{decided.id}({decided.candidate})" if decided.candidate else decided.id
    action = f"{report.decision.rstrip('.')}. {report.diagnosis}".strip()
    raise _refused(gate, name, found_text(decided, of_how_many=False), limit_text(decided), action)


def _check_materials(root: Path, gate: Gate, report: GateReport) -> None:
    for name, expected in report.materials.items():
        try:
            if ".." in Path(name).parts or Path(name).is_absolute():
                raise _refused(gate, f"material {name}", "outside the repository", "inside", "")
            found = sha256_file(root / name)
        except IntegrityError as error:
            found = error.found
        if found != expected:
            stage = writer_of(name) if len(Path(name).parts) > 2 else stage_of(gate)
            raise _refused(
                gate,
                f"sha256 of {name}",
                f"{found[:16]}…",
                f"{expected[:16]}…",
                f"Run `dvc repro {stage}` and judge again, or restore the original bytes.",
            )
    for name in outputs_of(root, gate):
        if name not in report.materials:
            action = f"Run `dvc repro {writer_of(name)}` and judge again, or remove it."
            raise _refused(gate, name, "a file that nobody judged", "in the report", action)


def _check_upstream(gate: Gate, report: GateReport, upstream: Mapping[Gate, str]) -> None:
    for below in GATES:
        found, expected = upstream.get(below, "none"), report.upstream.get(below, "none")
        if found != expected:
            raise _refused(
                gate,
                f"sha256 of {report_path(below)}",
                f"{found[:16]}…",
                f"{expected[:16]}…",
                f"Run `dvc repro -f {stage_of(gate)}`: the gate below was judged again since.",
            )


def _check_basis(root: Path, gate: Gate, report: GateReport) -> None:
    changed = changed_task(root) if gate == "A" else ""
    if changed:
        raise _refused(gate, changed, "another file", "the one measured on", "Run `dvc repro`.")
    now = basis_of(root, gate)
    for kind, stated, found in (
        ("code", report.code, now.code),
        ("parameters", report.parameters, now.parameters),
        ("the recorded run", report.pipeline, now.pipeline),
    ):
        for name in sorted({*stated, *found}):
            if stated.get(name) != found.get(name):
                raise _refused(
                    gate,
                    f"{kind} of {name}",
                    f"{found.get(name, 'none')[:16]}…",
                    f"{stated.get(name, 'none')[:16]}… as judged",
                    "Run `dvc repro`, or restore what was judged.",
                )


def _check_same(gate: Gate, report: GateReport, again: GateReport) -> None:
    difference = first_difference(report, again)
    if difference is None:
        return
    place, stated, derived = difference
    raise _refused(
        gate,
        f"{report_path(gate)}{place}",
        stated,
        f"{derived} as derived again from evidence and params.yaml",
        f"Run `dvc repro -f {stage_of(gate)}`; never edit a report.",
    )


def _refused(gate: Gate, criterion: str, measured: str, limit: str, action: str) -> RefusedError:
    return RefusedError(
        gate=gate,
        criterion=criterion,
        measured=measured,
        limit=limit,
        report=report_path(gate),
        action=action,
    )
