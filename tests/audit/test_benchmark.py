"""The benchmark's generator plants what it says, and nothing else."""

import subprocess
from dataclasses import replace

import numpy as np
import pytest

import benchmarks.audit.__main__ as command
from benchmarks.audit.__main__ import FIRST_DEVELOPMENT_SEED, jobs, measured, sampled
from benchmarks.audit.cases import CAUSES
from benchmarks.audit.frozen import frozen_commit, report_seed
from benchmarks.audit.plan import Defect, Plan, draw_roster
from benchmarks.audit.recorder import TASKS, record
from benchmarks.audit.runner import Job, Result
from benchmarks.audit.tables import BEGIN, END, into_page, markdown
from genpolicy.audit.data import relative_paths
from genpolicy.errors import BadInputError

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
    ages = []
    stamped = Defect("drop_camera", 0.0, "all")  # loses none, and has stamps
    for faults in ((stamped,), (stamped, Defect("glue", 1.0, "all"))):
        seen = record("planar", Plan(8, episodes=9, defects=faults)).data
        ages.append(seen.event_time_s - seen.stream_time_s["camera"])
    assert np.ptp(ages[1]) == pytest.approx(np.ptp(ages[0]), abs=1e-9)


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
    firsts = {"development": FIRST_DEVELOPMENT_SEED, "report": report_seed("0" * 40)}
    both = {
        seeds: [job.seed for job in jobs(first, repeats=1, tasks=list(TASKS), only="")]
        for seeds, first in firsts.items()
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


def test_a_habit_repeats_and_a_drift_moves_as_far_as_said():
    plan = Plan(7, shares=(0.5, 0.5), decided_by="habit", fidelity=0.7, episodes=4000)
    mode = draw_roster(plan, 0.01).mode
    assert np.mean(mode[1:] == mode[:-1]) == pytest.approx(0.85, abs=0.02)
    drift = draw_roster(replace(plan, decided_by="drift", fidelity=0.8), 0.01).mode
    assert np.mean(drift[:400]) == pytest.approx(0.14, abs=0.05)
    assert np.mean(drift[-400:]) == pytest.approx(0.86, abs=0.05)


HIDDEN = {cause.name: cause for cause in CAUSES if cause.group == "hidden_state"}


@pytest.mark.parametrize("cause", HIDDEN.values(), ids=HIDDEN)
def test_what_is_to_be_hidden_decides_between_two_ways(cause):
    # A habit of strength 1 gave one way in every episode, and `unimodal` was counted as wrong.
    for strength in filter(cause.strong, cause.strengths):
        plan = cause.plan(5, strength, "planar")
        mode = draw_roster(plan, 0.01).mode
        share = np.bincount(mode, minlength=2) / len(mode)
        assert len(plan.shares) == 1 or np.sort(share)[-2] > 0.2


def test_what_goes_together_goes_together_and_decides_nothing():
    roster = draw_roster(Plan(7, shares=(0.5, 0.5), correlation=0.9, episodes=4000), 0.01)
    birch = roster.operator == "birch"
    assert np.mean((roster.object == "peg_b") == birch) > 0.9
    assert np.mean(roster.mode[birch]) == pytest.approx(0.5, abs=0.06)


def test_dropped_rows_and_labels_of_one_mode():
    whole = record("planar", Plan(9, episodes=SMALL)).data
    fewer = record("planar", Plan(9, episodes=SMALL, defects=(Defect("drop", 0.2, "all"),))).data
    assert len(fewer.observation) / len(whole.observation) == pytest.approx(0.8, abs=0.05)
    assert np.isin(fewer.event_time_s, whole.event_time_s).all()
    plan = Plan(8, shares=(0.5, 0.5), wrong_labels=0.5, wrong_mode_only=True, episodes=200)
    wrong = record("planar", plan)
    truth = np.array([wrong.outcomes[uuid] for uuid in wrong.data.episodes.uuid])
    mode = draw_roster(plan, 0.01).mode
    assert not np.any((truth != wrong.data.episodes.outcome) & (mode == 0))
    assert np.mean((truth != wrong.data.episodes.outcome)[mode == 1]) == pytest.approx(0.5, abs=0.1)


@pytest.mark.parametrize("task", list(TASKS))
@pytest.mark.parametrize(("kind", "stream"), [("freeze", "robot"), ("freeze_camera", "camera")])
def test_a_frozen_stream_stands_as_long_as_said_while_the_arm_moves(task, kind, stream):
    whole = record(task, Plan(9, episodes=SMALL)).data
    fault = Defect(kind, 1.0, "some", 0.5)
    frozen = record(task, Plan(9, episodes=SMALL, defects=(fault,))).data
    columns = np.arange(whole.observation.shape[1])[whole.streams[stream]]
    others = np.setdiff1d(np.arange(whole.observation.shape[1]), columns)
    assert np.array_equal(frozen.action, whole.action)
    assert np.array_equal(frozen.observation[:, others], whole.observation[:, others])
    still = np.append(False, np.all(np.diff(frozen.observation[:, columns], axis=0) == 0, axis=1))
    rows = np.bincount(frozen.episode[still], minlength=SMALL)
    hit = rows > 0
    assert 0.2 < np.mean(hit) < 0.8
    # A stretch in which the arm slows down in between is longer.
    assert np.quantile(rows[hit], 0.25) == pytest.approx(1.0 / whole.period_s, abs=1)
    steps = np.linalg.norm(np.diff(frozen.commanded, axis=0, prepend=0.0), axis=1)
    assert np.median(steps[still]) > 0.2 * np.median(steps)


@pytest.mark.parametrize("task", list(TASKS))
def test_a_lost_frame_is_held_with_its_stamp(task):
    fault = Defect("drop_camera", 0.3, "all")
    data = record(task, Plan(9, episodes=SMALL, defects=(fault,))).data
    same = data.episode[1:] == data.episode[:-1]
    held = np.diff(data.stream_time_s["camera"])[same] == 0
    still = np.all(np.diff(data.observation[:, data.streams["camera"]], axis=0) == 0, axis=1)[same]
    assert np.mean(held) == pytest.approx(0.3, abs=0.03) and np.array_equal(held, still)
    assert np.all(np.diff(data.stream_time_s["robot"])[same] > 0)


def test_a_freeze_of_one_mode_spares_the_other():
    plan = Plan(9, shares=(0.5, 0.5), episodes=SMALL)
    fault = Defect("freeze_camera", 1.0, "mode", 1.0)
    whole, frozen = (
        record("planar", item).data for item in (plan, replace(plan, defects=(fault,)))
    )
    changed = np.unique(frozen.episode[np.any(frozen.observation != whole.observation, axis=1)])
    assert changed.tolist() == np.flatnonzero(draw_roster(plan, 0.01).mode == 1).tolist()


@pytest.mark.parametrize("task", list(TASKS))
def test_the_operator_goes_with_an_object_that_moves(task):
    still, moving = (
        record(task, Plan(9, episodes=SMALL, object_move_m=far, object_jumps=True)).data
        for far in (0.0, 0.02)
    )
    goal = still.reference.start + 1
    ends = np.searchsorted(still.episode, np.arange(SMALL), side="right") - 1
    moved = moving.observation[:, goal] - still.observation[:, goal]
    assert np.abs(moved[ends]) == pytest.approx(0.02, abs=1e-9)
    assert 0.2 < np.mean(moved[ends] > 0) < 0.8
    commanded = moving.commanded[:, 1] - still.commanded[:, 1]
    assert commanded == pytest.approx(moved, abs=1e-9)
    seen = moving.position[:, 1] - still.position[:, 1]
    assert seen[ends] == pytest.approx(moved[ends], abs=1e-3)
    latched = record(
        task,
        Plan(9, episodes=SMALL, object_move_m=0.02, object_jumps=True,
             defects=(Defect("latch", 1.0, "all"),)),
    ).data  # fmt: skip
    assert np.array_equal(latched.action, moving.action)
    spread = [np.ptp(latched.observation[latched.episode == k, goal]) for k in range(SMALL)]
    assert max(spread) == 0.0


def test_tails_are_heavy_and_end():
    rng = np.random.default_rng(0)
    normal, heavy = (
        np.abs([Plan(0, tails=tails).spread(rng) for _ in range(4000)]) / 0.008
        for tails in (0.0, 2.0)
    )
    assert np.mean(normal > 4) < 0.001 < 0.02 < np.mean(heavy > 4)
    assert heavy.max() <= 6.0 + 1e-9


def _git(root, *command):
    subprocess.run(
        ["git", "-C", str(root), "-c", "user.name=a", "-c", "user.email=a@b.c", *command],
        check=True, capture_output=True,
    )  # fmt: skip


def test_a_report_is_drawn_from_the_commit_and_refused_where_the_detector_is_not_committed(
    tmp_path,
):
    _git(tmp_path, "init", "-q")
    detector = tmp_path / "genpolicy/audit/modes.py"
    detector.parent.mkdir(parents=True)
    detector.write_text("A = 1\n")
    (tmp_path / "notes.md").write_text("x\n")
    _git(tmp_path, "add", "-A")
    _git(tmp_path, "commit", "-q", "-m", "x")
    first = frozen_commit(tmp_path)
    (tmp_path / "notes.md").write_text("y\n")
    assert frozen_commit(tmp_path) == first and len(first) == 40
    detector.write_text("A = 2\n")
    with pytest.raises(BadInputError, match="modes"):
        frozen_commit(tmp_path)
    _git(tmp_path, "commit", "-q", "-am", "y")
    second = frozen_commit(tmp_path)
    assert report_seed(first) != report_seed(second)
    (tmp_path / "gates").mkdir()
    (tmp_path / "gates/new.py").write_text("")
    with pytest.raises(BadInputError, match="new"):
        frozen_commit(tmp_path)


def _result(cause, strength, verdict, *, named):
    number = next(k for k, item in enumerate(CAUSES) if item.name == cause)
    entry = CAUSES[number]
    return Result(
        Job(number, strength, "planar", 1), entry.name, entry.group, entry.strong(strength),
        verdict, "", "", named, named, {}, 1.0,
    )  # fmt: skip


def test_errors_below_the_minimum_and_open_answers_are_counted():
    weak = [_result("hidden operator", 0.2, "valid_modes", named=False)] * 3
    weak += [_result("hidden operator", 0.2, "hidden_state", named=True)]
    strong = [_result("hidden operator", 0.8, "insufficient_support", named=False)]
    strong += [_result("2 valid modes", 0.5, "insufficient_support", named=False)]
    text = markdown([*weak, *strong], seeds="a test")
    assert "| below the minimum: valid_modes said although a cause was planted | 3 | 4 |" in text
    assert "| below the minimum: planted cause not said | 3 | 4 |" in text
    assert "| left open, from the minimum strength on | 2 | 2 |" in text
    assert "| true modes denied: another cause said | 0 | 1 |" in text
    assert "| true modes left open | 1 | 1 |" in text


def test_a_sample_holds_every_cause_and_a_larger_one_holds_the_smaller():
    every = jobs(1_000, repeats=1, tasks=list(TASKS), only="")
    one, two = sampled(every, 5, 1), sampled(every, 5, 2)
    assert {job.cause for job in one} == set(range(len(CAUSES)))
    strong = [(job.cause, job.task) for job in one if CAUSES[job.cause].strong(job.strength)]
    assert len(strong) == len(set(strong)) == len(TASKS) * len(CAUSES)
    assert two[: len(one)] == one and set(sampled(every, 5, None)) == set(every)
    assert [job.strength for job in sampled(every, 6, 1)] != [job.strength for job in one]


def test_a_run_that_was_stopped_goes_on_where_it_stopped(tmp_path, monkeypatch):
    """What the file holds is taken as it is; nothing is measured twice."""
    ran = []

    def fake(run, block, **_):
        ran.extend(block)
        return [replace(_result("unimodal", 8, "unimodal", named=True), job=j) for j in block]

    monkeypatch.setattr(command, "map_shards", fake)
    number = next(k for k, item in enumerate(CAUSES) if item.name == "unimodal")
    todo = [Job(number, 8.0, "planar", seed) for seed in range(20)]
    first = measured(todo[:18], tmp_path / "results.json", workers=1)
    assert ran == todo[:18]
    again = measured(todo, tmp_path / "results.json", workers=1)
    assert ran == todo and again[:18] == first and [r.job for r in again] == todo
