"""The stress evidence: plan, tables, journals, power."""

import numpy as np
import pytest

from genpolicy.evidence.stress.latency import (
    DECLARED_TERMS,
    MEASURED_TERMS,
    DeclaredTerm,
    LatencyModel,
)
from genpolicy.evidence.stress.matched import Shard, matched_starts
from genpolicy.evidence.stress.perturbations import PerturbationSettings
from genpolicy.evidence.stress.tables import (
    AGE_LEVELS,
    Entrant,
    StressSettings,
    plan_shards,
    power_document,
    write_stress,
)
from genpolicy.integrity.documents import canonical_json, read_json
from genpolicy.integrity.tables import read_table

PERTURBATIONS = {
    "nominal": PerturbationSettings(kind="nominal"),
    "queue_reorder": PerturbationSettings(kind="queue_reorder", probability=0.5, magnitude_s=0.25),
}


def settings(*, starts=2, margin=0.05, alpha=0.05):
    return StressSettings(
        starts=starts, episode_limit_s=1.5, candidates=2, baselines=["chunked_bc"],
        perturbations=PERTURBATIONS, margin=margin, alpha=alpha,
    )  # fmt: skip


@pytest.fixture(scope="module")
def written(task, fleet, kit, tmp_path_factory):
    folder = tmp_path_factory.mktemp("stress")
    root, trained = fleet
    entrants = [
        Entrant(method, root / method / "seed_0", trained[method][0])
        for method in ("chunked_bc", "flow")
    ]
    starts = tuple(s.to_json() for s in matched_starts(task, root_seed=1, count=2))
    latency = LatencyModel(
        {name: DeclaredTerm(0.001, 0.002) for name in DECLARED_TERMS},
        {name: np.full(4, 0.006) for name in MEASURED_TERMS},
        0.0,
    )
    shards = [
        Shard(
            task=task.name, method=entrant.method, seed=0, checkpoint=entrant.checkpoint,
            sha256=entrant.sha256, perturbation=name, schedule=schedule, starts=starts,
            episode_limit_s=1.5, candidates=2, horizons=kit.HORIZONS, execution=kit.EXECUTION,
            feasibility=kit.FEASIBILITY, latency=latency, root_seed=1,
            journal=folder / "journals" / f"{entrant.method}__{name}.mcap",
        )
        for entrant, name, schedule in plan_shards(entrants, PERTURBATIONS)
    ]  # fmt: skip
    write_stress(folder, shards, settings(), workers=1, scheduler="local", root_seed=1)
    return folder


def test_every_method_meets_every_perturbation():
    entrants = [Entrant(name, None, "") for name in ("a", "b", "c")]
    plan = plan_shards(entrants, PERTURBATIONS)
    assert [(name, entrant.method) for entrant, name, _ in plan] == [
        (name, method) for name in PERTURBATIONS for method in "abc"
    ]
    assert all(schedule is PERTURBATIONS[name] for _, name, schedule in plan)


def test_starts_are_matched_by_hash(written):
    rows = read_table(written / "rollouts.parquet").to_pandas()
    assert len(rows) == 2 * 2 * 2
    assert (rows.groupby("start")["start_sha256"].nunique() == 1).all()
    assert rows["start_sha256"].nunique() == 2


def test_tables_agree_with_each_other(written):
    key = ["method", "perturbation"]
    rows = read_table(written / "rollouts.parquet").to_pandas()
    balance = read_table(written / "conservation.parquet").to_pandas()
    ended = balance["executed"] + balance["queued"] + balance["discarded"]
    assert (balance["generated"] == ended).all()
    counts = read_table(written / "counts.parquet").to_pandas().groupby(key)["count"].sum()
    assert counts.to_dict() == balance.set_index(key)["discarded"].to_dict()
    assert rows.groupby(key)["discards"].sum().to_dict() == counts.to_dict()
    stub = read_table(written / "stub.parquet").to_pandas()
    assert (stub["stale"] == 0).all() and (stub["invalid"] == 0).all()
    moved = rows.groupby(key)[["action_ticks", "fallback_ticks"]].sum().sum(axis=1)
    assert stub.set_index(key)["arrivals"].to_dict() == moved.to_dict()


def test_the_checker_has_read_every_journal(written):
    checked = read_json(written / "checker.json")
    rows = read_table(written / "rollouts.parquet").to_pandas()
    assert checked["violations"] == []
    assert checked["checked_actions"] == rows["action_ticks"].sum()
    assert sorted(checked["journals"]) == sorted(p.name for p in (written / "journals").iterdir())
    assert sum(item["sessions"] for item in checked["journals"].values()) == len(rows)


def test_ages_are_quantiles_of_all_rollouts(written):
    ages = read_table(written / "ages.parquet").to_pandas()
    rows = read_table(written / "rollouts.parquet").to_pandas()
    for (method, name), part in ages.groupby(["method", "perturbation"]):
        assert part["level"].tolist() == list(AGE_LEVELS)
        assert part["action_age_s"].is_monotonic_increasing
        own = rows[(rows["method"] == method) & (rows["perturbation"] == name)]
        assert part["action_age_s"].iloc[-1] == own["action_age_max_s"].max()
        assert part["actions"].iloc[0] == own["action_ticks"].sum()


def test_power_is_reproducible_and_grows_with_the_starts():
    few, many = power_document(settings(starts=10), 1), power_document(settings(starts=100), 1)
    assert canonical_json(few) == canonical_json(power_document(settings(starts=10), 1))
    assert (few["pairs"], many["pairs"], few["margin"]) == (10, 100, 0.05)

    def promoted(document):
        return {
            (row["baseline_success"], row["candidate_success"]): row["promote_share"]
            for row in document["rows"]
        }

    assert promoted(many)[0.3, 0.9] > 0.95
    assert promoted(many)[0.3, 0.9] >= promoted(few)[0.3, 0.9]
    # No gain: a wrong promotion is no more probable than alpha (plus simulation error).
    assert max(promoted(many)[0.5, 0.5], promoted(many)[0.9, 0.9]) <= 0.05 + 0.015


def test_too_few_starts_can_never_promote():
    # An e-value can at most grow by a factor of (1 + wager * (1 - margin)) < 2 per pair:
    # two pairs give less than 4, and alpha = 0.05 asks for 20.
    document = power_document(settings(starts=2), 1)
    assert [row["promote_share"] for row in document["rows"]] == [0.0] * 5
    assert [row["median_pairs"] for row in document["rows"]] == [None] * 5
