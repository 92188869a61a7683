"""Gate C's evidence derived again: tables from the journal, mutants and gallery by the layers."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from gates.stated import (
    Row,
    compare_keys,
    compare_rows,
    refuse,
    root_seed,
    section,
    training_seed,
)
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.settings import Settings
from genpolicy.data.dataset import load_dataset
from genpolicy.evidence.admission_context import make_checker
from genpolicy.evidence.documents.gallery import GALLERY, Gallery
from genpolicy.evidence.documents.shadow import MUTANTS, Mutant
from genpolicy.evidence.rows.shadow import CandidateRow
from genpolicy.evidence.shadow.candidate_rows import HASHED, numbers_sha256
from genpolicy.evidence.shadow.gallery import gallery_of
from genpolicy.evidence.shadow.layer_margins import Gauges, columns_of, gauges_of, judged_again
from genpolicy.evidence.shadow.layer_mutants import missing_checks_evidence
from genpolicy.evidence.shadow.observations import Observation, held_out_observations, spread
from genpolicy.evidence.shadow.settings import ShadowSection
from genpolicy.evidence.shadow.shadow import Shadow
from genpolicy.evidence.shadow.tables import all_mutants
from genpolicy.execution.cell import Cell, ExecutionSettings
from genpolicy.feasibility.reasons import Reason
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.integrity.rows import read_rows
from genpolicy.integrity.tables import read_table
from genpolicy.seeds import stream
from genpolicy.tasks.api import load_task
from genpolicy.verification.journal_source import readable
from genpolicy.verification.shadow import KEYS, derived_shadow

SHADOW = "artifacts/shadow"
JOURNAL = "journal.mcap"
CANDIDATES = "candidates"
DATASET = "artifacts/ingest"
OFFENDING = "row_"
"""Begins the columns that no margin tells: which action offends."""


class TaskSection(Settings):
    """Section `task`: which task the journals are of."""

    name: str


def rederive_shadow(root: Path, params: Mapping[str, Any]) -> None:
    """Hold the tables of the shadow test against its journal, and ask the layers again.

    Its mutants are tried again, and the examples of its gallery chosen, judged and drawn up again
    from the table and the dataset. What a row states of each layer must follow from the margins of
    its checks. That a policy drew those actions is asked in `rederive_draws`.

    Raises:
        RefusedError: A row is not what the journal says or its margins give, or a mutant or an
            example is not what is found again.
        IntegrityError: A file is missing or no regular file, or the layers say something else of
            an example than its row.
        BadInputError: A file cannot be read.
    """
    with readable(f"{SHADOW}/{JOURNAL}"):
        derived = derived_shadow(root / SHADOW / JOURNAL)
    for name, keys in KEYS.items():
        path = f"{SHADOW}/{name}.parquet"
        stated = [_hashed(row) for row in read_table(root / path).to_pylist()]
        compare_rows("C", path, keys, stated, derived[name], seed=training_seed(params))
    tried, observations, mutant_observations = _moments(root, params)
    path = f"{SHADOW}/{MUTANTS.file}"
    again = all_mutants(missing_checks_evidence(tried, spread(observations, mutant_observations)))
    stated_mutants, found = (_by_check(rows) for rows in (MUTANTS.read(root / SHADOW), again))
    compare_keys("C", path, stated_mutants, found, "as tried again")
    rows = read_rows(root / SHADOW / f"{CANDIDATES}.parquet", CandidateRow)
    _hold_margins(rows, gauges_of(tried.checker))
    shown, drawn = GALLERY.read(root / SHADOW), gallery_of(tried, observations, rows)
    path = f"{SHADOW}/{GALLERY.file}"
    compare_keys("C", path, _by_example(shown), _by_example(drawn), "as judged again")


def _hashed(row: dict[str, Any]) -> Row:
    """A row of a table, with its long columns as a journal states them."""
    short = {key: value for key, value in row.items() if key not in HASHED}
    return short | {f"{key}_sha256": numbers_sha256(row[key]) for key in HASHED if key in row}


def _hold_margins(rows: Sequence[CandidateRow], gauges: Gauges) -> None:
    """What each row states of its layers is what the margins of all checks give, by the limits.

    Raises:
        RefusedError: It is not, or they are not those of all checks.
    """
    for row in rows:
        where = f"candidate {row.method}/{row.fixture}/{row.observation}/{row.candidate}"
        if len(row.margins) != len(Reason):
            refuse(
                "C", f"{where}: margins", f"{len(row.margins)}", f"those of {len(Reason)} checks"
            )
        for column, value in columns_of(judged_again(row.margins, gauges)).items():
            stated = getattr(row, column)
            if stated != value and not column.startswith(OFFENDING):
                text = f"{value!r}, as the margins of its checks give"
                refuse("C", f"{where}: {column}", f"{stated!r}", text)


def _by_check(rows: Sequence[Mutant]) -> dict[str, Any]:
    """Rows of `mutants.json` by layer and check."""
    found: dict[str, Any] = {}
    for row in rows:
        name = f"{row.layer}.{row.check}"
        found[name if name not in found else f"{name}, again"] = vars(row)
    return found


def _by_example(gallery: Gallery) -> dict[str, Any]:
    """A gallery by its keys, its examples by method and reason, in their order."""
    found = {key: value for key, value in vars(gallery).items() if key != "examples"}
    for number, example in enumerate(gallery.examples):
        name = f"example {number}, {example.method}/{example.reason}"
        found |= {f"{name}: {key}": value for key, value in vars(example).items()}
    return found


def _moments(root: Path, params: Mapping[str, Any]) -> tuple[Shadow, list[Observation], int]:
    """What the shadow test ran with, its held-out moments, and how many its mutants see."""
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
        late_rows=shadow.late_rows,
        samples=shadow.samples,
    )
    return tried, observations, shadow.mutant_observations
