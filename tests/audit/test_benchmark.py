"""The benchmark's generator plants what it says, and nothing else."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.audit.__main__ import FIRST_SEED, jobs
from benchmarks.audit.cases import CAUSES
from benchmarks.audit.plan import Defect, Plan, draw_roster
from benchmarks.audit.recorder import TASKS, record
from benchmarks.audit.tables import BEGIN, END, into_page
from genpolicy.audit.data import relative_paths

SMALL = 24


def lags(data):
    """Lag of each episode in rows, by least squares over whole shifts."""
    found = []
    for number in range(len(data.episodes)):
        rows = np.flatnonzero(data.episode == number)
        a, o = data.action[rows][:, data.action_position], data.position[rows]
        errors = [np.mean((o[k : len(o) - 6 + k] - a[: len(a) - 6]) ** 2) for k in range(7)]
        found.append(int(np.argmin(errors)))
    return np.array(found)


@pytest.mark.parametrize("task", list(TASKS))
def test_the_same_plan_gives_the_same_bytes_and_another_seed_does_not(task):
    first, second = (record(task, Plan(3, shares=(0.5, 0.5), episodes=SMALL)) for _ in range(2))
    other = record(task, Plan(4, shares=(0.5, 0.5), episodes=SMALL))
    assert first.data.observation.tobytes() == second.data.observation.tobytes()
    assert first.data.action.tobytes() == second.data.action.tobytes()
    assert first.data.observation.tobytes() != other.data.observation.tobytes()


@pytest.mark.parametrize("task", list(TASKS))
def test_demonstrated_chunks_pass_the_check_and_the_mean_of_the_sides_does_not(task):
    plan = Plan(5, shares=(0.5, 0.5), episodes=SMALL)
    data, check = record(task, plan).data, TASKS[task].admissible(plan)
    clean = np.flatnonzero(~data.episodes.is_recovery)
    starts = np.searchsorted(data.episode, clean) + 6
    paths = relative_paths(data, starts, 26) + data.position[starts][:, None]
    assert all(
        check(path, data.observation[row])[0] for path, row in zip(paths, starts, strict=True)
    )
    assert not check(paths.mean(axis=0), data.observation[starts[0]])[0]


@pytest.mark.parametrize("task", list(TASKS))
def test_a_clock_fault_moves_the_lag_of_its_episodes_only(task):
    clean = Plan(6, episodes=SMALL)
    period = TASKS[task].PERIOD_S
    fault = replace(clean, defects=(Defect("robot_clock", 2 * period),))
    before, after = record(task, clean).data, record(task, fault).data
    late = before.episodes.calibration_epoch == max(before.episodes.calibration_epoch.tolist())
    same = (before.position == after.position).all(axis=1)
    assert same[~late[before.episode]].all()
    moved = lags(after)[late] - lags(before)[late]
    assert np.all(np.abs(moved) <= 2) and np.abs(np.median(moved)) >= 1
    assert np.array_equal(before.action, after.action)


@pytest.mark.parametrize("task", list(TASKS))
def test_an_exact_data_set_holds_what_is_planted_and_nothing_else(task):
    period, plan = TASKS[task].PERIOD_S, Plan(6, episodes=SMALL, recoveries=3, exact=True)
    data = record(task, plan).data
    same = data.episode[1:] == data.episode[:-1]
    assert data.position[1:][same] == pytest.approx(
        data.action[:-1, data.action_position][same], abs=1e-12
    )
    assert data.episodes.is_recovery.tolist() == [False] * (SMALL - 3) + [True] * 3
    assert set(data.episodes.outcome.tolist()) == {"success"} and not data.delay_s
    late = replace(plan, defects=(Defect("robot_clock", 2 * period),))
    moved = lags(record(task, late).data) - lags(data)
    epochs = data.episodes.calibration_epoch
    assert np.array_equal(moved, 2 * (epochs == epochs[-1]))


def test_a_decider_decides_as_often_as_it_is_said_to():
    plan = Plan(7, shares=(0.5, 0.5), decided_by="operator", fidelity=0.8, episodes=4000)
    roster = draw_roster(plan, 0.01)
    assert np.mean(roster.mode == roster.cue) == pytest.approx(0.9, abs=0.02)
    free = draw_roster(replace(plan, decided_by="chance", shares=(0.6, 0.2, 0.2)), 0.01)
    assert np.bincount(free.mode) / 4000 == pytest.approx([0.6, 0.2, 0.2], abs=0.03)


def test_wrong_labels_copies_and_glued_episodes_are_as_many_as_said():
    wrong = record("planar", Plan(8, wrong_labels=0.25, episodes=200))
    truth = np.array([wrong.outcomes[uuid] for uuid in wrong.data.episodes.uuid])
    assert np.mean(truth != wrong.data.episodes.outcome) == pytest.approx(0.25, abs=0.08)
    twice = record("planar", Plan(8, defects=(Defect("repeat", 0.2),), episodes=50))
    assert len(twice.data.episodes) == 60 and len(twice.outcomes) == 60
    single = record("planar", Plan(8, episodes=50)).data
    glued = record("planar", Plan(8, defects=(Defect("glue", 1.0, "all"),), episodes=50)).data
    assert len(glued.observation) == 2 * len(single.observation)


@pytest.mark.parametrize("kind", ["turn", "mirror", "swap", "position_unit", "tool_shift"])
def test_faults_of_the_frame_touch_the_observed_position_only(kind):
    clean = Plan(9, episodes=SMALL)
    size = {"turn": 0.5, "position_unit": 1000.0, "tool_shift": 0.01}.get(kind, 1.0)
    a = record("planar", clean).data
    b = record("planar", replace(clean, defects=(Defect(kind, size, "all"),))).data
    assert np.array_equal(a.action, b.action)
    assert np.array_equal(a.observation[:, 2:], b.observation[:, 2:])
    if kind == "turn":
        assert np.linalg.norm(b.position, axis=1) == pytest.approx(
            np.linalg.norm(a.position, axis=1)
        )
    assert not np.allclose(a.position, b.position)


def test_the_catalogue_is_complete_and_seeds_are_apart():
    names = [cause.name for cause in CAUSES]
    assert len(set(names)) == len(names)
    for cause in CAUSES:
        assert cause.reason and cause.answers
        assert any(cause.strong(strength) for strength in cause.strengths)
        for task in TASKS:
            plan = cause.plan(1, cause.strengths[-1], task)
            assert isinstance(plan, Plan)
    both = {
        seeds: [job.seed for job in jobs(seeds, repeats=1, tasks=list(TASKS), only="")]
        for seeds in FIRST_SEED
    }
    assert len(both["report"]) >= 400
    assert all(len(set(seeds)) == len(seeds) for seeds in both.values())
    assert not set(both["report"]) & set(both["development"])


def test_tables_go_between_the_marks_of_the_page(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(f"before\n{BEGIN}\nold\n{END}\nafter\n")
    into_page(page, "new")
    text = page.read_text()
    assert "old" not in text and "new" in text
    assert text.startswith("before\n") and text.endswith("\nafter\n")
