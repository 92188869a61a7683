"""Which readings of a clock are believed, and what a person can do about one that was wrong."""

import math
import re

import pytest
from playing import begin, checked, judged

from genpolicy.evidence.shadow.rig import Rig
from genpolicy.execution.believed import LONGEST_JUMP_NS, BelievedClock
from genpolicy.execution.nanoseconds import NEVER_NS
from genpolicy.execution.supervisor import DoubtedTimeError

HOUR_S = 3600.0


def test_time_never_goes_back_within_a_session():
    journal = BelievedClock()
    assert [journal.clock(t) for t in (1.0, 0.5, 2.0)] == [10**9, 10**9, 2 * 10**9]


def test_what_is_no_time_is_counted_and_the_last_one_holds():
    journal = BelievedClock()
    assert journal.clock(math.nan) == NEVER_NS and journal.doubt == "no_time"
    assert journal.clock(1e9) == 10**18 and journal.doubt == ""  # the first may be any
    for wrong, doubt in ((None, "no_time"), (0.5, "clock_backwards"), (1e9 + 61, "clock_ahead")):
        assert journal.clock(wrong) == 10**18 and journal.doubt == doubt
    assert journal.doubts == 4
    assert journal.clock(1e9 + 60) == 10**18 + 60 * 10**9 and journal.doubt == ""


def test_a_glitch_is_forgotten_and_a_clock_that_stays_ahead_needs_a_person():
    journal = BelievedClock()
    assert [journal.clock(t) for t in (1.0, 3600.0, 1.05)] == [10**9, 10**9, 1_050_000_000]
    assert journal.clock(3600.0) == 1_050_000_000
    assert journal.believe(3600.0) == journal.clock(3600.0) == 3600 * 10**9
    assert journal.believe(math.inf) == 3600 * 10**9 and journal.doubt == "no_time"
    assert journal.believe(5.0) == 3600 * 10**9  # nobody can go back in time


def test_what_a_person_reads_once_may_be_the_glitch():
    """The clock of the reset itself was an hour ahead, was believed, and held for an hour."""
    clock = BelievedClock()
    clock.clock(1.0)
    assert clock.believe(HOUR_S) == 10**9 and clock.doubt == "clock_ahead"
    assert clock.clock(1.05) == 1_050_000_000  # it was one
    assert clock.believe(HOUR_S) == 1_050_000_000 and clock.doubt
    assert clock.believe(HOUR_S + 61.0) == 1_050_000_000 and clock.doubt  # that is another one
    clock.clock(math.nan)
    assert clock.believe(HOUR_S + 62.0) == 3662 * 10**9 and not clock.doubt


@pytest.mark.parametrize(
    ("now_s", "said", "lost"),
    [(41.5, "58.500 s behind (believed again in 58.500 s, not before)", False),
     (39.0, "61.000 s behind (believed again in 61.000 s, not before)", True),
     (100.0, "0.000 s ahead", False), (HOUR_S, "3500.000 s ahead", False),
     (math.nan, "no time", False)],
)  # fmt: skip
def test_how_far_it_is_beside_what_was_believed(now_s, said, lost):
    clock = BelievedClock()
    clock.clock(100.0)
    assert (clock.beside(now_s), clock.is_lost(now_s)) == (said, lost)


def stands(rig):
    """What may not have moved where a reset was refused."""
    supervisor = rig.supervisor
    return supervisor.state, supervisor.stops, supervisor.resumed_ns, rig.journal.latest_ns


def test_a_reset_at_a_time_that_is_doubted_clears_nothing_and_is_on_record():
    rig = Rig()
    begin(rig)
    rig.supervisor.emergency_stop(rig.now_s)
    before = stands(rig)
    for now_s, why, told in (
        (math.nan, "no_time", "is no time"), (0.01, "clock_backwards", "is 0.090 s behind"),
        (HOUR_S, "clock_ahead", "is 3599.900 s ahead"),
    ):  # fmt: skip
        with pytest.raises(DoubtedTimeError, match=f"{told}.* reset again"):
            rig.supervisor.human_reset(now_s, "Ann")
        said = rig.journal.last("supervisor")
        assert (said["event"], said["state"]) == ("reset_refused", "emergency_stop")
        assert said["detail"].startswith(why) and said["detail"].endswith("by Ann")
        assert stands(rig) == before
    rig.supervisor.human_reset(rig.now_s, "Ann")
    assert [c.kind for c in rig.run(2, predecessor_chunk_id="")] == ["action"] * 2
    judged(rig)


