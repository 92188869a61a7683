"""Every rule of joining in closed loop, with a trained flow, as the stage runs it."""

import json

import numpy as np
import pytest

from genpolicy.candidates.joining import JoiningSettings
from genpolicy.candidates.judged import JudgedPolicy
from genpolicy.contract.chunk import actions_sha256
from genpolicy.evidence.stress.latency import (
    DECLARED_TERMS,
    MEASURED_TERMS,
    DeclaredTerm,
    LatencyModel,
)
from genpolicy.evidence.stress.matched import matched_starts
from genpolicy.evidence.stress.perturbations import Nominal
from genpolicy.evidence.stress.shard import Comparison
from genpolicy.evidence.stress.tables import plan_shards, write_stress
from genpolicy.execution.cell import Cell
from genpolicy.policies.policy import load_policy
from genpolicy.verification.drawn import drawn_chunks
from genpolicy.verification.journal_source import read_messages

SAMPLES = 2
LATENCY = LatencyModel(
    {name: DeclaredTerm(0.001, 0.002) for name in DECLARED_TERMS},
    {name: np.full(4, 0.006) for name in MEASURED_TERMS},
    0.0,
)


@pytest.fixture(
    scope="module",
    params=[
        "ensemble_oldest",
        "ensemble_newest",
        "running_average",
        "bidirectional",
        "real_time",
        "warm_start",
    ],
)
def rule(request):
    return request.param


@pytest.fixture(scope="module")
def folder(rule, task, fleet, kit, tmp_path_factory):
    root, trained = fleet
    folder = tmp_path_factory.mktemp(rule)
    comparison = Comparison(
        task=task.name,
        starts=tuple(s.to_json() for s in matched_starts(task, root_seed=1, count=2)),
        episode_limit_s=1.5, samples=SAMPLES, cell=Cell(kit.HORIZONS, kit.EXECUTION),
        feasibility=kit.FEASIBILITY, root_seed=1, joining=JoiningSettings(rule=rule),
    )  # fmt: skip
    judged = [JudgedPolicy("flow", 0, root / "flow" / "seed_0", trained["flow"][0], "cpu")]
    shards = plan_shards(
        comparison, judged, {"nominal": Nominal()},
        latency={"flow": LATENCY}, journals=folder / "journals",
    )  # fmt: skip
    write_stress(folder, shards, workers=1, scheduler="local")
    return folder


def test_the_independent_checker_has_nothing_to_object_to(folder):
    found = json.loads((folder / "checker.json").read_text())
    assert not found["violations"], found


def test_every_candidate_is_what_its_checkpoint_draws_from_what_it_names(folder, rule, fleet):
    (journal,) = (folder / "journals").glob("*.mcap")
    joined = [message for kind, message in read_messages(journal) if kind == "joined"]
    assert joined and {message["rule"] for message in joined} == {rule}
    drawn, wrong = drawn_chunks(journal)
    assert wrong == "" and drawn
    policy = load_policy(fleet[0] / "flow" / "seed_0")
    for item in drawn:
        if item.made.guided:
            continue  # of another question: `tests/gates/test_rederive_joined.py`
        source = item.source
        again = policy.sample(source.history[None], noise_names=[source.key], candidates=SAMPLES)
        assert actions_sha256(again.actions[0, item.index]) == item.sha256
    if rule == "bidirectional":
        assert any(message["draw"] for message in joined), "never another than the first"
