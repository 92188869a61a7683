"""Shards of the matched comparison: rows, journals, batches that change nothing."""

from dataclasses import asdict, replace

import numpy as np
import pytest

from genpolicy.candidates.judged import JudgedPolicy
from genpolicy.contract.normalisation import MinMax, Normalisation
from genpolicy.errors import IntegrityError
from genpolicy.evidence.stress.matched import matched_starts, run_shard
from genpolicy.evidence.stress.perturbations import NetworkJitter, Nominal, ReducedEnvelope
from genpolicy.evidence.stress.shard import Comparison, Shard
from genpolicy.execution.cell import Cell
from genpolicy.execution.journal import read_journal
from genpolicy.policies.checkpoint import Provenance
from genpolicy.policies.policy import NetworkPolicy
from genpolicy.policies.settings import HeadConfig, NetworkConfig, SamplerConfig, TrainingConfig
from genpolicy.policies.training import train
from genpolicy.policies.training_request import TrainingRequest
from genpolicy.policies.windows import Windows
from genpolicy.seeds import stream
from genpolicy.tasks.api import WorldSettings
from genpolicy.verification.checker import check_journal
from genpolicy.verification.commands import reach_of
from genpolicy.verification.rollouts import derived_with_recoveries, differences

METHODS = {
    "chunked_bc": SamplerConfig(name="direct"),
    "bc_noise": SamplerConfig(name="offset"),
    "flow": SamplerConfig(name="euler", steps=2),
    "ibc": SamplerConfig(name="langevin", steps=3, population=16),
    "bc": SamplerConfig(name="direct"),
}


@pytest.fixture(scope="module")
def checkpoints(tmp_path_factory, task, plans, kit):
    """Barely trained checkpoints whose chunks stay about the starts: folder and hash by method."""
    rng = stream(2, "windows")
    worlds = [task.make_world(s, settings=WorldSettings(kit.EPOCH)) for s in plans.starts]
    seen = np.stack([w.observe() for w in worlds])
    seen = np.repeat(seen, 40, axis=0)
    observations = np.repeat(seen[:, None], 2, axis=1) + rng.normal(0, 1e-3, (120, 2, 24))
    actions = np.repeat(np.stack([w.last_action for w in worlds]), 40, axis=0)[:, None]
    actions = np.repeat(actions, 16, axis=1)
    actions[:, :, 1] += np.linspace(0, 0.02, 16) * rng.choice([-1.0, 1.0], 120)[:, None]
    windows = Windows(observations, actions, np.zeros((120, 16), dtype=bool))
    statistics = {
        name: MinMax(rows.min(axis=(0, 1)), rows.max(axis=(0, 1)))
        for name, rows in (("observation", observations), ("action", actions))
    }
    root = tmp_path_factory.mktemp("checkpoints")
    made = {}
    for method, sampler in METHODS.items():
        request = TrainingRequest(
            method=method,
            horizons=kit.HORIZONS,
            normalisation=Normalisation(**statistics),
            network=NetworkConfig(
                encoder_width=16, condition_dim=16, trunk_width=48, trunk_blocks=1,
                time_features=16, head_parameters=40_000,
            ),
            head=HeadConfig(posterior_width=16),
            training=TrainingConfig(
                updates=60, batch_size=64, learning_rate=3e-3, warmup_updates=5
            ),
            sampler=sampler,
            provenance=Provenance(
                dataset_manifest_sha256="a" * 64, action_contract_sha256="b" * 64,
                observation_contract_sha256="c" * 64,
            ),
            seed=3,
        )  # fmt: skip
        made[method] = (root / method, train(root / method, request, windows=windows))
    return made


