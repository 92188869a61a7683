"""A candidate that failed a gate does not run in the stage behind it, while others go on."""

import json
from dataclasses import dataclass, replace
from types import SimpleNamespace

import pytest

from genpolicy.candidates import judged
from genpolicy.contract.planner import PLANNER
from genpolicy.errors import ConfigError
from genpolicy.evidence.documents.stress import Power
from stages import monitors, shadow, stress
from stages._stage import load_params

ALL = ("diffusion", "flow")
ELSEWHERE = "cpu:0"
"""A device that every machine has, and that is not the word `cpu`."""


@pytest.fixture
def params(evidence, monkeypatch):
    """Settings of the checkout, whose methods are more than those that were admitted."""
    root = __file__.partition("/tests/")[0]
    monkeypatch.chdir(root)
    found = load_params()
    monkeypatch.chdir(evidence)
    found = replace(found, compute=found.compute.model_copy(update={"device": ELSEWHERE}))
    assert set(found.raw["train_generators"]["samplers"]) > set(ALL)
    return found


@pytest.fixture
def weightless(monkeypatch):
    """Checkpoints without weights; what is loaded says its method."""

    def load(folder, *, device, **_):
        name = folder.parent.name
        checkpoint = SimpleNamespace(config=SimpleNamespace(method=name))
        return SimpleNamespace(method=name, checkpoint=checkpoint, device=device)

    monkeypatch.setattr(judged, "load_policy", load)
    monkeypatch.setattr(
        judged, "load_checkpoint", lambda folder: SimpleNamespace(sha256=folder.parent.name)
    )


def nothing(*_, **__):
    checker = SimpleNamespace(cell=None)
    return SimpleNamespace(cell=None, checker=checker, observation=None, scene_path=None)


def without(monkeypatch, module, *names):
    for name in names:
        monkeypatch.setattr(module, name, nothing)


def verdicts(evidence, stage, *gates):
    for gate in gates:
        assert stage(gate)[0] == 0
    return json.loads((evidence / "reports" / f"{gates[-1]}.json").read_text())["candidates"]


@pytest.mark.parametrize("failed", [None, *ALL])
def test_shadow_samples_what_passed_gate_b(
    evidence, stage, gate_evidence, params, weightless, monkeypatch, failed
):
    def slow(frame):
        hit = (frame["method"] == failed) & (frame["run"] == 2)
        return frame.assign(seconds=frame["seconds"].where(~hit, frame["seconds"] * 9))

    gate_evidence.edit_table(evidence, "latency/latency.parquet", slow)
    said = verdicts(evidence, stage, "gate_a", "gate_b")
    assert said == {name: "FAIL" if name == failed else "PASS" for name in ALL}
    ran = []
    without(
        monkeypatch, shadow, "require_one_contract", "require_pinned_limits", "load_task",
        "make_checker", "load_dataset", "two_mode_observations", "held_out_observations", "spread",
        "missing_checks_evidence", "Shadow", "write_shadow", "gallery_of",
    )  # fmt: skip

    def judged(_, policy, *__, **___):
        ran.append(policy)
        return SimpleNamespace(candidates=[])

    monkeypatch.setattr(shadow, "shadow_policy", judged)
    shadow.work(params)
    assert [policy.method for policy in ran] == [name for name in ALL if name != failed]
    assert {policy.device for policy in ran} == {ELSEWHERE}


@pytest.mark.parametrize("failed", [None, *ALL])
def test_stress_rolls_out_what_passed_gate_c(
    evidence, stage, gate_evidence, params, weightless, monkeypatch, failed
):
    def invalid(frame):
        hit = frame["method"] == failed
        return frame.assign(invalid=frame["invalid"].where(~hit, 1))

    gate_evidence.edit_table(evidence, "shadow/stub.parquet", invalid)
    said = verdicts(evidence, stage, "gate_a", "gate_b", "gate_c")
    assert said == {name: "FAIL" if name == failed else "PASS" for name in ALL}
    ran = []
    without(
        monkeypatch, stress, "require_one_contract", "require_pinned_limits", "load_task",
        "Comparison", "latency_models", "write_stress",
    )  # fmt: skip
    monkeypatch.setattr(stress, "matched_starts", lambda *_, **__: ())
    unseen = []
    monkeypatch.setattr(stress, "require_unseen", lambda dataset, starts: unseen.append(dataset))
    monkeypatch.setattr(
        stress, "power_document", lambda *_, **__: Power(margin=0.1, alpha=0.1, pairs=1, rows=[])
    )
    monkeypatch.setattr(stress, "plan_shards", lambda _, judged, *__, **___: ran.extend(judged))
    stress.work(params)
    assert unseen == [stress.ARTIFACTS / "ingest"]
    assert not (evidence / "artifacts/stress/trainings.json").exists()
    baselines = params.raw["stress"]["baselines"]
    assert [policy.name for policy in ran] == [*baselines, *(n for n in ALL if n != failed)]
    networks = [policy for policy in ran if policy.name != PLANNER]  # it runs on no device
    assert {policy.device for policy in networks} == {ELSEWHERE}


