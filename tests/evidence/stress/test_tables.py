"""The stress evidence: plan, tables, journals, power."""

import sys
from types import SimpleNamespace

import numpy as np
import pytest

from genpolicy.candidates.brought import BroughtPolicy
from genpolicy.candidates.joining import JoiningSettings
from genpolicy.candidates.judged import JudgedPolicy
from genpolicy.errors import ConfigError
from genpolicy.evidence.documents.shadow import CHECKER
from genpolicy.evidence.documents.stress import DISTILLED
from genpolicy.evidence.rows.stress import RefusedRow, RolloutRow
from genpolicy.evidence.shadow.candidate_rows import numbers_sha256
from genpolicy.evidence.shadow.rig import EXECUTION
from genpolicy.evidence.stress.latency import (
    DECLARED_TERMS,
    MEASURED_TERMS,
    DeclaredTerm,
    LatencyModel,
)
from genpolicy.evidence.stress.matched import matched_starts
from genpolicy.evidence.stress.perturbations import Nominal, QueueReorder
from genpolicy.evidence.stress.power import power_document
from genpolicy.evidence.stress.settings import PersonSettings, StressSettings
from genpolicy.evidence.stress.shard import Comparison
from genpolicy.evidence.stress.tables import AGE_LEVELS, plan_shards, write_distilled, write_stress
from genpolicy.execution.cell import Cell
from genpolicy.integrity.rows import read_rows
from genpolicy.integrity.tables import read_table
from genpolicy.policies.matched_training import PolicySettings, TrainingPlan, train_methods
from genpolicy.policies.settings import NetworkConfig, SamplerConfig, TrainingConfig
from genpolicy.verification import tables
from genpolicy.verification.journal_source import read_messages
from genpolicy.verification.refused import KEYS as REFUSED_KEYS
from genpolicy.verification.refused import RefusedCandidates
from genpolicy.verification.rollouts import differences
from genpolicy.verification.tables import KEYS, derived_tables
from tests.candidates.conftest import entry_of  # noqa: F401

JOINED = SimpleNamespace(
    joining=JoiningSettings(), person=None, cell=SimpleNamespace(execution=EXECUTION)
)
PERTURBATIONS = {
    "nominal": Nominal(),
    "queue_reorder": QueueReorder(probability=0.5, magnitude_s=0.25),
}


def settings(*, starts=2, margin=0.05, alpha=0.05):
    return StressSettings(
        starts=starts, episode_limit_s=1.5, samples=2, baselines=["chunked_bc"],
        perturbations=PERTURBATIONS, margin=margin, alpha=alpha, planned_effect=(0.5, 0.8),
    )  # fmt: skip


@pytest.fixture(scope="module")
def written(task, fleet, kit, tmp_path_factory):
    folder = tmp_path_factory.mktemp("stress")
    root, trained = fleet
    judged = [
        JudgedPolicy(method, 0, root / method / "seed_0", trained[method][0], "cpu")
        for method in ("chunked_bc", "flow")
    ]
    starts = tuple(s.to_json() for s in matched_starts(task, root_seed=1, count=2))
    latency = LatencyModel(
        {name: DeclaredTerm(0.001, 0.002) for name in DECLARED_TERMS},
        {name: np.full(4, 0.006) for name in MEASURED_TERMS},
        0.0,
    )
    comparison = Comparison(
        task=task.name, starts=starts, episode_limit_s=1.5, samples=2,
        cell=Cell(kit.HORIZONS, kit.EXECUTION), feasibility=kit.FEASIBILITY, root_seed=1,
    )  # fmt: skip
    models = dict.fromkeys(("chunked_bc", "flow"), latency)
    shards = plan_shards(
        comparison, judged, PERTURBATIONS, latency=models, journals=folder / "journals"
    )
    write_stress(folder, shards, workers=1, scheduler="local")
    return folder