def test_who_reads_the_same_twice_is_believed():
    rig = Rig()
    begin(rig)
    rig.supervisor.emergency_stop(rig.now_s)
    rig.now_ns = 3600 * 10**9  # everybody slept, and nobody asked the clock
    with pytest.raises(DoubtedTimeError, match="reset again"):
        rig.supervisor.human_reset(rig.now_s, "Ann")
    rig.supervisor.human_reset(rig.now_s + 5.0, "Ann")
    rig.now_ns += 5 * 10**9
    assert [c.kind for c in rig.run(2, predecessor_chunk_id="")] == ["action"] * 2
    judged(rig)


class AheadAtFirst(Rig):
    """Its very first reading was an hour ahead."""

    def begin(self, executor):
        self.now_ns = 3600 * 10**9
        super().begin(executor)
        self.now_ns = 0


class AheadAtTheReset(Rig):
    """Its clock was an hour ahead for a while, and a person believed it."""

    def begin(self, executor):
        super().begin(executor)
        begin(self)
        executor.tick(HOUR_S)
        self.supervisor.human_reset(HOUR_S, "Ann")


STEP_S = 0.05
"""Between the last tick before and the glitch; one that lies further ahead is not believed."""


@pytest.mark.parametrize("silence_stop_s", [None, 1.0])
@pytest.mark.parametrize("ahead_s", [0.5, 45.0, LONGEST_JUMP_NS / 1e9 - STEP_S])
def test_a_glitch_that_was_believed_holds_for_as_long_and_not_longer(ahead_s, silence_stop_s):
    """A person is told how long; until then nothing moves, and nothing seen before moves after."""
    rig = Rig(silence_stop_s=silence_stop_s)
    begin(rig)
    seen_before = rig.chunk(valid_until_s=rig.now_s + HOUR_S, predecessor_chunk_id="")
    back_ns = rig.now_ns + round(ahead_s * 1e9)
    assert rig.executor.tick(rig.now_s + ahead_s).kind != "action"
    rig.supervisor.emergency_stop(rig.now_s)
    stops = rig.supervisor.stops
    while rig.now_ns < back_ns:
        rig.observe()
        rig.deliver(rig.chunk(predecessor_chunk_id=""))
        assert rig.executor.tick(rig.now_s).kind == "stop"
        with pytest.raises(DoubtedTimeError, match="believed again in ") as refused:
            rig.supervisor.human_reset(rig.now_s, "Ann")
        told_s = float(re.search(r"again in ([\d.]+) s", str(refused.value))[1])
        assert rig.now_ns + round(told_s * 1e9) == back_ns  # the first moment, to the millisecond
        rig.now_ns += min(round(STEP_S * 1e9) if ahead_s < 1 else 5 * 10**9, back_ns - rig.now_ns)
    rig.supervisor.human_reset(rig.now_s, "Ann")
    assert rig.supervisor.stops == stops  # a doubted clock behind stops nobody again
    assert rig.deliver(seen_before) is not None
    assert [c.kind for c in rig.run(2, predecessor_chunk_id="")] == ["action"] * 2
    report = checked(rig.end())  # by the journal nobody held while it leapt: no evidence passes so
    assert [v.rule for v in report.violations] == ["settings.checks", "P2.watchdog"]


@pytest.mark.parametrize("made", [AheadAtFirst, AheadAtTheReset])
def test_a_session_that_believed_a_clock_ahead_is_ended_by_a_person_who_is_told_so(made):
    """It cannot go back in time; before, a reset seemed to clear it and it held for an hour."""
    rig = made()
    for _ in range(2):
        rig.observe()
        rig.deliver(rig.chunk())
        assert rig.tick()[0].reason == "clock_backwards"
        before = stands(rig)
        with pytest.raises(DoubtedTimeError, match=r"s behind.* end it, and begin another one"):
            rig.supervisor.human_reset(rig.now_s, "Ann")
        assert stands(rig) == before
    judged(rig)  # ends it: the journal is whole, in order and balanced
    assert rig.executor.tick(rig.now_s).reason == "ended"
    another = Rig()
    another.now_ns = rig.now_ns
    assert [c.kind for c in another.run(2)] == ["action"] * 2
    judged(another)
