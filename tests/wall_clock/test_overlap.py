"""Inference beside execution: the arm follows what was accepted, and chunks take over in turn."""

import numpy as np
from told import PERIOD_S, STEP_M, begin, onward

from genpolicy.wall_clock.following import arm_of
from genpolicy.wall_clock.messages import Answer, Operator, Order


def until_asked(told):
    """Ticks until something is asked."""
    while (ask := told.tick()) is None:
        pass
    return ask


def accepted(told):
    return [np.frombuffer(bytes.fromhex(e.payload["action"]), "<f8")
            for e in told.session.journal.events() if e.kind == "accept"]  # fmt: skip


def test_the_policy_is_asked_with_what_the_stub_accepted_the_tick_before(told):
    ask = told.tick()
    start = told.task.action_at(ask.observations[-1])
    told.answer(ask, actions=onward(told.task, ask))
    told.decide()
    ask = until_asked(told)
    given = accepted(told)
    assert len(given) == 4 and not np.array_equal(given[-2], start)
    for seen, command in zip(ask.observations, given[-3:-1], strict=True):
        assert told.task.action_at(seen).tobytes() == command.tobytes()


def test_a_chunk_takes_over_from_one_that_runs_and_nothing_is_reset(told):
    ask = told.tick()
    for _ in range(4):
        told.answer(ask, actions=onward(told.task, ask))
        assert told.decide().verdict.passed
        ask = until_asked(told)
    assert told.count("reset") == 0 and told.session.executor.session_epoch == 0
    gone = [e.payload for e in told.session.journal.events() if e.kind == "discard"]
    assert [(e["ended"], e["reason"]) for e in gone] == [("executed", "superseded")] * 3
    # One after the other, without a hold between them: each joins where the last one was.
    assert np.allclose(np.diff(np.array(accepted(told))[:, :3], axis=0), STEP_M, atol=1e-12)
    assert [e.payload["reason"] for e in told.session.journal.events() if e.kind == "hold"] == [
        "empty"
    ]
    told.end()
    assert told.checked() == set()


def test_what_is_judged_is_the_arm_that_follows_and_the_commands_up_to_its_first_row(told):
    ask = told.tick()
    told.answer(ask, actions=onward(told.task, ask))
    told.decide()
    ask = until_asked(told)
    told.tick()
    told.answer(ask, actions=onward(told.task, ask))
    (job,), given = told.jobs, accepted(told)
    for seen, command in zip(job.history, given[-3:-1], strict=True):
        assert told.task.action_at(seen).tobytes() == command.tobytes()
    assert job.commanded.tobytes() == np.stack(given[-3:]).tobytes()
    assert job.event_s == told.row * PERIOD_S and job.late_rows == 2


def test_what_is_judged_is_judged_in_the_scene_of_the_question(told):
    """The checker finds no other on record where ticks go by until a chunk takes over."""
    contract, replay = told.task.observation, told.session.replay
    horizon = told.session.cell.horizons.execution_horizon
    rows = np.array(replay.observations)
    rows[:, contract.slices["post_position_m"]] += 1e-4 * np.arange(len(rows))[:, None]
    shifted = replay.model_copy(update={"observations": tuple(map(tuple, rows.tolist()))})
    told.session.replay = shifted
    told.session.arm = arm_of(told.task, shifted, horizon=horizon)
    ask = told.tick()
    told.tick()
    told.answer(ask, actions=onward(told.task, ask))
    seen, asked = (told.task.scene_poses(each) for each in (told.jobs[0].history[-1], rows[0]))
    assert {n: at.tolist() for n, (at, _) in seen.items()} == {
        n: at.tolist() for n, (at, _) in asked.items()
    }


def test_until_the_row_that_a_chunk_was_judged_for_the_one_before_goes_on(told):
    ask = told.tick()
    told.answer(ask, actions=onward(told.task, ask))
    told.decide()
    ask, at_s = until_asked(told), told.row * PERIOD_S + 0.01
    told.session.answer(
        Answer(ask.invocation, "c" * 64, "5" * 64, "m", onward(told.task, ask)), at_s, told.take,
        judging_s=PERIOD_S,
    )  # fmt: skip
    assert told.jobs[0].late_rows == 2
    told.decide()
    assert told.count("enqueue") == 1
    told.tick()
    assert told.count("enqueue") == 2
    told.tick()
    rows = [(e.payload["chunk_id"][-1], e.payload["row"])
            for e in told.session.journal.events() if e.kind == "accept"]  # fmt: skip
    assert rows[-3:] == [("0", 4), ("0", 5), ("1", 2)]
    told.end()
    assert told.checked() == set()


