"""Evidence derived again from the journals under it: what `genpolicy verify report` adds.

The independent checker reads every journal again, and every table of the comparison that Gate D
judges must be what the journals say. Slow beside hashing, so it is asked for by name and not at
every admission.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel

from gates.proof import Rung
from gates.report import Gate, report_path
from gates.settings import PARAMS_FILE, read_params, section_of
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.settings import Settings, parse_settings
from genpolicy.errors import GenpolicyError, RefusedError
from genpolicy.evidence.stress.envelope import ENVELOPE_FILE
from genpolicy.evidence.stress.perturbations import ReducedEnvelope
from genpolicy.evidence.stress.settings import ENVELOPE, StressSettings
from genpolicy.execution.cell import ExecutionSettings
from genpolicy.feasibility.cell import cell_of
from genpolicy.feasibility.figures import expected_motion
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.integrity.documents import read_json
from genpolicy.integrity.tables import read_table
from genpolicy.tasks.api import load_task
from genpolicy.verification.checker import ExpectedSettings, check_journal
from genpolicy.verification.commands import reach_of
from genpolicy.verification.motion import ExpectedMotion
from genpolicy.verification.rollouts import derived_rollouts, differences
from genpolicy.verification.tables import KEYS, derived_tables

STRESS = "artifacts/stress"
FOLDERS: dict[Gate, tuple[str, str]] = {
    "C": ("artifacts/shadow", "*.mcap"),
    "D": (STRESS, "journals/*.mcap"),
}
"""Evidence with journals: its folder, and where below it they lie."""
ROLLOUT = ("method", "perturbation", "start")
Model = TypeVar("Model", bound=BaseModel)


class _Task(Settings):
    """Which task the journals are of."""

    name: str


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
        RefusedError: A row, the envelope or a finding of the checker is not what the journals say.
        IntegrityError: A journal or a table is missing or no regular file.
        BadInputError: A journal or a table cannot be read.
    """
    if gate not in FOLDERS:
        return
    folder, pattern = FOLDERS[gate]
    journals, params = sorted((root / folder).glob(pattern)), read_params(root)
    _check(root, gate, params, journals)
    if gate == "D":
        _tables(root, params, journals)
        _envelope(root, params)


def _section(params: Mapping[str, Any], name: str, model: type[Model]) -> Model:
    return parse_settings(model, section_of(params, name), where=f"{PARAMS_FILE}: {name}")


def _held_to(params: Mapping[str, Any]) -> tuple[ExpectedSettings, ExpectedMotion]:
    """What every session must have declared, and what every executed row must have kept to."""
    horizons = _section(params, "horizons", HorizonConfig)
    execution = _section(params, "execution", ExecutionSettings)
    expected = ExpectedSettings(
        execution_horizon=horizons.execution_horizon,
        action_period_s=horizons.action_period_s,
        maximum_age_s=execution.maximum_age_s,
        watchdog_s=execution.watchdog_s,
        queue_capacity=execution.queue_capacity,
    )
    feasibility = _section(params, "feasibility", FeasibilitySettings)
    task = load_task(_section(params, "task", _Task).name)
    cell = cell_of(task, feasibility, action_period_s=horizons.action_period_s)
    return expected, expected_motion(cell)


def _check(root: Path, gate: Gate, params: Mapping[str, Any], journals: list[Path]) -> None:
    """The checker's document, made again under the settings of `params.yaml`."""
    expected, motion = _held_to(params)
    found = {path.name: check_journal(path, expected, motion).as_document() for path in journals}
    path = f"{FOLDERS[gate][0]}/checker.json"
    stated = _mapping(read_json(root / path))
    claimed = _mapping(stated.get("journals"))
    for name in sorted({*found, *claimed}):
        if claimed.get(name) != found.get(name):
            again = f"{_totals(found.get(name))}, as checked again"
            _refuse(gate, f"{path}: {name}", _totals(claimed.get(name)), again)
    derived = {
        "violations": [
            {"journal": name, **violation}
            for name, document in found.items()
            for violation in document["violations"]
        ],
        **{key: sum(d[key] for d in found.values()) for key in ("checked_actions",
                                                                "reproved_actions")},
    }  # fmt: skip
    for key, value in derived.items():
        if stated.get(key) != value:
            _refuse(gate, f"{path}: {key}", _short(stated.get(key)), f"{_short(value)}, as "
                    "checked again")  # fmt: skip


