"""One session without a process: ticks, answers and people, in the order that is told here."""

import math

import numpy as np
import pytest
from told import begin

from genpolicy.wall_clock.messages import Answer, Operator, Order


def test_an_answer_is_executed_from_the_next_tick_on(told):
    ask = told.tick()
    assert ask.noise == ("still", "0") and ask.observations.shape == (2, 24)
    told.answer(ask)
    told.decide()
    assert told.session.stub.accepted == 0 and told.count("scene") == 1
    told.tick()
    assert told.session.stub.accepted == 1
    told.end()
    assert told.checked() == set()


def moving(task, shifts_m):
    """The task, of which at each further look the bodies stand so far aside; None: it raises."""

    class Moving:
        looks = iter(shifts_m)

        def __getattr__(self, name):
            return getattr(task, name)

        def scene_poses(self, observation):
            aside_m = next(self.looks)
            if aside_m is None:
                raise ValueError("the body is lost")
            poses = task.scene_poses(observation)
            return {
                name: (at + np.array([0.0, aside_m, 0.0]), turn)
                for name, (at, turn) in poses.items()
            }

    return Moving()


@pytest.mark.parametrize(("shifts_m", "accepted"), [
    ([0.0] * 6, 4), ([0.0, 0.015, 0.019, 0.015, 0.0, 0.0], 4),
    ([0.0, -0.019, -0.03, -0.038, -0.038, -0.038], 1),  # each step is small
])  # fmt: skip
def test_a_body_is_held_against_where_it_stood_at_the_check(told, shifts_m, accepted):
    told.session._task = moving(told.task, shifts_m)
    told.answer(told.tick())
    told.decide()
    for _ in range(4):
        told.tick()
    assert told.session.stub.accepted == accepted
    told.end()
    assert told.checked() == set()


def test_a_task_that_cannot_tell_its_scene_does_not_keep_a_force_from_stopping(told):
    told.session._task = moving(told.task, [0.0, None, None])
    told.answer(told.tick())
    told.decide()
    forces_n = (0.0, 1e3, *told.session.replay.forces_n[2:])
    told.session.replay = told.session.replay.model_copy(update={"forces_n": forces_n})
    told.tick()
    assert told.session.stub.supervisor.stopped and told.session.stub.accepted == 0
    told.tick()
    told.end()
    assert told.checked() == set()


def test_only_the_first_answer_to_what_was_asked_is_taken(told):
    ask = told.tick()
    told.answer(ask, invocation="another")
    told.answer(ask)
    told.answer(ask)
    told.decide()
    told.answer(ask)
    assert told.session.tally.dropped == {"unsolicited": 3} and told.jobs == []
    assert told.count("enqueue") == 1


def test_an_answer_after_the_deadline_is_not_taken(told):
    ask = told.tick()
    while told.count("discard") == 0:
        told.tick()
    told.answer(ask)
    assert told.session.tally.dropped == {"deadline": 1, "unsolicited": 1}
    last = told.session.journal.last("discard")
    assert (last["reason"], last["chunk_id"]) == ("expired", ask.invocation)


def test_a_verdict_after_the_deadline_moves_nothing(told):
    told.answer(told.tick())
    while told.count("discard") == 0:
        told.tick()
    told.decide()
    told.tick()
    assert told.session.tally.dropped["late_verdict"] == 1
    assert told.count("enqueue") == told.session.stub.accepted == 0
    told.end()
    assert told.checked() == set()


def test_what_nobody_can_judge_now_is_given_up(told):
    told.take = lambda job: False
    told.answer(told.tick())
    assert told.session.tally.dropped == {"admission_busy": 1}
    assert told.session.journal.last("discard")["reason"] == "expired"


def test_an_answer_behind_the_horizon_is_not_judged(kit, task, checker, standing, tmp_path):
    told = begin(kit, task, checker, standing, tmp_path, deadline_s=5.0)
    ask = told.tick()
    for _ in range(kit.HORIZONS.execution_horizon):
        told.tick()
    told.answer(ask)
    assert told.jobs == [] and told.session.tally.dropped == {"too_late": 1}


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"checkpoint": "0" * 64}, "checkpoint_mismatch"),
        ({"sampler": "0" * 64}, "sampler_mismatch"),
        ({"actions": np.full((16, 10), np.nan)}, "infeasible"),
    ],
)
def test_what_is_claimed_is_asked(changes, reason, told):
    told.answer(told.tick(), **changes)
    told.decide()
    assert told.session.journal.last("discard")["reason"] == reason
    assert told.session.stub.arrivals == 0


