"""The virtual clock's law, on the session that the wall clock drives."""

import numpy as np
import pytest
from arranged import CHECKPOINT, SAMPLER, request_of
from told import begin, onward

from genpolicy.execution.cell import Cell
from genpolicy.verification.checker import check_messages
from genpolicy.wall_clock.admission import judge
from genpolicy.wall_clock.messages import Answer
from genpolicy.wall_clock.session import SupervisedSession
from genpolicy.wall_clock.streamed import StreamedJournal, recovered
from genpolicy.wall_clock.virtual import run_virtually

PERIOD_S = 0.05


@pytest.fixture
def told(kit, task, checker, standing, tmp_path):
    """Events of a session of sixteen rows whose answers take so long."""

    def run(latency_s, fails=()):
        execution = kit.EXECUTION.model_copy(update={"silence_stop_s": 0.6})
        path = tmp_path / f"session_{latency_s}_{len(fails)}.mcap"
        session = SupervisedSession(
            task, Cell(kit.HORIZONS, execution), request_of(tmp_path, standing.part(0, 16)),
            StreamedJournal("m/virtual_clock/0", path), stop_stands=False,
        )  # fmt: skip

        def still(ask):
            if ask.invocation.endswith(tuple(f"/{number}" for number in fails)):
                return None
            actions = np.tile(task.action_at(ask.observations[-1]), (16, 1))
            return Answer(ask.invocation, CHECKPOINT, SAMPLER, "m", actions)

        run_virtually(
            session, sample=still, latency_s=lambda number: latency_s,
            judged=lambda job: judge(task, checker, job),
        )  # fmt: skip
        return recovered(path)

    return run


def ages(events):
    return [round(e.payload["age_ns"] / 1e9 / PERIOD_S, 9) for e in events if e.kind == "accept"]


@pytest.mark.parametrize(
    ("latency_s", "first"), [(0.001, 1), (0.05, 1), (0.051, 2), (0.1, 2), (0.149, 3), (0.15, 3)]
)
def test_an_answer_is_executed_from_the_first_tick_after_its_latency(told, latency_s, first):
    seen = ages(told(latency_s))
    assert seen[0] == min(seen) == first
    assert all(age == round(age) for age in seen)


def test_an_answer_that_is_later_than_the_deadline_is_a_miss_and_unsolicited(told):
    events = told(0.151)
    ends = [e.payload["detail"] for e in events
            if e.kind == "invocation" and e.payload["stage"] == "end"]  # fmt: skip
    assert set(ends) == {"deadline"} and ages(events) == []


def test_the_deadline_passes_after_whole_periods(told):
    """0.15 s are three periods: the next invocation begins at the third tick."""
    begun = [e.t / 1e9 for e in told(0.5)
             if e.kind == "invocation" and e.payload["stage"] == "begin"]  # fmt: skip
    assert np.diff(begun)[:2] == pytest.approx([0.15, 0.15])


def test_an_invocation_that_failed_misses_its_deadline_and_no_other(told):
    def ends(events):
        return [e.payload["detail"] for e in events
                if e.kind == "invocation" and e.payload["stage"] == "end"]  # fmt: skip

    assert "deadline" not in ends(told(0.001))
    assert ends(told(0.001, fails=[1]))[:4] == ["answered", "deadline", "answered", "answered"]


@pytest.fixture
def moving(kit, task, checker, standing, tmp_path):
    """What a policy that moves the arm was asked by the virtual clock, and its session."""
    session = begin(kit, task, checker, standing.part(0, 24), tmp_path).session
    asks = []

    def moves(ask):
        asks.append(ask)
        return Answer(ask.invocation, CHECKPOINT, SAMPLER, "m", onward(task, ask))

    run_virtually(
        session, sample=moves, latency_s=lambda number: 0.08,
        judged=lambda job: judge(task, checker, job),
    )  # fmt: skip
    return asks, session


def test_actions_are_executed_while_the_policy_answers_and_chunks_take_over_without_a_reset(moving):
    _, session = moving
    events = session.journal.events()
    flying, beside = set(), 0
    for event in events:
        if event.kind == "invocation":
            (flying.add if event.payload["stage"] == "begin" else flying.discard)(
                event.payload["id"]
            )
        beside += event.kind == "accept" and bool(flying)
    gone = [(e.payload["ended"], e.payload["reason"]) for e in events if e.kind == "discard"]
    assert [e for e in events if e.kind == "reset"] == []
    assert gone[:4] == [("executed", "superseded")] * 4
    assert beside == 5  # one row of each chunk that another takes over from, and of the last
    assert session.stub.accepted == 22  # all but the rows before the first answer
    report = check_messages(
        (e.kind, {"session": e.session, "n": e.n, "t": e.t, **e.payload}) for e in events
    )
    assert report.violations == []


def test_both_clocks_ask_about_the_same_arm(moving, kit, task, checker, standing, tmp_path):
    """By a clock whose ticks are late by another time each, answers come in between."""
    asks, session = moving
    told = begin(kit, task, checker, standing.part(0, 24), tmp_path / "other")
    seen, asked, late = [], None, np.random.default_rng(5).uniform(0.0, 0.004, 24)
    for row in range(24):
        if asked is not None and row == asked[0] + 2:
            told.answer(asked[1], at=0.03, actions=onward(task, asked[1]))
            told.decide(0.04)
        ask = told.tick(row * PERIOD_S + late[row])
        if ask is not None:
            seen, asked = [*seen, ask], (row, ask)
    assert len(seen) == len(asks) == 6
    for one, other in zip(seen, asks, strict=True):
        assert one.noise == other.noise
        assert one.observations.tobytes() == other.observations.tobytes()
    assert told.session.stub.accepted == session.stub.accepted
    told.end()
    assert told.checked() == set()
