"""Gate C's evidence derived again: tables from the journal, mutants by trying them again."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from gates.stated import Row, compare_keys, compare_rows, root_seed, section, training_seed
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.settings import Settings
from genpolicy.data.dataset import load_dataset
from genpolicy.evidence.admission_context import make_checker
from genpolicy.evidence.documents.shadow import MUTANTS, LayerMutant, Mutant
from genpolicy.evidence.shadow.candidate_rows import numbers_sha256
from genpolicy.evidence.shadow.layer_mutants import missing_checks_evidence
from genpolicy.evidence.shadow.observations import held_out_observations, spread
from genpolicy.evidence.shadow.settings import ShadowSection
from genpolicy.evidence.shadow.shadow import Shadow
from genpolicy.evidence.shadow.tables import all_mutants
from genpolicy.execution.cell import Cell, ExecutionSettings
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.integrity.tables import read_table
from genpolicy.seeds import stream
from genpolicy.tasks.api import load_task
from genpolicy.verification.journal_source import readable
from genpolicy.verification.shadow import KEYS, derived_shadow

SHADOW = "artifacts/shadow"
JOURNAL = "journal.mcap"
DATASET = "artifacts/ingest"
HASHED = ("raw", "projected")
"""Columns that a journal states by their hash."""


class TaskSection(Settings):
    """Section `task`: which task the journals are of."""

    name: str


def rederive_shadow(root: Path, params: Mapping[str, Any]) -> None:
    """Hold the tables of the shadow test against its journal, and try its mutants again.

    Raises:
        RefusedError: A row is not what the journal says, or a mutant is not what is found again.
        IntegrityError: A file is missing or no regular file.
        BadInputError: A file cannot be read.
    """
    with readable(f"{SHADOW}/{JOURNAL}"):
        derived = derived_shadow(root / SHADOW / JOURNAL)
    for name, keys in KEYS.items():
        path = f"{SHADOW}/{name}.parquet"
        stated = [_hashed(row) for row in read_table(root / path).to_pylist()]
        compare_rows("C", path, keys, stated, derived[name], seed=training_seed(params))
    path = f"{SHADOW}/{MUTANTS.file}"
    again = all_mutants(_layer_mutants(root, params))
    stated_mutants, found = (_by_check(rows) for rows in (MUTANTS.read(root / SHADOW), again))
    compare_keys("C", path, stated_mutants, found, "as tried again")


def _hashed(row: dict[str, Any]) -> Row:
    """A row of a table, with its long columns as a journal states them."""
    short = {key: value for key, value in row.items() if key not in HASHED}
    return short | {f"{key}_sha256": numbers_sha256(row[key]) for key in HASHED if key in row}


def _by_check(rows: Sequence[Mutant]) -> dict[str, Any]:
    """Rows of `mutants.json` by layer and check."""
    found: dict[str, Any] = {}
    for row in rows:
        name = f"{row.layer}.{row.check}"
        found[name if name not in found else f"{name}, again"] = vars(row)
    return found


def _layer_mutants(root: Path, params: Mapping[str, Any]) -> list[LayerMutant]:
    """Each check of the six layers left out again, on the held-out moments of the dataset."""
    shadow = section(params, "shadow", ShadowSection)
    horizons = section(params, "horizons", HorizonConfig)
    task = load_task(section(params, "task", TaskSection).name)
    checker = make_checker(
        task,
        section(params, "feasibility", FeasibilitySettings),
        action_period_s=horizons.action_period_s,
    )
    observations = held_out_observations(
        load_dataset(root / DATASET),
        horizons=horizons,
        count=shadow.observations,
        generator=stream(root_seed(params), "shadow", "observations"),
    )
    tried = Shadow(
        task=task,
        checker=checker,
        cell=Cell(horizons, section(params, "execution", ExecutionSettings)),
        late_steps=shadow.late_steps,
        samples=shadow.samples,
    )
    return missing_checks_evidence(tried, spread(observations, shadow.mutant_observations))