def test_what_could_not_be_judged_is_infeasible(told):
    told.answer(told.tick())
    told.session.decide(told.jobs.pop(), None, 0.02, told.take)
    assert told.session.journal.last("discard")["reason"] == "infeasible"
    assert told.count("candidate") == 0


def test_a_recorded_force_above_the_limit_stops(told, kit):
    limit_n = kit.EXECUTION.force_limit_n[told.session.replay.phases[0]]
    forces = [limit_n, limit_n + 1e-6] + [0.0] * (len(told.session.replay) - 2)
    told.session.replay = told.session.replay.model_copy(update={"forces_n": tuple(forces)})
    told.answer(told.tick())
    told.decide()
    assert not told.session.stub.supervisor.stopped
    told.tick()
    assert told.session.stub.supervisor.stopped and told.session.stub.accepted == 0
    assert told.count("invalidate") == 1
    told.end()
    assert told.checked() == set()


def test_a_clock_that_tells_no_time_asks_for_nothing(told):
    assert told.tick(math.nan) is None
    assert told.count("hold") == 1 and told.count("invocation") == 0


def test_a_person_stops_and_only_a_named_one_resets(told):
    told.answer(told.tick())
    told.decide()
    told.session.obey(Operator(Order.EMERGENCY_STOP, "spotter"), 0.03)
    told.tick()
    told.session.obey(Operator(Order.RESET, " "), 0.06)
    assert told.session.stub.supervisor.stopped and told.session.stub.accepted == 0
    told.session.obey(Operator(Order.RESET, "spotter"), 0.07)
    assert not told.session.stub.supervisor.stopped and not told.session.ended
    told.session.obey(Operator(Order.END), 0.08)
    assert told.session.ended
    told.end()
    assert told.checked() == set()


def test_a_person_who_resets_on_a_doubted_clock_is_told_so(told, capsys):
    told.tick()
    told.session.obey(Operator(Order.EMERGENCY_STOP, "Ann"), 0.03)
    for now_s, why in ((3600.0, "clock_ahead"), (0.01, "clock_backwards"), (math.nan, "no_time")):
        told.session.obey(Operator(Order.RESET, "Ann"), now_s)
        assert told.session.stub.supervisor.stopped
        assert told.session.tally.dropped[f"reset_{why}"] == 1
        assert "the time of a supervisor reset is" in capsys.readouterr().err
    told.session.obey(Operator(Order.RESET, "Ann"), 0.05)
    assert not told.session.stub.supervisor.stopped
    told.end()
    assert told.checked() == set()


def test_one_that_follows_a_stop_begins_stopped(kit, task, checker, standing, tmp_path):
    told = begin(kit, task, checker, standing, tmp_path, stop_stands=True)
    assert told.tick() is None and told.session.stub.supervisor.stopped
    assert told.session.journal.last("supervisor")["event"] == "restarted"
    told.end()
    assert told.checked() == set()


def test_what_is_open_at_the_end_is_accounted_for(told):
    told.tick()
    assert told.session.end(0.01).error == 0
    assert told.session.tally.dropped == {"deadline": 1}
    assert told.checked() == set()


def test_a_cause_without_a_person_is_an_emergency_stop(told):
    told.tick()
    told.session.fail(0.01, "no clock")
    assert told.session.journal.last("supervisor")["detail"] == "no clock"


@pytest.mark.parametrize(
    ("at", "judging_s", "first"),
    [(0.01, 0.0, 1), (0.01, 0.03, 1), (0.01, 0.05, 2), (0.045, 0.01, 2), (0.06, 0.01, 2),
     (0.01, 0.4, 7), (0.01, 60.0, 7)],
)  # fmt: skip
def test_a_chunk_is_judged_for_the_first_row_that_its_verdict_can_be_in_time_for(
    told, at, judging_s, first
):
    """Another first row than the one that was checked could not begin: nobody checked the way."""
    ask = told.tick()
    actions = np.tile(told.task.action_at(ask.observations[-1]), (16, 1))
    answer = Answer(ask.invocation, "c" * 64, "5" * 64, "m", actions)
    told.session.answer(answer, at, told.take, judging_s=judging_s)
    assert told.jobs[0].late_rows == first


def test_a_deadline_of_three_periods_passes_at_the_third_tick_however_it_jitters(told):
    told.tick(0.004)
    told.tick(0.05)
    told.tick(0.1)
    told.tick(0.1501)
    assert told.session.tally.dropped["deadline"] == 1