@pytest.fixture(scope="module")
def shard(checkpoints, plans, kit, tmp_path_factory):
    """Shards of 1.5 s by method; keywords replace their parts."""
    folder = tmp_path_factory.mktemp("journals")
    count = 0

    def make(method="flow", **changes):
        nonlocal count
        count += 1
        folder_of, sha256 = checkpoints[method]
        shared = {
            "task": "tabletop_insertion", "episode_limit_s": 1.5, "samples": 2,
            "starts": tuple(start.to_json() for start in plans.starts),
            "cell": Cell(kit.HORIZONS, kit.EXECUTION), "feasibility": kit.FEASIBILITY,
            "root_seed": 5,
        }  # fmt: skip
        shared["starts"] = changes.pop("starts", shared["starts"])
        parts = {
            "comparison": Comparison(**shared),
            "judged": JudgedPolicy(method, 0, folder_of, sha256, "cpu"), "perturbation": "nominal",
            "schedule": Nominal(), "latency": kit.latency(), "journal": folder / f"{count}.mcap",
        }  # fmt: skip
        return Shard(**(parts | changes))

    return make


def test_starts_do_not_depend_on_how_many_there_are(task):
    few = matched_starts(task, root_seed=9, count=3)
    many = matched_starts(task, root_seed=9, count=10)
    assert [s.to_json() for s in few] == [s.to_json() for s in many[:3]]
    assert len({s.to_json() for s in many}) == 10
    assert matched_starts(task, root_seed=10, count=1)[0].to_json() != few[0].to_json()


def test_noise_is_redrawn_as_often_as_every_other_method_that_draws(shard, monkeypatch):
    asked = {}
    drawn = NetworkPolicy.sample

    def sample(policy, observations, *, candidates, **others):
        asked.setdefault(policy.method, set()).add(candidates)
        return drawn(policy, observations, candidates=candidates, **others)

    monkeypatch.setattr(NetworkPolicy, "sample", sample)
    for method in METHODS:
        made = shard(method)
        run_shard(made)
        assert check_journal(made.journal).violations == []
    assert asked == {"chunked_bc": {1}, "bc_noise": {2}, "flow": {2}, "ibc": {2}, "bc": {1}}


@pytest.mark.parametrize("method", ["flow", "ibc"])
def test_a_shard_is_deterministic_and_proved(shard, method):
    first, second = shard(method), shard(method)
    one, two = run_shard(first), run_shard(second)
    assert one.rollouts == two.rollouts
    assert first.journal.read_bytes() == second.journal.read_bytes()
    report = check_journal(first.journal)
    assert report.violations == [] and report.sessions == 3
    assert report.checked_actions == sum(row.action_ticks for row in one.rollouts) > 0
    assert one.stub.stale == one.stub.invalid == 0
    assert one.stub.arrivals == len(one.ages_s)
    for account in one.accounts:
        assert account.generated == account.executed + sum(account.discarded.values())


def test_a_row_says_what_its_journal_says(shard):
    plan = shard()
    result = run_shard(plan)
    sessions = read_journal(plan.journal)
    for row in result.rollouts:
        events = sessions[f"flow/nominal/{row.start}"]
        ages = np.sort([e.payload["age_ns"] / 1e9 for e in events if e.kind == "accept"])
        assert row.action_ticks == len(ages)
        assert row.action_age_max_s == ages[-1] <= 0.45
        # Order statistic by hand: the smallest age with at least 95 % at or below it.
        place = int(np.ceil(0.95 * (len(ages) - 1)))
        assert row.action_age_p95_s == ages[place]
        begun = [e for e in events if e.kind == "invocation" and e.payload["stage"] == "begin"]
        assert row.invocations == len(begun)
        assert row.ticks == 30 and row.duration_s == pytest.approx(1.5)
        assert row.outcome == "timeout" and row.success is False
        moved = row.action_ticks + row.hold_ticks + row.fallback_ticks
        assert moved == row.ticks


