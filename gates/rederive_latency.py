"""Gate D's latencies drawn again: what every rollout states of its invocations, by other words."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from gates.stated import refuse, root_seed, section
from genpolicy.evidence.stress.latency import LatencySection
from genpolicy.evidence.stress.settings import StressSettings
from genpolicy.execution.cell import ExecutionSettings
from genpolicy.integrity.tables import read_table
from genpolicy.verification.journal_source import readable
from genpolicy.verification.owed import Times, stated_otherwise

LATENCY = "artifacts/latency/latency.parquet"


def rederive_latency(root: Path, params: Mapping[str, Any], journals: Sequence[Path]) -> None:
    """Hold every stated latency of the comparison against the measured and declared times.

    Raises:
        RefusedError: A journal states another time, judges an answer that was to be lost, or does
            other than declared where a term takes longer than it may.
        ConfigError: A section of `params.yaml` cannot be read.
        IntegrityError: A file is missing or no regular file.
        BadInputError: A file cannot be read.
    """
    stress = section(params, "stress", StressSettings)
    declared = section(params, "latency", LatencySection).declared
    planned = {name: entry.model_dump() for name, entry in stress.conditions.items()}
    with readable(LATENCY):
        times = Times(
            read_table(root / LATENCY).to_pylist(),
            declared={term: (least_s, most_s) for term, (least_s, most_s) in declared.items()},
            perturbations=planned,
            root_seed=root_seed(params),
            deadlines=_deadlines(params),
        )
    for path in journals:
        with readable(f"{path.parent.name}/{path.name}"):
            found = next(stated_otherwise(path, times), None)
        if found is not None:
            refuse("D", path.name, found, "the times of latency.parquet and params.yaml")


def _deadlines(params: Mapping[str, Any]) -> dict[str, tuple[float, str]]:
    """What each term may take, s, and what is done beyond."""
    table = section(params, "execution", ExecutionSettings).term_deadlines
    return {str(term): (own.most_s, str(own.action)) for term, own in table.items()}
