"""The audit's own tables, measured again: the whole audit runs once more on its dataset.

Dataset, settings and root seed decide every number of it, so that whoever writes other rows and
commits their hashes is contradicted. All that `write_evidence` writes is compared; `scene.png` is
a drawing that decides nothing, and another renderer draws it otherwise.

Another processor rounds otherwise. What neighbours show is moved in its last digits alone. Forests,
by which the learned evidence finds whom to compare, are grown otherwise: a few of its situations
come to lie on the other side of a limit. Where all is about those, because neighbours show no
modes, or where distances are equal to the last digit, another processor may find other rows.
"""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import zip_longest
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NoReturn

import pyarrow as pa
from pydantic import Field

from gates.rederive_shadow import TaskSection
from gates.report import report_path
from gates.settings import PARAMS_FILE
from gates.stated import Row, root_seed, section, short
from genpolicy.audit.evidence import write_evidence
from genpolicy.audit.reach_rows import LEARNED
from genpolicy.audit.settings import AuditSettings
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.settings import Settings, parse_settings
from genpolicy.errors import RefusedError
from genpolicy.evidence.need.audit_task import audit_task, round_obstacles, settings_of
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.integrity.documents import read_json
from genpolicy.integrity.tables import read_table
from genpolicy.tasks.api import load_task

AUDIT = "artifacts/audit"
DATASET = "artifacts/ingest"
KEYS: dict[str, tuple[str, ...]] = {
    "alignment": ("episode_uuid",),
    "alternatives": ("phase", "mode", "other"),
    "asked": ("check",),
    "calibration": ("epoch",),
    "clocks": ("stream", "epoch"),
    "components": ("component",),
    "demonstrated": ("phase", "episode_uuid"),
    "examples": ("example", "episode_uuid"),
    "finding_draws": ("draw", "kind", "variable", "where"),
    "findings": ("kind", "variable", "where"),
    "modes": ("phase", "mode"),
    "neighbourhoods": ("episode_uuid", "index"),
    "predictions": ("phase", "variable"),
    "reach": ("kind", "fifth"),
    "recovery": ("split", "mode"),
    "replay": ("episode_uuid",),
    "resamples": (),
    "sides": ("kind",),
    "strata": ("phase", "variable"),
    "structure_draws": (),
    "support": ("episode_uuid", "index"),
    "tremor": ("column",),
}
"""Columns by which a row is known; where there are none, by its place."""
TOLERANCE = 1e-9
"""Of a number, or of its size: what another processor may round by.

Data sets, two of them whole ladders, were audited with the instructions of three processors
(AVX-512, AVX2 and neither): 1e-13 apart at most where nothing stood exactly at a limit.
"""
GROWN_SHARE, GROWN_COUNT = 0.2, 4
"""Of what the learned evidence measures, and of its counts: twice what those three made of it (a
tenth of a share of noise; two situations or episodes)."""
FEW = 10
"""Of fewer situations a mean or a median hangs on which of them are there."""
BEHIND = {"kept": "kept_n", "kept_null_q95": "kept_n"}
"""Of a number of the learned evidence the count that it is a mean of; else all situations."""
NOTHING = "nothing"

Difference = tuple[str, Any, Any]
"""Where, what is stated there, and what is measured again."""
Holds = Callable[[float, float], bool]
"""Whether a stated number is the one measured again."""


class SharedConfidence(Settings):
    """Key `confidence` of `params.yaml`.

    Attributes:
        confidence: Coverage of every interval.
    """

    confidence: float = Field(gt=0.5, lt=1.0)


def rederive_audit(root: Path, params: Mapping[str, Any]) -> None:
    """Hold every table and document of the audit against an audit of its dataset.

    Args:
        root: Root of the workspace.
        params: `params.yaml`.

    Raises:
        RefusedError: A file is missing, a row lacks, stands twice or elsewhere, or says something
            else; the first one is named.
        ConfigError: A section of `params.yaml` cannot be read.
        ContractError: The dataset is not the task's.
        IntegrityError: A file is not what it claims to be.
        BadInputError: A file cannot be read.
    """
    with TemporaryDirectory() as folder:
        measure_again(root, params, Path(folder))
        hold_audit(root / AUDIT, Path(folder))


def measure_again(root: Path, params: Mapping[str, Any], folder: Path) -> None:
    """Audit the dataset as the stage does, and write the evidence into an existing folder.

    Raises:
        GenpolicyError: As `rederive_audit`.
    """
    horizons = section(params, "horizons", HorizonConfig)
    name = section(params, "task", TaskSection).name
    task = load_task(name)
    shared = {key: params[key] for key in ("confidence",) if key in params}
    confidence = parse_settings(SharedConfidence, shared, where=PARAMS_FILE).confidence
    own = section(params, "audit", AuditSettings)
    settings = settings_of(own, task, horizons, confidence=confidence)
    result = audit_task(
        root / DATASET,
        task_name=name,
        settings=settings,
        feasibility=section(params, "feasibility", FeasibilitySettings),
        action_period_s=horizons.action_period_s,
        root_seed=root_seed(params),
    )
    write_evidence(result, folder, settings=settings, obstacles=round_obstacles(task))


def hold_audit(stated: Path, again: Path) -> None:
    """Hold all that an audit wrote against the same of another audit.

    Args:
        stated: Folder of the evidence.
        again: Folder of what was measured again.

    Raises:
        GenpolicyError: As `rederive_audit`.
    """
    tremor = _noise_by_forests(again)
    for path in sorted(again.iterdir()):
        place, own = f"{AUDIT}/{path.name}", stated / path.name
        if not own.is_file():
            _refuse(place, "missing", "what the audit writes")
        if path.suffix == ".json":
            _refuse_first(f"{place}: ", difference(read_json(own), read_json(path)))
        else:
            _hold_table(path.stem, place, read_table(own), read_table(path), tremor=tremor)