def test_a_server_that_does_not_start_costs_its_deadlines_and_nobody_else_s(
    task,
    fleet,
    kit,
    entry_of,  # noqa: F811
    tmp_path,
):
    """It is compared beside one of ours; nothing of it is chosen by who reads the tables."""
    root, trained = fleet
    command = [sys.executable, "-c", "raise SystemExit('no weights here')  # {port}"]
    entry = entry_of(address=None, command=command)
    judged = [
        JudgedPolicy("flow", 0, root / "flow" / "seed_0", trained["flow"][0], "cpu"),
        BroughtPolicy("planted", tmp_path / "planted.yaml", entry, "c" * 64, 0),
    ]
    starts = tuple(s.to_json() for s in matched_starts(task, root_seed=1, count=1))
    latency = LatencyModel(
        {name: DeclaredTerm(0.001, 0.002) for name in DECLARED_TERMS},
        {name: np.full(4, 0.006) for name in MEASURED_TERMS},
        0.0,
    )
    comparison = Comparison(
        task=task.name, starts=starts, episode_limit_s=3.0, samples=2,
        cell=Cell(kit.HORIZONS, kit.EXECUTION), feasibility=kit.FEASIBILITY, root_seed=1,
    )  # fmt: skip
    shards = plan_shards(
        comparison, judged, {"nominal": Nominal()}, latency=dict.fromkeys(["flow", "planted"],
        latency), journals=tmp_path / "journals",
    )  # fmt: skip
    write_stress(tmp_path, shards, workers=1, scheduler="local")
    rows = read_table(tmp_path / "faults.parquet").to_pylist()
    assert {row["method"] for row in rows} == {"planted"}
    counted = {row["fault"]: row["count"] for row in rows}
    journals = sorted((tmp_path / "journals").iterdir())
    derived = [row for row in derived_tables(journals)["faults"] if row["method"] == "planted"]
    assert {row["fault"]: row["count"] for row in derived} == counted
    by_method = {
        row["method"]: row for row in read_table(tmp_path / "rollouts.parquet").to_pylist()
    }
    planted = by_method["planted"]
    assert set(counted) <= {"closed", "gone"} and planted["rejections"] == 0
    assert 0 < planted["deadline_misses"] == sum(counted.values())
    assert by_method["flow"]["deadline_misses"] == 0
    assert CHECKER.read(tmp_path).violations == []


def test_a_person_for_whom_nobody_waits_as_long_is_refused(tmp_path):
    judged, models = [JudgedPolicy("a", 0, tmp_path, "", "cpu")], {"a": None}
    waits_s = EXECUTION.human_timeout_s
    for latest_s, refused in ((waits_s, False), (waits_s + 0.1, True)):
        person = PersonSettings(reaction_s=(0.0, latest_s), longest_s=1.0)
        joined = SimpleNamespace(**{**vars(JOINED), "person": person})
        arguments = (joined, judged, PERTURBATIONS)
        if refused:
            with pytest.raises(ConfigError, match=r"stress\.person\.reaction_s is up to"):
                plan_shards(*arguments, latency=models, journals=tmp_path)
        else:
            assert plan_shards(*arguments, latency=models, journals=tmp_path)


def test_every_method_meets_every_perturbation(tmp_path):
    judged = [JudgedPolicy(name, 0, tmp_path, "", "cpu") for name in "abc"]
    models = dict.fromkeys("abc")
    plan = plan_shards(JOINED, judged, PERTURBATIONS, latency=models, journals=tmp_path)
    assert [(shard.perturbation, shard.judged.name) for shard in plan] == [
        (name, method) for name in PERTURBATIONS for method in "abc"
    ]
    assert all(shard.schedule is PERTURBATIONS[shard.perturbation] for shard in plan)
    assert len({shard.journal for shard in plan}) == len(plan)


def test_a_method_whose_latency_was_not_measured_is_a_bad_setting(tmp_path):
    judged = [JudgedPolicy(name, 0, tmp_path, "", "cpu") for name in "abc"]
    models = dict.fromkeys("ac")
    with pytest.raises(ConfigError, match="with b, whose latency was not measured"):
        plan_shards(JOINED, judged, PERTURBATIONS, latency=models, journals=tmp_path)


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


def test_every_invocation_of_a_rollout_is_a_row_and_the_first_is_cold(written):
    keys = ["method", "perturbation", "start"]
    rows = read_table(written / "rollouts.parquet").to_pandas().set_index(keys)
    invocations = read_table(written / "invocations.parquet").to_pandas()
    groups = invocations.groupby(keys)["invocation"]
    assert groups.size().to_dict() == rows["invocations"].to_dict()
    assert (groups.min() == 0).all() and (groups.max() + 1 == groups.size()).all()
    assert (invocations["latency_s"] > 0).all()


def test_every_table_follows_from_the_journals(written):
    derived = derived_tables(sorted((written / "journals").iterdir()))
    assert not (written / "faults.parquet").exists()  # nobody was brought
    for name, keys in KEYS.items():
        if name == "faults":
            assert {row["count"] for row in derived[name]} == {0}
            continue
        stated = read_table(written / f"{name}.parquet").to_pylist()
        assert len(stated) == len(derived[name])
        assert stated or name == "ages"  # barely trained: it may be that nothing was accepted
        by_key = {tuple(row[key] for key in keys): row for row in derived[name]}
        for row in stated:
            columns = by_key[tuple(row[key] for key in keys)]
            assert differences(row, columns) == [], (name, row, columns)
            assert set(row) - set(columns) <= {"seed"}
    assert tables.AGE_LEVELS == AGE_LEVELS