def late(told):
    """A chunk runs, and the next one is admitted for a row that has gone by."""
    ask = told.tick()
    told.answer(ask, actions=onward(told.task, ask))
    told.decide()
    ask = until_asked(told)
    told.answer(ask, actions=onward(told.task, ask))
    told.tick()
    before = told.session.stub.accepted
    told.decide()
    return ask, before


def test_a_verdict_behind_its_row_is_asked_for_once_more(told):
    """For the row that is next now, from where the arm is now; the chunk before runs on."""
    ask, before = late(told)
    assert told.count("enqueue") == 1 and told.session.tally.again == 1
    assert told.jobs[0].late_rows == 2 and told.jobs[0].event_s == told.row * PERIOD_S
    told.decide()
    assert told.count("enqueue") == 2 and not told.session.tally.dropped
    told.tick()
    assert told.session.stub.accepted == before + 1
    taken = told.session.journal.last("accept")
    assert (taken["chunk_id"], taken["row"]) == (ask.invocation, 2)
    judged = [e.payload["chunk_id"] for e in told.session.journal.events() if e.kind == "candidate"]
    assert judged.count(ask.invocation) == 1
    told.end()
    assert told.checked() == set()


def test_one_that_is_refused_behind_its_row_is_not_judged_again(told):
    ask = told.tick()
    far = onward(told.task, ask)
    far[:, 1] += 0.15
    told.answer(ask, actions=far)
    told.tick()
    told.decide()
    assert told.jobs == [] and told.session.tally.again == 0
    assert told.session.journal.last("discard")["reason"] == "infeasible"


def test_where_no_row_is_left_a_late_verdict_takes_nothing_from_the_chunk_that_runs(
    kit, task, checker, standing, tmp_path
):
    told = begin(kit, task, checker, standing, tmp_path, deadline_s=5.0)
    ask = told.tick()
    told.answer(ask, actions=onward(told.task, ask))
    for _ in range(kit.HORIZONS.execution_horizon):
        told.tick()
    told.decide()
    assert told.session.tally.dropped == {"late_verdict": 1} and told.count("enqueue") == 0
    assert told.jobs == [] and told.session.journal.last("discard")["reason"] == "expired"
    told.end()
    assert told.checked() == set()


def test_an_answer_far_from_where_the_arm_stands_is_refused_and_the_arm_stays(told):
    ask = told.tick()
    stands = told.task.action_at(ask.observations[-1])
    far = onward(told.task, ask)
    far[:, 1] += 0.15
    for _ in range(3):
        told.answer(ask, actions=far)
        assert not told.decide().verdict.passed
        assert told.session.journal.last("discard")["reason"] == "infeasible"
        ask = told.tick()
        assert told.task.action_at(ask.observations[-1]).tobytes() == stands.tobytes()
    assert told.session.stub.accepted == 0 and told.count("hold") == 4
    told.answer(ask, actions=onward(told.task, ask))
    assert told.decide().verdict.passed
    told.tick()
    assert told.session.stub.accepted == 1
    told.end()
    assert told.checked() == set()


def test_behind_a_stop_that_a_person_cleared_the_arm_is_where_it_was_stopped(told):
    ask = told.tick()
    told.answer(ask, actions=onward(told.task, ask))
    told.decide()
    told.tick()
    told.tick()
    last = accepted(told)[-1]
    told.session.obey(Operator(Order.EMERGENCY_STOP, "spotter"), told.row * PERIOD_S + 0.02)
    told.tick()
    told.session.obey(Operator(Order.RESET, "spotter"), told.row * PERIOD_S + 0.02)
    ask = until_asked(told)
    assert told.task.action_at(ask.observations[-1]).tobytes() == last.tobytes()
    told.answer(ask, actions=onward(told.task, ask))
    told.decide()
    told.tick()
    assert told.session.stub.accepted == 3
    told.end()
    assert told.checked() == set()


class Rounded:
    """The task, whose action is not what is observed of the arm."""

    def __init__(self, task):
        self._task = task

    def __getattr__(self, name):
        return getattr(self._task, name)

    def action_at(self, observation):
        return np.round(self._task.action_at(observation), 12)


def test_where_the_arm_cannot_be_followed_each_ask_begins_where_it_was_recorded(
    kit, task, checker, standing, tmp_path
):
    told = begin(kit, Rounded(task), checker, standing, tmp_path)
    told.answer(told.tick())
    told.decide()
    ask = until_asked(told)
    assert told.count("reset") == 1 and told.session.executor.session_epoch == 1
    assert ask.observations.tolist() == told.session.replay.history(told.row, 2).tolist()
    told.answer(ask)
    told.decide()
    before = told.session.stub.accepted
    told.tick()
    assert told.session.stub.accepted == before + 1
    told.end()
    assert told.checked() == set()