def within_rounding(told: float, found: float) -> bool:
    """Whether counts are the same, and measured numbers but for their last digits."""
    return _within(told, found, 0.0 if _counts(told, found) else TOLERANCE * max(1.0, abs(found)))


def within_a_forest(told: float, found: float) -> bool:
    """Whether numbers of the learned evidence are what another processor may make of them."""
    least = GROWN_COUNT if _counts(told, found) else TOLERANCE
    return _within(told, found, max(least, GROWN_SHARE * abs(found)))


def difference(told: Any, found: Any, holds: Holds = within_rounding) -> Difference | None:
    """The first place at which two values differ; None where they are the same.

    Args:
        told: What is stated.
        found: What is measured again.
        holds: What is asked of two numbers.
    """
    parts: list[Difference] = []
    if isinstance(told, dict) and isinstance(found, dict):
        names = sorted({*told, *found})
        parts = [(name, told.get(name, NOTHING), found.get(name, NOTHING)) for name in names]
    elif isinstance(told, list) and isinstance(found, list) and len(told) == len(found):
        pairs = zip(told, found, strict=True)
        parts = [(str(number), *pair) for number, pair in enumerate(pairs)]
    elif _number(told) and _number(found):
        return None if holds(told, found) else ("", told, found)
    elif type(told) is not type(found) or told != found:
        return "", told, found
    for name, one, other in parts:
        if inner := difference(one, other, holds):
            return ".".join(filter(None, (name, inner[0]))), *inner[1:]
    return None


def _hold_table(
    name: str, place: str, stated: pa.Table, again: pa.Table, *, tremor: Row | None
) -> None:
    for told, found in zip_longest(stated.schema, again.schema):
        if _column(told) != _column(found):
            _refuse(f"{place}: columns", _column(told), _column(found))
    rows, expected = (_by_key(KEYS[name], table.to_pylist()) for table in (stated, again))
    for key in sorted(rows.keys() ^ expected.keys(), key=repr):
        what = ("stated twice" if key[-1] > 1 else "a row") if key in rows else "no row"
        _refuse(f"{place}: {_named(key)}", what, "one row" if key in expected else "no such row")
    for key, other in zip(rows, expected, strict=True):
        if key != other:  # other tables speak of these rows by their places
            _refuse(f"{place}: order", f"{_named(key)}", f"{_named(other)} there")
    for key, row in expected.items():
        behind = _behind(name, row, tremor)
        told, found = ({c: part[c] for c in _held(name, row, behind)} for part in (rows[key], row))
        holds = within_rounding if behind is None else within_a_forest
        _refuse_first(f"{place}: {_named(key)}: ", difference(told, found, holds))


def _by_key(columns: Sequence[str], rows: Sequence[Row]) -> dict[tuple[Any, ...], Row]:
    """Rows by what they are known by, and by how many are known by it so far."""
    seen: Counter[tuple[Any, ...]] = Counter()
    found = {}
    for number, row in enumerate(rows):
        key = tuple(row[column] for column in columns) or (f"row {number}",)
        seen[key] += 1
        found[(*key, seen[key])] = row
    return found


def _noise_by_forests(again: Path) -> Row | None:
    """The row of the learned evidence where `tremor` is about its situations; they are more then.

    None where it is about those of the neighbours.
    """
    rows = {row["kind"]: row for row in read_table(again / "sides.parquet").to_pylist()}
    most = max(rows.values(), key=lambda row: (row["analysed"], row["kind"] != LEARNED))
    return most if most["kind"] == LEARNED else None


def _behind(name: str, row: Row, tremor: Row | None) -> Row | None:
    """Counts of what forests found, where a row is about it; None where neighbours decided."""
    if name == "tremor":
        return tremor
    return row if name in ("reach", "sides") and row["kind"] == LEARNED else None


def _held(name: str, row: Row, behind: Row | None) -> Iterable[str]:
    """Columns of a row that every processor finds again."""
    if name == "neighbourhoods" and not row["two_mode"]:
        # Equally good examples of what is no mode: a tie, and no policy is asked there.
        return row.keys() - {"mode_paths"}
    if behind is None:
        return row.keys()
    few = {c for c in row if behind.get(BEHIND.get(c, "analysed"), FEW) < FEW}
    return [c for c, value in row.items() if not (isinstance(value, float) and c in few)]


def _counts(told: float, found: float) -> bool:
    return isinstance(told, int) and isinstance(found, int)


def _number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _within(told: float, found: float, bound: float) -> bool:
    if math.isnan(told) or math.isnan(found):
        return math.isnan(told) and math.isnan(found)
    return told == found or bound - abs(told - found) >= 0


def _column(field: pa.Field | None) -> str:
    return NOTHING if field is None else f"{field.name} ({field.type})"


def _named(key: tuple[Any, ...]) -> str:
    return "/".join(map(str, key[:-1]))


def _shown(value: object) -> str:
    return f"{len(value)} of them" if isinstance(value, list) else short(repr(value))


def _refuse_first(where: str, differs: Difference | None) -> None:
    if differs is not None:
        place, told, found = differs
        _refuse(f"{where}{place}", _shown(told), f"{_shown(found)}, as measured again")


def _refuse(criterion: str, measured: str, limit: str) -> NoReturn:
    """Refuse what this dataset does not give; who forged it, or where it was audited, is open."""
    raise RefusedError(
        gate="A",
        criterion=criterion,
        measured=measured,
        limit=limit,
        report=report_path("A"),
        action="This dataset does not give that here. Run the audit again (`dvc repro -f audit`).",
    )
