"""Gate D's evidence: the matched comparison as tables, journals, checker and power."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from pydantic import Field

from genpolicy.compute import map_shards
from genpolicy.contract.settings import Settings
from genpolicy.evidence.shadow.tables import account_rows, checker_document
from genpolicy.evidence.stress.matched import Shard, ShardResult, run_shard
from genpolicy.evidence.stress.perturbations import PerturbationSettings
from genpolicy.integrity.atomic import write_bytes
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.tables import write_table
from genpolicy.seeds import stream
from genpolicy.statistics.eprocess import power_table

AGE_LEVELS = (0.0, 0.05, 0.25, 0.5, 0.75, 0.9, 0.95, 0.99, 1.0)
POWER_SCENARIOS = ((0.5, 0.5), (0.9, 0.9), (0.5, 0.8), (0.3, 0.9), (0.1, 0.9))
POWER_CORRELATION = 0.3
POWER_TRIALS = 2000

TEXT, WHOLE, REAL, FLAG = pa.string(), pa.int64(), pa.float64(), pa.bool_()


class StressSettings(Settings):
    """Section `stress`.

    Attributes:
        starts: Initial states, equal for all methods.
        episode_limit_s: Longest rollout.
        candidates: Candidates per invocation of a stochastic method.
        baselines: Simpler methods in the comparison.
        perturbations: What is injected, by name; `nominal` is one of them.
        margin: Pre-registered gain in success; for the power table.
        alpha: Pre-registered error; for the power table.
    """

    starts: int = Field(ge=1)
    episode_limit_s: float = Field(gt=0)
    candidates: int = Field(ge=1)
    baselines: list[str]
    perturbations: dict[str, PerturbationSettings]
    margin: float
    alpha: float


@dataclass(frozen=True)
class Entrant:
    """One method of the comparison.

    Attributes:
        method: Its name.
        checkpoint: Its folder.
        sha256: Its identity.
    """

    method: str
    checkpoint: Path
    sha256: str


def write_stress(
    folder: Path,
    shards: Sequence[Shard],
    settings: StressSettings,
    *,
    workers: int,
    scheduler: str,
    root_seed: int,
) -> None:
    """Run every shard and write the evidence.

    Args:
        folder: Existing folder; shards write their journals below `journals`.
        shards: One per method and perturbation.
        settings: Section `stress`.
        workers: Local processes.
        scheduler: `local` or the address of a Dask scheduler.
        root_seed: Root seed, for the power simulation.
    """
    (folder / "journals").mkdir()
    results = map_shards(run_shard, shards, workers=workers, scheduler=scheduler)
    pairs = list(zip(shards, results, strict=True))
    rollouts = [row for _, result in pairs for row in result.rollouts]
    write_table(folder / "rollouts.parquet", pa.Table.from_pylist(rollouts, ROLLOUTS))
    counts: list[dict[str, Any]] = []
    balances: list[dict[str, Any]] = []
    for shard, result in pairs:
        rows = account_rows(result.accounts)
        counts += [{**_key(shard), "reason": r["reason"], "count": r["count"]} for r in rows]
        totals = {name: rows[0][name] for name in ("generated", "executed", "queued")}
        discarded = sum(sum(account.discarded.values()) for account in result.accounts)
        balances.append({**_key(shard), **totals, "discarded": discarded})
    write_table(folder / "counts.parquet", pa.Table.from_pylist(counts, COUNTS))
    write_table(folder / "conservation.parquet", pa.Table.from_pylist(balances, CONSERVATION))
    stub = [{**_key(shard), **result.stub} for shard, result in pairs]
    write_table(folder / "stub.parquet", pa.Table.from_pylist(stub, STUB))
    ages = [row for shard, result in pairs for row in _age_rows(shard, result)]
    write_table(folder / "ages.parquet", pa.Table.from_pylist(ages, AGES))
    journals = [shard.journal for shard in shards]
    first = shards[0]
    checked = checker_document(journals, horizons=first.horizons, execution=first.execution)
    write_bytes(folder / "checker.json", canonical_json(checked))
    write_bytes(folder / "power.json", canonical_json(power_document(settings, root_seed)))


def plan_shards(
    entrants: Sequence[Entrant], perturbations: Mapping[str, PerturbationSettings]
) -> list[tuple[Entrant, str, PerturbationSettings]]:
    """Every method under every perturbation, perturbations outermost."""
    return [
        (entrant, name, schedule)
        for (name, schedule), entrant in product(perturbations.items(), entrants)
    ]


def power_document(settings: StressSettings, root_seed: int) -> dict[str, Any]:
    """Which verdicts the pre-registered test can reach; content of `power.json`."""
    rows = power_table(
        POWER_SCENARIOS,
        margin=settings.margin,
        alpha=settings.alpha,
        pairs=settings.starts,
        correlation=POWER_CORRELATION,
        trials=POWER_TRIALS,
        rng=stream(root_seed, "stress", "power"),
    )
    return {
        "margin": settings.margin,
        "alpha": settings.alpha,
        "pairs": settings.starts,
        "rows": [{key: _finite(value) for key, value in asdict(row).items()} for row in rows],
    }


def _key(shard: Shard) -> dict[str, str]:
    return {"method": shard.method, "perturbation": shard.perturbation}


def _age_rows(shard: Shard, result: ShardResult) -> list[dict[str, Any]]:
    """Quantiles of the action age over all rollouts of a shard."""
    if len(result.ages_s) == 0:
        return []
    return [
        {
            **_key(shard),
            "level": level,
            "action_age_s": float(np.quantile(result.ages_s, level, method="higher")),
            "actions": len(result.ages_s),
        }
        for level in AGE_LEVELS
    ]


def _finite(value: Any) -> Any:
    return None if isinstance(value, float) and not np.isfinite(value) else value


ROLLOUTS = pa.schema(
    [
        ("method", TEXT), ("seed", WHOLE), ("perturbation", TEXT), ("start", WHOLE),
        ("start_sha256", TEXT), ("outcome", TEXT), ("success", FLAG), ("duration_s", REAL),
        ("ticks", WHOLE), ("action_ticks", WHOLE), ("hold_ticks", WHOLE),
        ("fallback_ticks", WHOLE), ("invocations", WHOLE), ("deadline_misses", WHOLE),
        ("discards", WHOLE), ("rejections", WHOLE), ("rejected_by", TEXT),
        ("recovery_attempted", FLAG), ("recovered", FLAG), ("interventions", WHOLE),
        ("action_age_p50_s", REAL), ("action_age_p95_s", REAL), ("action_age_max_s", REAL),
        ("latency_p95_s", REAL), ("force_peak_n", REAL), ("mode", TEXT),
    ]
)  # fmt: skip
COUNTS = pa.schema([("method", TEXT), ("perturbation", TEXT), ("reason", TEXT), ("count", WHOLE)])
CONSERVATION = pa.schema(
    [
        ("method", TEXT), ("perturbation", TEXT), ("generated", WHOLE), ("executed", WHOLE),
        ("queued", WHOLE), ("discarded", WHOLE),
    ]
)  # fmt: skip
STUB = pa.schema(
    [
        ("method", TEXT), ("perturbation", TEXT), ("arrivals", WHOLE), ("stale", WHOLE),
        ("invalid", WHOLE),
    ]
)  # fmt: skip
AGES = pa.schema(
    [
        ("method", TEXT), ("perturbation", TEXT), ("level", REAL), ("action_age_s", REAL),
        ("actions", WHOLE),
    ]
)  # fmt: skip
