"""Evidence derived again from the journals under it: what `genpolicy verify report` adds.

The independent checker reads every journal again, and every rollout that Gate D judges must be
what its journal says. Slow beside hashing, so it is asked for by name and not at every admission.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from gates.proof import Rung
from gates.report import Gate, report_path
from gates.settings import PARAMS_FILE, read_params, section_of
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.settings import parse_settings
from genpolicy.errors import GenpolicyError, RefusedError
from genpolicy.execution.cell import ExecutionSettings
from genpolicy.feasibility.cell import cell_of
from genpolicy.feasibility.figures import expected_motion
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.integrity.documents import read_json
from genpolicy.integrity.tables import read_table
from genpolicy.tasks.api import load_task
from genpolicy.verification.checker import ExpectedSettings, check_journal
from genpolicy.verification.motion import ExpectedMotion
from genpolicy.verification.rollouts import derived_rollouts, differences

SHADOW, STRESS = "artifacts/shadow", "artifacts/stress"


def rederived(root: Path, rungs: Sequence[Rung]) -> list[Rung]:
    """Proved rungs, those refused whose evidence is not what its journals say."""
    return [_rederived(root, rung) for rung in rungs]


def _rederived(root: Path, rung: Rung) -> Rung:
    if rung.verdict in ("REFUSED", "NOT JUDGED"):
        return rung
    try:
        rederive(root, rung.gate)
    except GenpolicyError as error:
        changes = {"verdict": "REFUSED", "decided_by": "", "note": str(error)}
        return replace(rung, **changes, exit_code=error.exit_code)  # type: ignore[arg-type]
    return rung


def rederive(root: Path, gate: Gate) -> None:
    """Hold the evidence of a gate against its journals; gates without journals have none.

    Raises:
        RefusedError: A row, a rollout or a finding of the checker is not what the journals say.
        IntegrityError: A journal or a table is missing or no regular file.
        BadInputError: A journal or a table cannot be read.
    """
    if gate == "C":
        _check(root, gate, SHADOW, sorted((root / SHADOW).glob("*.mcap")))
    if gate == "D":
        journals = sorted((root / STRESS / "journals").glob("*.mcap"))
        _check(root, gate, STRESS, journals)
        _rollouts(root, journals)


def _check(root: Path, gate: Gate, folder: str, journals: list[Path]) -> None:
    """The checker's document, made again under the settings of `params.yaml`."""
    expected, motion = _expected(root), _motion(root)
    found = {path.name: check_journal(path, expected, motion).as_document() for path in journals}
    stated = read_json(root / folder / "checker.json")
    claimed = stated.get("journals") if isinstance(stated, dict) else None
    for name in sorted({*found, *(claimed if isinstance(claimed, dict) else ())}):
        own = claimed.get(name) if isinstance(claimed, dict) else None
        if own != found.get(name):
            where = f"{folder}/checker.json: {name}"
            _refuse(gate, where, _totals(own), f"{_totals(found.get(name))}, as checked again")
    for total in ("checked_actions", "reproved_actions"):  # the gates judge by the totals
        summed = sum(document[total] for document in found.values())
        told = stated.get(total) if isinstance(stated, dict) else None
        if told != summed:
            where = f"{folder}/checker.json: {total}"
            _refuse(gate, where, repr(told)[:60], f"{summed}, as checked again")
    violations = sum(len(document["violations"]) for document in found.values())
    listed = stated.get("violations") if isinstance(stated, dict) else None
    if not isinstance(listed, list) or len(listed) != violations:
        where = f"{folder}/checker.json: violations"
        _refuse(gate, where, _totals({"violations": listed}), f"{violations}, as checked again")


def _expected(root: Path) -> ExpectedSettings:
    """What every session must have declared, by `params.yaml`."""
    params = read_params(root)
    horizons = parse_settings(
        HorizonConfig, section_of(params, "horizons"), where=f"{PARAMS_FILE}: horizons"
    )
    execution = parse_settings(
        ExecutionSettings, section_of(params, "execution"), where=f"{PARAMS_FILE}: execution"
    )
    return ExpectedSettings(
        execution_horizon=horizons.execution_horizon,
        action_period_s=horizons.action_period_s,
        maximum_age_s=execution.maximum_age_s,
        watchdog_s=execution.watchdog_s,
        queue_capacity=execution.queue_capacity,
    )


def _motion(root: Path) -> ExpectedMotion:
    """What every executed row must have kept to, by `params.yaml` and the task."""
    params = read_params(root)
    settings = parse_settings(
        FeasibilitySettings, section_of(params, "feasibility"), where=f"{PARAMS_FILE}: feasibility"
    )
    task = load_task(str(section_of(params, "task")["name"]))
    period_s = _expected(root).action_period_s
    return expected_motion(cell_of(task, settings, action_period_s=period_s))


def _totals(document: Any) -> str:
    if not isinstance(document, dict):
        return "nothing"
    listed = document.get("violations")
    count = len(listed) if isinstance(listed, list) else 0
    return f"{count} violations in {document.get('checked_actions', '?')} actions"


def _rollouts(root: Path, journals: list[Path]) -> None:
    """Each rollout's row against its session, and no row or session without the other."""
    derived: dict[tuple[str, str, int], dict[str, Any]] = {}
    for path in journals:
        for columns in derived_rollouts(path).values():
            derived[_key(columns)] = columns
    rows = {_key(row): row for row in read_table(root / STRESS / "rollouts.parquet").to_pylist()}
    for key in sorted({*rows, *derived}):
        where = f"rollout {'/'.join(map(str, key))}"
        if key not in rows or key not in derived:
            found = "without a journal" if key in rows else "only in a journal"
            _refuse("D", where, found, "one row and one session")
        wrong = differences(rows[key], derived[key])
        if wrong:
            name = wrong[0]
            stated, expected = rows[key].get(name), derived[key][name]
            _refuse("D", f"{where}: {name}", f"{stated!r}", f"{expected!r}, as its journal says")


def _key(row: dict[str, Any]) -> tuple[str, str, int]:
    return str(row["method"]), str(row["perturbation"]), int(row["start"])


def _refuse(gate: Gate, criterion: str, measured: str, limit: str) -> None:
    raise RefusedError(
        gate=gate,
        criterion=criterion,
        measured=measured,
        limit=limit,
        report=report_path(gate),
        action="The evidence was not written by its stage. Run it again (`dvc repro -f`).",
    )