def test_what_layers_refused_of_failures_is_there_whole(written):
    """Nobody succeeds in so short a time, so that everything is kept."""
    told = RefusedCandidates()
    for path in sorted((written / "journals").iterdir()):
        for kind, m in read_messages(path):
            told.read(kind, m)
    rollouts = read_rows(written / "rollouts.parquet", RolloutRow)
    assert not any(row.success for row in rollouts)
    due = told.rows({(row.method, row.perturbation, row.start) for row in rollouts})
    expected = {tuple(row[name] for name in REFUSED_KEYS): row["projected_sha256"] for row in due}
    rows = read_rows(written / "refused.parquet", RefusedRow)
    found = {
        tuple(getattr(row, name) for name in REFUSED_KEYS): numbers_sha256(row.projected)
        for row in rows
    }
    assert found == expected != {}
    assert len(found) == len(rows)


def test_the_checker_has_read_every_journal(written):
    checked = CHECKER.read(written)
    rows = read_table(written / "rollouts.parquet").to_pandas()
    assert checked.violations == []
    assert checked.checked_actions == rows["action_ticks"].sum()
    assert sorted(checked.journals) == sorted(p.name for p in (written / "journals").iterdir())
    assert sum(item.sessions for item in checked.journals.values()) == len(rows)


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
    few, many = (
        power_document(settings(starts=10), candidates=1, root_seed=1),
        power_document(settings(starts=100), candidates=1, root_seed=1),
    )
    assert few == power_document(settings(starts=10), candidates=1, root_seed=1)
    assert (few.pairs, many.pairs, few.margin) == (10, 100, 0.05)

    def promoted(document):
        return {
            (row.baseline_success, row.candidate_success): row.promote_share
            for row in document.rows
        }

    assert promoted(many)[0.3, 0.9] > 0.95
    assert promoted(many)[0.3, 0.9] >= promoted(few)[0.3, 0.9]
    # No gain, or just the margin: a wrong promotion is no more probable than alpha (plus
    # simulation error).
    for world in ((0.5, 0.5), (0.9, 0.9), (0.5, 0.55)):
        assert promoted(many)[world] <= 0.05 + 0.015
    assert promoted(many)[0.5, 0.8] > promoted(few)[0.5, 0.8]


def test_the_ladder_s_own_plan_finds_its_planned_effect(kit):
    plan = StressSettings(**kit.PARAMS["stress"])
    candidates = len(kit.PARAMS["train_generators"]["samplers"])
    document = power_document(plan, candidates=candidates, root_seed=kit.PARAMS["seed"])
    found = {
        (row.baseline_success, row.candidate_success): row.promote_share for row in document.rows
    }
    assert found[plan.planned_effect] >= 0.8
    at_margin = plan.planned_effect[0] + plan.margin
    assert found[plan.planned_effect[0], at_margin] <= plan.alpha_of_each(candidates) + 0.006


def test_too_few_starts_can_never_promote():
    # An e-value can at most grow by a factor of (1 + wager * (1 - margin)) < 2 per pair:
    # two pairs give less than 4, and alpha = 0.05 asks for 20.
    document = power_document(settings(starts=2), candidates=1, root_seed=1)
    assert [row.promote_share for row in document.rows] == [0.0] * 6
    assert [row.median_pairs for row in document.rows] == [None] * 6


def test_alpha_is_shared_between_the_registered_candidates():
    document = power_document(settings(starts=10, alpha=0.06), candidates=3, root_seed=1)
    assert document.alpha == pytest.approx(0.02)
    alone = power_document(settings(starts=10, alpha=0.02), candidates=1, root_seed=1)
    assert document.rows == alone.rows


def test_a_distilled_policy_s_teacher_and_what_it_took_stand_beside_the_comparison(
    dataset, kit, tmp_path
):
    """From its checkpoint; where nothing has a teacher, there is no such file."""
    network = NetworkConfig(
        encoder_width=16, condition_dim=16, trunk_width=16, trunk_blocks=1, time_features=16,
        head_parameters=12_000,
    )  # fmt: skip
    short = TrainingConfig(updates=4, batch_size=8, validation_every=4)
    policies = PolicySettings(network=network, training=short, seeds=[0], fixtures=1)
    plan = TrainingPlan(
        dataset=dataset, settings=policies, horizons=kit.HORIZONS, root_seed=1, device="cpu",
        workers=1, scheduler="local",
    )  # fmt: skip
    samplers = {
        "diffusion": SamplerConfig(name="ddim", steps=2),
        "manicm": SamplerConfig(name="multistep_consistency"),
    }
    hashes, _ = train_methods(plan, samplers, folder=tmp_path / "trained")
    judged = [
        JudgedPolicy(name, 0, tmp_path / "trained" / name / "seed_0", hashes[name][0], "cpu")
        for name in samplers
    ]
    (tmp_path / "stress").mkdir()
    write_distilled(tmp_path / "stress", judged[:1])
    assert not list((tmp_path / "stress").iterdir())
    write_distilled(tmp_path / "stress", judged)
    found = DISTILLED.read(tmp_path / "stress")
    assert set(found) == {"manicm"}
    assert found["manicm"].teacher_sha256 == hashes["diffusion"][0]
    assert found["manicm"].updates == 2 * short.updates
