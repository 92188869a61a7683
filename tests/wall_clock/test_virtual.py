"""The virtual clock's law, on the session that the wall clock drives."""

import numpy as np
import pytest
from arranged import CHECKPOINT, SAMPLER, request_of

from genpolicy.execution.cell import Cell
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
