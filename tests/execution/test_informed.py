"""What the world says to an executor is noted as said, and voids what it has to."""

import math

import numpy as np
import pytest
from playing import begin, judged

from genpolicy.evidence.shadow.rig import CHECKPOINT, SAMPLER, Rig
from genpolicy.execution.journal import write_journal


def test_an_older_observation_is_ignored_and_counted():
    rig = Rig()
    rig.advance(0.5)
    assert rig.observe() is True
    rig.phase = "insert"
    assert rig.observe(age_s=0.1) is False  # its phase is not believed either
    assert rig.observe(age_s=-0.1) is False
    assert rig.executor.observe(rig.now_s, math.nan, "insert", "epoch-1") is False
    assert rig.executor.observations_ignored == 3
    assert Rig().executor.observe(0.0, math.nan, "insert", "epoch-1") is False
    rig.phase = "approach"
    assert rig.deliver(rig.chunk()) is None
    judged(rig)


def test_naming_the_active_weights_again_changes_nothing():
    rig = Rig()
    begin(rig)
    rig.executor.set_active(rig.now_s, CHECKPOINT, SAMPLER)
    assert rig.tick()[0].kind == "action"
    judged(rig)


def test_divergence_at_the_limit_is_within_it():
    rig = Rig()
    begin(rig)
    rig.observe(divergence_m=0.05)
    assert rig.tick()[0].kind == "action"
    rig.observe(divergence_m=math.nan)
    assert rig.tick()[0].kind == "hold"
    judged(rig)


@pytest.mark.parametrize("distance_m", [10.0, 10**400, -1e-9, -math.inf, math.nan, "far", 1j])
@pytest.mark.parametrize("age_s", [0.0, 0.04, -0.001, math.nan])
def test_a_divergence_is_heeded_whatever_is_wrong_with_the_time_of_it(distance_m, age_s):
    rig = Rig()
    begin(rig)
    rig.executor.observe(rig.now_s, rig.now_s - age_s, "approach", "epoch-1", distance_m)
    assert rig.tick()[0].kind == "hold"
    judged(rig)


@pytest.mark.parametrize("name", [None, 3, ["approach"], b"approach"])
def test_a_phase_that_is_no_name_allows_nothing(name):
    rig = Rig()
    begin(rig)
    rig.executor.observe(rig.now_s, rig.now_s, name, "epoch-1")
    assert rig.tick()[0].kind == "hold"
    judged(rig)


@pytest.mark.parametrize("mode", [np.zeros(2), None, 3, ["a"]])
def test_a_mode_of_the_controller_that_is_no_name_allows_nothing(mode, tmp_path):
    rig = Rig()
    begin(rig)
    for _ in range(2):
        rig.executor.controller(rig.now_s, mode)
    assert rig.tick()[0].kind == "hold"
    judged(rig)
    write_journal(tmp_path / "j.mcap", [rig.journal])


class OnlyItems:
    """Reads as bodies once, and as nothing else."""

    def items(self):
        return [("post", (np.array([0.9, 0.0, 0.0]), np.array([1.0, 0.0, 0.0, 0.0])))]


@pytest.mark.parametrize(("poses", "noted"), [
    (None, ""), (3, ""), ({"post": (0.5,)}, ""), ({1: ((0, 0, 0), (1, 0, 0, 0))}, ""),
    (OnlyItems(), "post"),
    ({"post": (part for part in ([0.9, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]))}, "post"),
    ({"post": map(np.asarray, ([0.9, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]))}, "post"),
])  # fmt: skip
def test_a_scene_is_read_once_and_one_that_cannot_be_is_one_that_nobody_knows(poses, noted):
    rig = Rig()
    rig.see(post=0.5)
    begin(rig)
    rig.executor.see(rig.now_s, poses)
    assert rig.tick()[0].kind == "hold"
    assert rig.journal.last("scene")["bodies"].keys() == {noted}
    judged(rig)
