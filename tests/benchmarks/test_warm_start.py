"""The comparison of warm and cold starts: who starts from what, from where, and what is counted."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks import warm_start
from genpolicy.candidates.judged import trained
from genpolicy.evidence.stress.state import Outcome
from genpolicy.policies.policy import NetworkPolicy

STARTS = 2


@pytest.fixture
def loops(monkeypatch, task):
    """What each arm ran: its rollouts, its policy, and the evaluations of each invocation."""
    seen, drawn = [], []
    real, sample = warm_start.closed_loop, NetworkPolicy.sample

    parts = [task.observation.slices[name] for name in
             ("tcp_position_m", "tcp_rotation", "gripper_opening_m")]  # fmt: skip

    def counted(self, observations, **named):
        samples = sample(self, observations, **named)
        drawn.append(samples.nfe)
        # Barely trained chunks are refused, and nothing is planned: these stay where the hand is,
        # but for a trace of what was drawn.
        here = np.concatenate([observations[:, -1, part] for part in parts], axis=1)
        chunks = np.broadcast_to(here[:, None, None], samples.actions.shape).copy()
        chunks[..., :3] += 1e-6 * samples.actions[..., :3]
        return replace(samples, actions=chunks)

    def watched(policy, setup, **named):
        drawn.clear()
        rollouts = real(policy, setup, **named)
        seen.append(SimpleNamespace(
            policy=policy, setup=setup, rollouts=rollouts, evaluations=list(drawn)
        ))  # fmt: skip
        return rollouts

    monkeypatch.setattr(NetworkPolicy, "sample", counted)
    monkeypatch.setattr(warm_start, "closed_loop", watched)
    monkeypatch.setattr(warm_start, "METHODS", ("flow",))  # two steps of Euler
    monkeypatch.setattr(warm_start, "CANDIDATES", 2)
    return seen


def test_one_arm_is_cold_the_other_warm_and_both_begin_alike(fleet, tmp_path, capsys, loops):
    (tmp_path / "train_generators").symlink_to(fleet[0])
    warm_start.main([
        "--artifacts", str(tmp_path), "--starts", str(STARTS), "--ticks", "60", "--repeats", "1",
        "--strengths", "1", "0.5",
    ])  # fmt: skip
    head, *lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert [line[:3] for line in lines] == [["flow", "1", "(cold)"], ["flow", "0.5", lines[1][2]]]
    assert [line[-9:][0] for line in lines] == ["2", "1"]  # evaluations
    assert [line[-1].partition("/")[2] for line in lines] == [str(STARTS)] * 2
    assert "success" in head

    cold, warm = loops
    assert set(cold.evaluations) == {2} and len(cold.evaluations) > 2
    # With no plan before it, the first chunk takes every step in both arms.
    assert warm.evaluations[0] == 2 and 1 in warm.evaluations[1:]
    assert warm.evaluations.count(1) > warm.evaluations.count(2)
    for arm in loops:
        assert len(arm.rollouts) == len(arm.policy.seen) == STARTS
    for before, after in zip(cold.policy.seen.values(), warm.policy.seen.values(), strict=True):
        assert [np.array_equal(*pair) for pair in zip(before[0], after[0], strict=True)] == [
            True
        ] * 2
        assert len(before) > 1 and not np.array_equal(before[1][1], after[1][1])
    one, two = ([start[0][0] for start in arm.policy.seen.values()] for arm in loops)
    assert not np.array_equal(one[0], one[1]) and np.array_equal(one, two)


def rollout(outcome, splices=(), judged=()):
    events = [
        SimpleNamespace(kind="candidate", payload={"layers": layers}) for layers in judged
    ] + [SimpleNamespace(kind="other", payload={})]
    return SimpleNamespace(
        outcome=outcome, splices=list(splices), journal=SimpleNamespace(events=lambda: events)
    )


def splice(parents, jump_m, jerk):
    return SimpleNamespace(parents=parents, raw_jump_m=jump_m, raw_jerk_m_s3=jerk)


def test_each_figure_counts_what_its_column_says(fleet, monkeypatch):
    """The first chunk of a rollout joins nothing; a check that was not run has not passed."""
    ended = [
        rollout(Outcome.SUCCESS, [splice(0, 9.0, 9.0), splice(1, 0.001, None)],
                [{"a": True, "b": True}, {"a": True, "b": None}]),
        rollout(Outcome.TIMEOUT, [splice(1, 0.002, 5.0), splice(1, 0.003, 7.0)], [{"a": False}]),
        rollout(Outcome.SUCCESS),
    ]  # fmt: skip
    monkeypatch.setattr(warm_start, "closed_loop", lambda *_, **__: ended)
    monkeypatch.setattr(warm_start, "setup_of", lambda *_: None)
    monkeypatch.setattr(warm_start, "switched", lambda *_: (1, 3))
    [judged] = trained(fleet[0], ["flow"], seeds=[0], device="cpu")
    given = SimpleNamespace(starts=3, ticks=1, repeats=1)
    found = warm_start.row_of(judged, 0.5, given)
    named = dict(zip(warm_start.COLUMNS[2:4], found[2:4], strict=True))
    assert named == {"jump mm": "2", "p95": "2.9"}
    assert found[4:] == ["6", "6.9", "1/3", "1/3", "2/3"]
    assert (found[0], float(found[1]) > 0.0) == ("1", True)


def test_a_mode_switches_between_chunks_of_one_rollout_that_name_one():
    modes = {"a": ["left", "left", "right", "unassigned", "left"], "b": ["right", "right"]}
    policy = SimpleNamespace(
        seen={name: [(mode, np.zeros((1, 10))) for mode in said] for name, said in modes.items()}
    )
    task = SimpleNamespace(mode_of=lambda path, seen: seen)
    assert warm_start.switched(policy, task) == (1, 3)
