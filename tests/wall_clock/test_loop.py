"""The loop of ticks on a clock that is told here: late ticks, leaps, lost journals."""

import itertools
import os
from types import SimpleNamespace

import pytest

from genpolicy.wall_clock import loop as loop_module
from genpolicy.wall_clock.asked import Tally
from genpolicy.wall_clock.channel import Inbox, Outbox, frame
from genpolicy.wall_clock.loop import SHORTEST_PERIOD, WAKES_PER_PERIOD, Loop
from genpolicy.wall_clock.messages import Operator, Order

PERIOD_S, SILENCE_S, ROWS = 0.05, 0.2, 8


class Session:
    """Remembers when it was ticked with which row."""

    def __init__(self):
        self.ticks, self.failed, self.obeyed, self.answers = [], [], [], []
        self.obeyed_s = []
        self.tally, self.ended = Tally(), False
        self.journal = SimpleNamespace(doubt="", lost="", flush=lambda: None)
        self.cell = SimpleNamespace(
            horizons=SimpleNamespace(action_period_s=PERIOD_S),
            execution=SimpleNamespace(silence_stop_s=SILENCE_S),
        )
        self.asks = None

    def tick(self, now_s, row):
        self.ticks.append((now_s, row))
        self.journal.doubt = "no_time" if now_s != now_s else ""
        if now_s > 60.0 + sum(believed for believed, _ in self.ticks[:-1][-1:]):
            self.journal.doubt = "clock_ahead"
            self.ticks[-1] = (0.0, row)
        return self.asks

    def fail(self, now_s, cause):
        self.failed.append(cause)

    def obey(self, operator, now_s):
        self.obeyed.append(operator)
        self.obeyed_s.append(now_s)
        self.ended = operator.order is Order.END

    def answer(self, answer, now_s, submit):
        self.answers.append(answer)

    def decide(self, job, result, now_s):
        raise AssertionError("nothing is judged here")


class Time:
    """A clock that goes on by what is waited for, and by what a tick costs."""

    def __init__(self, costs=()):
        self.now_s, self.costs, self.slept = 100.0, list(costs), []

    def __call__(self):
        return self.now_s

    def sleep(self, seconds):
        self.slept.append(seconds)
        self.now_s += seconds


@pytest.fixture
def arranged(monkeypatch):
    return Arranged(monkeypatch)


class Arranged:
    """A loop with pipes, whose waiting is the clock's."""

    def __init__(self, monkeypatch):
        (answers, self.answers), (operator, self.operator) = os.pipe(), os.pipe()
        self.policy, asks = os.pipe()
        self.session, self.time = Session(), Time()
        admission = SimpleNamespace(
            descriptor=os.pipe()[0], submit=lambda job: True, result=lambda: None
        )
        monkeypatch.setattr(loop_module.time, "sleep", self.time.sleep)
        monkeypatch.setattr(loop_module.select, "select", self.select)
        self.ready: list[bool] = []
        self.loop = Loop(
            self.session, rows=ROWS, answers=Inbox(answers), asks=Outbox(asks),
            operator=Inbox(operator), admission=admission, clock=self.time,
        )  # fmt: skip

    def select(self, readable, _writable, _failed, timeout_s):
        if self.ready and self.ready.pop():
            return readable, [], []
        self.time.now_s += timeout_s
        return [], [], []

    def run(self):
        self.loop.run()
        return [row for _, row in self.session.ticks]


def test_a_tick_each_period_on_the_grid(arranged):
    assert arranged.run() == list(range(ROWS))
    times = [now_s for now_s, _ in arranged.session.ticks]
    assert times == pytest.approx([row * PERIOD_S for row in range(ROWS)])
    assert (arranged.loop.ticks, arranged.loop.missed) == (ROWS, 0)


def slow_tick(arranged, which, cost_s):
    """One tick takes so long."""
    tick = arranged.session.tick

    def slow(now_s, row):
        if row == which:
            arranged.time.now_s += cost_s
        return tick(now_s, row)

    arranged.session.tick = slow


def test_a_person_is_heard_though_every_tick_is_late(arranged):
    """No time is left between ticks, and an E-stop is read before the next one all the same."""
    tick, heard = arranged.session.tick, []

    def slow(now_s, row):
        arranged.time.now_s += 1.2 * PERIOD_S
        heard.append(list(arranged.session.obeyed))
        return tick(now_s, row)

    arranged.session.tick = slow
    os.write(arranged.operator, frame(Operator(Order.EMERGENCY_STOP, "ann").encoded()))
    arranged.run()
    assert len(heard) > 2 and all(obeyed == heard[0] for obeyed in heard)
    assert [operator.order for operator in heard[0]] == [Order.EMERGENCY_STOP]


def test_a_channel_that_closes_while_every_tick_is_late_ends_the_run(arranged):
    for row in range(ROWS):
        slow_tick(arranged, row, 1.2 * PERIOD_S)
    os.close(arranged.operator)
    arranged.run()
    assert len(arranged.session.ticks) == 1
    assert arranged.session.failed == ["the operator's channel is closed"]