@pytest.mark.parametrize("seconds", [0.03, 0.25, 0.6])
def test_every_row_follows_from_its_journal(shard, kit, seconds):
    """Answered in time, answered late and rejected, never answered: recoveries among them."""
    plan = shard(latency=kit.latency(seconds))
    result = run_shard(plan)
    derived = derived_with_recoveries(plan.journal)[0]
    assert len(derived) == len(result.rollouts)
    for row in result.rollouts:
        columns = derived[f"flow/nominal/{row.start}"]
        assert differences(asdict(row), columns) == [], (row, columns)
        assert set(asdict(row)) - set(columns) == {"seed"}


@pytest.mark.parametrize("column", ["success", "force_peak_n", "outcome", "hold_ticks", "mode"])
def test_a_row_that_was_changed_is_told_from_its_journal(shard, column):
    plan = shard()
    row = asdict(run_shard(plan).rollouts[0])
    columns = derived_with_recoveries(plan.journal)[0]["flow/nominal/0"]
    row[column] = {"success": True, "outcome": "success", "mode": "other"}.get(column, 123)
    assert differences(row, columns) == [column]


def test_one_action_is_over_when_it_comes_and_never_executed(shard):
    """Plain behaviour cloning answers with the row of the moment that it saw; that one is past."""
    plan = shard("bc")
    for row in run_shard(plan).rollouts:
        assert row.invocations > 0 and row.action_ticks == 0 and row.outcome == "timeout"
    assert check_journal(plan.journal).violations == []


@pytest.mark.parametrize("method", ["flow", "ibc"])
def test_company_changes_no_rollout(shard, plans, method):
    together = run_shard(shard(method)).rollouts
    # Start 0 keeps its index when it is alone, so it must keep its row too.
    (alone,) = run_shard(shard(method, starts=(plans.starts[0].to_json(),))).rollouts
    assert alone == together[0]


def test_methods_meet_the_same_starts(shard):
    jitter = NetworkJitter(probability=1.0, magnitude_s=0.1)
    rows = {
        method: run_shard(shard(method, perturbation="jitter", schedule=jitter)).rollouts
        for method in METHODS
    }
    for matched in zip(*rows.values(), strict=True):
        assert len({row.start_sha256 for row in matched}) == 1
        assert len({row.method for row in matched}) == len(METHODS)


def test_a_method_that_never_delivers_has_unknown_ages_not_zero(shard, kit):
    result = run_shard(shard(latency=kit.latency(0.6)))
    for row in result.rollouts:
        assert row.action_ticks == 0
        assert row.action_age_p50_s is row.action_age_p95_s is row.action_age_max_s is None
        assert row.deadline_misses > 0
    assert len(result.ages_s) == 0


def test_another_checkpoint_is_refused(shard):
    plan = shard()
    with pytest.raises(IntegrityError):
        run_shard(replace(plan, judged=replace(plan.judged, sha256="0" * 64)))
    assert not plan.journal.exists()


def test_rollouts_inside_the_card_s_envelope_are_held_to_it(shard):
    """A speed that binds: free rollouts exceed it, those of the condition do not."""
    free = shard()
    run_shard(free)
    loose = reach_of(free.journal)
    low, high = np.array(loose.lowest_m), np.array(loose.highest_m)
    middle = 0.5 * (low[1] + high[1])
    tight = ReducedEnvelope(
        workspace_lower_m=(0.3, -0.22, 0.02),
        workspace_upper_m=(0.72, float(middle), 0.24),
        speed_limit_m_s=0.5 * loose.fastest_m_s,
    )
    inside = shard(perturbation="envelope", schedule=tight)
    result = run_shard(inside)
    reached = reach_of(inside.journal)
    assert loose.commands > 0 and reached.commands > 0
    assert loose.fastest_m_s > tight.speed_limit_m_s and high[1] > middle
    assert reached.fastest_m_s <= tight.speed_limit_m_s * (1 + 1e-9)
    assert reached.highest_m[1] <= middle + 1e-9
    assert result.stub.invalid == 0 and check_journal(inside.journal).violations == []
