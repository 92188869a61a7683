"""All of Gate D, judged by the gate itself over tables that lie in memory and in no file.

`gates.engine.judge` runs unchanged. What it reads comes from `Tables`, which stands where parquet
files do: the columns are those of the row classes, checked as always.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa

from benchmarks.decision.worlds import CONDITIONS, Array, Drawn
from gates.engine import judge
from gates.evidence import Evidence, MissingEvidenceError
from gates.pipeline import TASK_IDENTITY
from gates.report import GateReport
from gates.settings import Limits
from gates.stress.gate import GATE
from gates.stress.recoveries import RECOVERIES
from gates.stress.rollouts import INVOCATIONS, JOURNALS, ROLLOUTS, STRESS, StressSettings
from gates.stress.weights import DURATION, LEAST_OF_A_SUCCESS, by_cost
from genpolicy.evidence.blocks_run import blocks_document
from genpolicy.evidence.documents.stress import BLOCKS, POWER, Blocks
from genpolicy.integrity.documents import canonical_json
from genpolicy.statistics.planned_blocks import Rule
from genpolicy.statistics.possible import due, seen_of

TICKS, ASKED, LASTED_S = 160, 20, 8.0
"""Ticks of a rollout, invocations in it, and how long it lasts."""


class Tables(Evidence):
    """Evidence that lies in memory.

    Args:
        tables: By path.
        documents: JSON documents, by path.
    """

    def __init__(self, tables: Mapping[str, pa.Table], documents: Mapping[str, Any]) -> None:
        super().__init__(Path("nowhere"))
        self._given = tables
        self._bytes = {path: canonical_json(value) for path, value in documents.items()}

    def bind(self, *patterns: str) -> list[str]:
        """One journal and the identity of a task, of which nothing is asked here."""
        there = {JOURNALS: f"{STRESS}/journals/a.mcap", TASK_IDENTITY: TASK_IDENTITY}
        return [there[pattern] for pattern in patterns if pattern in there]

    def _table(self, path: str) -> pa.Table:
        self._touched[path] = None
        if path not in self._given:
            raise MissingEvidenceError(f"{path} is missing")
        return self._given[path]

    def _read(self, path: str) -> bytes:
        if path not in self._bytes:
            raise MissingEvidenceError(f"{path} is missing")
        return self._bytes[path]


def judged(
    drawn: Drawn, settings: StressSettings, limits: Limits, power: object, rng: np.random.Generator
) -> GateReport:
    """The report of Gate D on one trial; where it is planned in blocks, of what is run then."""
    tables = _tables(drawn, settings, rng)
    documents = {f"{STRESS}/{POWER.file}": power, f"{STRESS}/checker.json": _checked()}
    if settings.rule is not None:
        tables, blocks = in_blocks(tables, settings.rule)
        documents[f"{STRESS}/{BLOCKS.file}"] = BLOCKS.plain(blocks)
    evidence = Tables(tables, documents)
    return judge(GATE, evidence, limits, settings, candidates=settings.candidates)


def in_blocks(tables: Mapping[str, pa.Table], rule: Rule) -> tuple[dict[str, pa.Table], Blocks]:
    """The rows that a stage would have written in blocks, and what it would say of them."""
    frames = {path: table.to_pandas() for path, table in tables.items()}
    seen = seen_of(frames[ROLLOUTS].itertuples(index=False), rule)
    ran = due(rule, seen, [name for name in seen if name not in rule.simple])
    kept = {
        path: frame[frame["start"] < frame["method"].map(ran)] if "start" in frame else frame
        for path, frame in frames.items()
    }
    seen = seen_of(kept[ROLLOUTS].itertuples(index=False), rule)
    found = {path: pa.Table.from_pandas(of, preserve_index=False) for path, of in kept.items()}
    return found, blocks_document(rule, seen)


def _tables(
    drawn: Drawn, settings: StressSettings, rng: np.random.Generator
) -> dict[str, pa.Table]:
    methods = (*settings.baselines, *settings.candidates)
    worth = np.concatenate([drawn.baselines, drawn.candidates])
    if not np.isin(worth, (0.0, LEAST_OF_A_SUCCESS, 1.0) if settings.utility else (0.0, 1.0)).all():
        raise ValueError("the whole rule is asked of one checkpoint of each candidate")
    rows = _rollouts(methods, worth, settings, rng)
    stand = rows["method"].isin(settings.candidates)
    judged_rows, simple_rows = rows[stand], rows[~stand]
    cells = pd.MultiIndex.from_product([methods, CONDITIONS], names=["method", "perturbation"])
    frame = cells.to_frame(index=False)
    tables = {
        ROLLOUTS: rows,
        RECOVERIES: _recoveries(rows),
        INVOCATIONS: pd.concat([_invocations(judged_rows, rng), _invocations(simple_rows)]),
        f"{STRESS}/stub.parquet": frame.assign(arrivals=500, stale=0, invalid=0),
        f"{STRESS}/counts.parquet": frame.assign(reason="expired", count=10),
        f"{STRESS}/conservation.parquet": frame.assign(
            generated=100, executed=88, discarded=10, queued=2
        ),
    }
    return {
        path: pa.Table.from_pandas(table, preserve_index=False) for path, table in tables.items()
    }


def _rollouts(
    methods: tuple[str, ...], worth: Array, settings: StressSettings, rng: np.random.Generator
) -> pd.DataFrame:
    """Outcomes as drawn; costs of a sound policy: few misses, holds, rejections and stops.

    Where duration is weighed, a success takes as long as its worth says.
    """
    starts, won = worth.shape[2], worth > 0.0
    weight = by_cost(settings.utility).get(DURATION)
    lasted = np.full(worth.size, LASTED_S)
    if weight is not None:
        lost = np.where(won, 1.0 - worth, 0.0).reshape(-1)
        lasted = settings.longest_s * lost / weight
    index = pd.MultiIndex.from_product(
        [methods, CONDITIONS, range(starts)], names=["method", "perturbation", "start"]
    )
    rows = index.to_frame(index=False)
    n, success = len(rows), won.reshape(-1)
    stopped = rng.random(n) < STOPPED
    drilled = (rows["perturbation"] == "recovery_drill").to_numpy()
    ends = np.where(success, "success", np.where(stopped, "force_stop", "timeout"))
    hold, fallback = rng.binomial(TICKS, HELD, n), rng.binomial(TICKS, FELL_BACK, n)
    return rows.assign(
        seed=0,
        start_sha256=[f"{c}{s}" for c, s in zip(rows["perturbation"], rows["start"], strict=True)],
        outcome=ends, success=success, duration_s=lasted, ticks=TICKS,
        action_ticks=TICKS - hold - fallback, hold_ticks=hold, fallback_ticks=fallback,
        invocations=ASKED, deadline_misses=rng.binomial(ASKED, MISSED, n), discards=1,
        rejections=rng.binomial(ASKED, REJECTED, n), rejected_by="",
        recovery_attempted=drilled, recovered=drilled & success, person_s=0.0,
        interventions=(rng.random(n) < CALLED).astype(np.int64), action_age_p50_s=0.1,
        action_age_p95_s=0.2, action_age_max_s=0.3, latency_p95_s=0.1,
        force_peak_n=20.0 * np.exp(0.3 * rng.standard_normal(n)), mode="left",
    )  # fmt: skip


def _recoveries(rows: pd.DataFrame) -> pd.DataFrame:
    """One entry of each rollout that is drilled, which ended as the rollout says."""
    keys = ["method", "seed", "perturbation", "start", "success", "recovered"]
    begun = rows[rows["recovery_attempted"]][keys].rename(columns={"success": "succeeded"})
    return begun.assign(
        recovery=0, phase="approach", cause="drill", primitives="retreat", failures=0,
        ended=np.where(begun["recovered"], "handed_back", "timed_out"), resampled_only=False,
        taken_over=begun["recovered"], duration_s=1.0, force_peak_n=0.0, resets=0,
    )  # fmt: skip


STOPPED = 0.05
"""Share of failures that end in a protective stop."""
HELD, FELL_BACK, MISSED, REJECTED, CALLED = 0.05, 0.02, 0.05, 0.05, 0.01
"""Shares of ticks, of invocations and of rollouts: a sound policy, well inside the limits."""


def _invocations(rows: pd.DataFrame, rng: np.random.Generator | None = None) -> pd.DataFrame:
    """Answers of each rollout; without a generator each takes as long, as nobody asks of them."""
    columns = ["method", "seed", "perturbation", "start"]
    frame = rows[columns].loc[rows.index.repeat(ASKED)].reset_index(drop=True)
    number = np.tile(np.arange(ASKED), len(rows))
    spread = np.zeros(len(frame)) if rng is None else 0.3 * rng.standard_normal(len(frame))
    latency: Array = 0.1 * np.exp(spread)
    return frame.assign(invocation=number, latency_s=latency)


def _checked() -> dict[str, Any]:
    """Nothing wrong in one journal."""
    found = {"violations": [], "checked_actions": 100, "reproved_actions": 100}
    more = {
        "sessions": 1, "events": 9, "checked_fallback_actions": 0, "chunks": 9, "discarded": {},
        "oldest_action_s": 0.1, "longest_silence_s": 0.05,
    }  # fmt: skip
    return {**found, "journals": {"a.mcap": found | more}}