def test_stress_rolls_out_every_trained_seed_by_the_same_plan(
    evidence, stage, params, weightless, monkeypatch
):
    """What is trained here, baselines as well; each seed in a folder of its own but the first."""
    verdicts(evidence, stage, "gate_a", "gate_b", "gate_c")
    params.raw["policy"]["seeds"] = [4, 0, 7]
    planned, written = [], []
    without(
        monkeypatch, stress, "require_one_contract", "require_pinned_limits", "load_task",
        "Comparison", "require_unseen",
    )  # fmt: skip
    models = object()
    monkeypatch.setattr(stress, "latency_models", lambda *_: models)
    monkeypatch.setattr(stress, "matched_starts", lambda *_, **__: ())
    monkeypatch.setattr(
        stress, "power_document", lambda *_, **__: Power(margin=0.1, alpha=0.1, pairs=1, rows=[])
    )

    def shards(comparison, who, conditions, *, latency, journals):
        planned.append((comparison, tuple(conditions), latency, journals.parent))
        return who

    monkeypatch.setattr(stress, "plan_shards", shards)
    monkeypatch.setattr(
        stress, "write_stress", lambda place, who, **_: written.append((place, who))
    )
    stress.work(params)
    first, *further = [who for _, who in written]
    trained_here = [one.name for one in first if one.name != PLANNER]
    assert {one.seed for one in first if one.name != PLANNER} == {4}
    assert [{one.seed for one in who} for who in further] == [{0}, {7}]
    assert all([one.name for one in who] == trained_here for who in further)
    for who in further:
        same = [one for one in first if one.name != PLANNER]
        for one, other in zip(same, who, strict=True):
            assert one.folder.parent == other.folder.parent
            assert other.folder.name == f"seed_{other.seed}"
    places = [place for place, _ in written]
    assert [place.relative_to(places[0]).as_posix() for place in places] == [
        ".", "seeds/0", "seeds/7"
    ]  # fmt: skip
    assert places == [journals for *_, journals in planned]
    assert all(one[1:3] == (planned[0][1], models) for one in planned)
    document = json.loads((evidence / "artifacts/stress/trainings.json").read_text())
    assert document == {"seeds": [0, 7]}


@dataclass(frozen=True)
class Planned:
    """A shard, as far as the stage looks at one."""

    judged: object
    end: int | None = None


def test_in_blocks_the_first_training_says_how_far_the_others_run(
    evidence, stage, params, weightless, monkeypatch
):
    verdicts(evidence, stage, "gate_a", "gate_b", "gate_c")
    params.raw["policy"]["seeds"] = [4, 0]
    params.raw["stress"] |= {"starts": 6, "block": 2}
    without(
        monkeypatch, stress, "require_one_contract", "require_pinned_limits", "load_task",
        "Comparison", "latency_models", "require_unseen",
    )  # fmt: skip
    monkeypatch.setattr(stress, "matched_starts", lambda *_, **__: ())
    monkeypatch.setattr(
        stress, "power_document", lambda *_, **__: Power(margin=0.1, alpha=0.1, pairs=1, rows=[])
    )
    monkeypatch.setattr(
        stress, "plan_shards", lambda _, who, *__, **___: [Planned(one) for one in who]
    )
    written = []

    def write(_, shards, *, rule, **__):
        written.append((shards, rule))
        return {one.judged.name: 2 if one.judged.name == "flow" else 6 for one in shards}

    monkeypatch.setattr(stress, "write_stress", write)
    stress.work(params)
    (first, rule), (further, none) = written
    assert (rule.starts, rule.block, rule.simple) == (
        6,
        2,
        tuple(params.raw["stress"]["baselines"]),
    )
    assert none is None and {one.end for one in first} == {None}
    assert {one.judged.name: one.end for one in further} == {
        one.judged.name: 2 if one.judged.name == "flow" else 6
        for one in first if one.judged.name != PLANNER
    }  # fmt: skip
    params.raw["gate_d"]["utility"] = {"model": {"duration": [0.2, "slow is worth less"]}}
    with pytest.raises(ConfigError, match=r"stress\.block is 2 of 6 starts, with gate_d\.utility"):
        stress.work(params)


@pytest.mark.parametrize("failed", [None, *ALL])
def test_monitors_watch_what_passed_gate_c_and_no_baseline(
    evidence, stage, gate_evidence, params, weightless, monkeypatch, failed
):
    def invalid(frame):
        hit = frame["method"] == failed
        return frame.assign(invalid=frame["invalid"].where(~hit, 1))

    gate_evidence.edit_table(evidence, "shadow/stub.parquet", invalid)
    verdicts(evidence, stage, "gate_a", "gate_b", "gate_c")
    ran = []
    without(
        monkeypatch, monitors, "require_one_contract", "load_task", "require_runnable",
        "latency_models", "write_monitors",
    )  # fmt: skip
    monkeypatch.setattr(
        monitors, "plan_thresholds", lambda _, watched, *__, **___: ran.extend(watched)
    )
    monitors.work(params)
    assert [policy.name for policy in ran] == [name for name in ALL if name != failed]
    assert {policy.device for policy in ran} == {ELSEWHERE}
