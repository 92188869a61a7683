"""Re-proof of one report: its bytes, its materials, its upstream and its verdict.

A `verdict` field is never believed: the judge runs again over the evidence, and the whole
report must come out the same, apart from the environment it was judged in.
"""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from gates.models import (
    Criterion,
    Gate,
    GateReport,
    read_report,
    report_path,
    stage_of,
)
from gates.verdicts import first_unmet
from genpolicy.errors import IntegrityError, RefusedError
from genpolicy.integrity.hashing import sha256_file

Judging = Callable[[Path, Gate], GateReport]
NOT_COMPARED = {"environment"}


def verify_report(
    root: Path, gate: Gate, *, upstream: Mapping[str, str], judging: Judging
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
    _check_same(gate, report, judging(root, gate))
    return report, digest


def require_pass(gate: Gate, report: GateReport) -> None:
    """Let only PASS through.

    Raises:
        RefusedError: Any other verdict; names the criterion that decided.
    """
    if report.verdict == "PASS":
        return
    decided = first_unmet(report.criteria, report.verdict)
    if decided is None:
        raise _refused(gate, "verdict", report.verdict, "PASS", report.decision)
    name = f"{decided.id}({decided.candidate})" if decided.candidate else decided.id
    action = f"{report.decision.rstrip('.')}. {report.diagnosis}".strip()
    raise _refused(gate, name, measured_text(decided), limit_text(decided), action)


def measured_text(criterion: Criterion) -> str:
    """What was measured, for a sentence."""
    if criterion.verdict == "PENDING_REVIEW":
        return "pending review"
    return "not measured" if criterion.measured is None else f"{criterion.measured:.6g}"


def limit_text(criterion: Criterion) -> str:
    """The limit, for a sentence."""
    if criterion.threshold is None:
        return "a threshold in params.yaml"
    return f"{criterion.comparison} {criterion.threshold:.6g}"


def _check_materials(root: Path, gate: Gate, report: GateReport) -> None:
    for name, expected in report.materials.items():
        try:
            if ".." in Path(name).parts or Path(name).is_absolute():
                raise _refused(gate, f"material {name}", "outside the repository", "inside", "")
            found = sha256_file(root / name)
        except IntegrityError as error:
            found = error.found
        if found != expected:
            stage = Path(name).parts[1] if len(Path(name).parts) > 2 else stage_of(gate)
            raise _refused(
                gate,
                f"sha256 of {name}",
                f"{found[:16]}…",
                f"{expected[:16]}…",
                f"Run `dvc repro {stage}` and judge again, or restore the original bytes.",
            )


def _check_upstream(gate: Gate, report: GateReport, upstream: Mapping[str, str]) -> None:
    for below in sorted(set(upstream) | set(report.upstream)):
        found, expected = upstream.get(below, "none"), report.upstream.get(below, "none")
        if found != expected:
            raise _refused(
                gate,
                f"sha256 of {report_path(below)}",
                f"{found[:16]}…",
                f"{expected[:16]}…",
                f"Run `dvc repro -f {stage_of(gate)}`: the gate below was judged again since.",
            )


def _check_same(gate: Gate, report: GateReport, again: GateReport) -> None:
    old, new = _comparable(report), _comparable(again)
    if old == new:
        return
    place, stated, derived = _first_difference(old, new, "")
    raise _refused(
        gate,
        f"{report_path(gate)}{place}",
        _short(stated),
        f"{_short(derived)} as derived again from evidence and params.yaml",
        f"Run `dvc repro -f {stage_of(gate)}`; never edit a report.",
    )


def _comparable(report: GateReport) -> Any:
    return json.loads(report.model_dump_json(exclude=NOT_COMPARED))


def _first_difference(old: Any, new: Any, place: str) -> tuple[str, Any, Any]:
    if isinstance(old, dict) and isinstance(new, dict):
        order = sorted(set(old) | set(new), key=lambda key: (key == "verdict", key))
        for key in order:
            if old.get(key) != new.get(key) or (key in old) != (key in new):
                return _first_difference(old.get(key), new.get(key), f"{place}.{key}")
    if isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for index, (one, other) in enumerate(zip(old, new, strict=True)):
            if one != other:
                return _first_difference(one, other, f"{place}[{index}]")
    return place, old, new


def _short(value: Any) -> str:
    if isinstance(value, list):
        return f"a list of {len(value)}"
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 60 else f"{text[:59]}…"


def _refused(gate: Gate, criterion: str, measured: str, limit: str, action: str) -> RefusedError:
    return RefusedError(
        gate=gate,
        criterion=criterion,
        measured=measured,
        limit=limit,
        report=report_path(gate),
        action=action,
    )