def _totals(document: Any) -> str:
    if not isinstance(document, dict):
        return "nothing"
    listed = document.get("violations")
    count = len(listed) if isinstance(listed, list) else 0
    return f"{count} violations in {document.get('checked_actions', '?')} actions"


def _tables(root: Path, params: Mapping[str, Any], journals: list[Path]) -> None:
    """Every table that journals speak of: each row what they say, and none without the other."""
    seeds = section_of(params, "policy").get("seeds")
    seed = seeds[0] if isinstance(seeds, list) and seeds else None
    rollouts = [row for path in journals for row in derived_rollouts(path).values()]
    _compare(root, "rollouts", ROLLOUT, rollouts, seed)
    for name, rows in derived_tables(journals).items():
        _compare(root, name, KEYS[name], rows, seed)


def _compare(
    root: Path, name: str, keys: tuple[str, ...], derived: list[dict[str, Any]], seed: object
) -> None:
    path = f"{STRESS}/{name}.parquet"
    what = name.removesuffix("s") if name != "conservation" else name

    def by_key(rows: list[dict[str, Any]]) -> dict[tuple[Any, ...], dict[str, Any]]:
        found: dict[tuple[Any, ...], dict[str, Any]] = {}
        for row in rows:
            key = tuple(row.get(column) for column in keys)
            if key in found:
                _refuse("D", f"{what} {_joined(key)}", "stated twice", "one row")
            found[key] = row
        return found

    stated, expected = by_key(read_table(root / path).to_pylist()), by_key(derived)
    for key in sorted({*stated, *expected}, key=repr):
        where = f"{what} {_joined(key)}"
        if key not in stated or key not in expected:
            found = "without a journal" if key in stated else "only in a journal"
            _refuse("D", where, found, f"one row of {path} and what a journal says")
        row = stated[key]
        own = expected[key] | ({"seed": seed} if "seed" in row else {})
        for column in differences(row, own)[:1]:
            text = f"{own[column]!r}, as its journal says"
            _refuse("D", f"{where}: {column}", f"{row.get(column)!r}", text)


def _envelope(root: Path, params: Mapping[str, Any]) -> None:
    """`envelope.json`: the planned limits, and how far the commands of each journal went."""
    stress = _section(params, "stress", StressSettings)
    planned = stress.perturbations.get(ENVELOPE)
    path = root / STRESS / ENVELOPE_FILE
    expected: dict[str, Any] = {}
    if isinstance(planned, ReducedEnvelope):
        journals = (root / STRESS / "journals").glob(f"*__{ENVELOPE}.mcap")
        expected = {
            "condition": ENVELOPE,
            "workspace_lower_m": list(planned.workspace_lower_m),
            "workspace_upper_m": list(planned.workspace_upper_m),
            "speed_limit_m_s": planned.speed_limit_m_s,
            "reached": {
                journal.name.partition("__")[0]: reach_of(journal).as_document()
                for journal in journals
            },
        }
    stated = _mapping(read_json(path)) if path.is_file() else {}
    for key in sorted({*stated, *expected}):
        if stated.get(key) != expected.get(key):
            where = f"{STRESS}/{ENVELOPE_FILE}: {key}"
            text = f"{_short(expected.get(key))}, as planned and as the journals say"
            _refuse("D", where, _short(stated.get(key)), text)


def _mapping(document: Any) -> dict[str, Any]:
    """A document as a mapping; empty where it is none, so that what is missing is refused."""
    return document if isinstance(document, dict) else {}


def _joined(key: tuple[Any, ...]) -> str:
    return "/".join(map(str, key))


def _short(value: object) -> str:
    if isinstance(value, list) and any(isinstance(entry, dict) for entry in value):
        return f"{len(value)} entries"
    text = str(value)
    return text if len(text) <= 120 else f"{text[:119]}…"


def _refuse(gate: Gate, criterion: str, measured: str, limit: str) -> None:
    raise RefusedError(
        gate=gate,
        criterion=criterion,
        measured=measured,
        limit=limit,
        report=report_path(gate),
        action="The evidence was not written by its stage. Run it again (`dvc repro -f`).",
    )