def test_after_a_late_tick_the_next_comes_no_sooner_than_pace_allows(arranged):
    late, select = [True], arranged.select

    def oversleep(readable, writable, failed, timeout_s):
        found = select(readable, writable, failed, timeout_s)
        if arranged.loop.ticks == 3 and late.pop():
            arranged.time.now_s += 0.6 * PERIOD_S
        return found

    loop_module.select.select = oversleep
    assert arranged.run() == list(range(ROWS))
    times = [now_s for now_s, _ in arranged.session.ticks]
    gaps = [b - a for a, b in itertools.pairwise(times)]
    assert min(gaps) == pytest.approx(SHORTEST_PERIOD * PERIOD_S)
    assert 10 * SHORTEST_PERIOD > 9


def test_rows_that_went_by_without_a_tick_are_counted(arranged):
    slow_tick(arranged, 2, 2.5 * PERIOD_S)
    rows = arranged.run()
    assert rows == [0, 1, 2, 4, 5, 6, 7]
    assert arranged.loop.missed == 1
    assert arranged.loop.ticks + arranged.loop.missed == ROWS


def test_a_leap_of_the_clock_is_no_end_of_the_replay(arranged):
    slow_tick(arranged, 2, 3600.0)
    assert arranged.run() == list(range(ROWS))


def test_a_clock_that_stands_tells_no_time_and_is_stopped_for(arranged):
    arranged.select = loop_module.select.select = lambda *_: ([], [], [])
    rows = arranged.run()
    assert rows == list(range(ROWS))
    told = [now_s for now_s, _ in arranged.session.ticks]
    assert told[0] == 0.0 and all(now_s != now_s for now_s in told[1:2])
    assert arranged.time.slept[0] == PERIOD_S  # it goes on by the system's timer


def test_no_wait_is_longer_than_a_period_whatever_the_clock_says(arranged):
    waits, select = [], arranged.select

    def waited(readable, writable, failed, timeout_s):
        waits.append(timeout_s)
        found = select(readable, writable, failed, timeout_s)
        if len(waits) == 3:
            arranged.time.now_s -= 50.0
        return found

    loop_module.select.select = waited
    arranged.run()
    assert max(waits) <= PERIOD_S


def test_silence_without_a_clock_is_an_emergency_stop_once(arranged):
    arranged.loop._clock = lambda: float("nan")
    arranged.run()
    assert arranged.session.failed == ["no clock"]
    # So many periods without a time as the silence that stops has.
    assert len(arranged.time.slept) == ROWS - 1


def test_a_clock_that_is_lost_again_stops_again(arranged):
    """A person had cleared the first stop, and nobody stopped for the second silence."""
    lost, of_time = itertools.count(), arranged.time
    arranged.loop._rows = 4 * ROWS
    arranged.loop._clock = lambda: float("nan") if next(lost) // 20 in (1, 3) else of_time()
    arranged.run()
    assert arranged.session.failed == ["no clock", "no clock"]


@pytest.mark.parametrize(("stands", "told"), [(True, False), (False, True)])
def test_a_clock_that_stands_tells_a_person_no_time(arranged, stands, told):
    """Else a reset at that moment would clear the stop that it was stopped for."""
    tick = arranged.session.tick

    def then_reset(now_s, row):
        if row == 2:
            reset = Operator(Order.RESET, "ann").encoded()
            os.write(arranged.operator, frame(reset))
        return tick(now_s, row)

    arranged.session.tick = then_reset
    if stands:
        loop_module.select.select = lambda *_: ([], [], [])
        loop_module.time.sleep = lambda _: None
    arranged.run()
    (now_s,) = arranged.session.obeyed_s
    assert (now_s == now_s) is told


def test_a_journal_that_is_lost_is_an_emergency_stop_once(arranged):
    arranged.session.journal.lost = "OSError: no space"
    arranged.run()
    assert arranged.session.failed == ["no journal: OSError: no space"]


def test_whoever_floods_is_read_so_often_and_not_more(arranged):
    arranged.ready = [True] * 10_000
    assert arranged.run() == list(range(ROWS))
    assert arranged.loop.throttled == ROWS - 1  # the first tick is not waited for
    assert 10_000 - len(arranged.ready) == WAKES_PER_PERIOD * (ROWS - 1)


def test_a_person_ends_it(arranged):
    os.write(arranged.operator, frame(Operator(Order.END).encoded()) + frame(b"{}"))
    arranged.ready = [True]
    assert arranged.run() == [0]
    assert arranged.session.tally.dropped == {"operator_malformed": 1}


def test_without_an_operator_it_stops_and_ends(arranged):
    os.close(arranged.operator)
    arranged.ready = [True]
    assert arranged.run() == [0]
    assert arranged.session.failed == ["the operator's channel is closed"]


def test_what_is_no_answer_is_counted(arranged):
    os.write(arranged.answers, frame(b"[]"))
    arranged.ready = [True]
    arranged.run()
    assert arranged.session.tally.dropped == {"malformed": 1} and not arranged.session.answers


def test_a_policy_that_is_gone_costs_an_ask_and_no_tick(arranged):
    os.close(arranged.policy)
    os.close(arranged.answers)
    arranged.session.asks = SimpleNamespace(encoded=lambda: b"ask")
    arranged.ready = [True] * 3
    assert arranged.run() == list(range(ROWS))
    assert arranged.session.tally.dropped == {"ask_not_sent": ROWS}
    assert len(arranged.loop._open()) == 2  # it is not looked at any more
