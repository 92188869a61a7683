"""Which row of which queued chunk is due, and what leaves the queue."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from playing import begin, judged

from genpolicy.contract.chunk import DiscardReason
from genpolicy.evidence.shadow.rig import Rig, StandInContext, passing_verdict

R = DiscardReason


def test_a_full_queue_drops_its_oldest_chunk_and_does_not_block():
    rig = Rig(queue_capacity=1)
    rig.observe()
    rig.deliver(rig.chunk(action_start_time_s=0.2))
    assert rig.deliver(rig.chunk(action_start_time_s=0.4)) is None
    assert rig.executor.conservation().chunks.discarded == {"queue_overflow": 1}
    judged(rig)


def test_rows_are_due_in_their_half_open_window():
    """Worked by hand: start 0.10 s, period 0.05 s, so row j is due in [0.10 + 0.05 j, +0.05)."""
    due = {0.0999: None, 0.10: 0, 0.1499: 0, 0.15: 1, 0.449999: 6, 0.45: 7, 0.499: 7, 0.50: None}
    for time_s, row in due.items():
        rig = Rig()
        rig.observe()
        checked = passing_verdict(rows=(row or 0, 16))  # from the row that is due then
        assert rig.deliver(rig.chunk(action_start_time_s=0.10, verdict=checked)) is None
        command = rig.executor.tick(time_s)
        assert command.action_index == (-1 if row is None else row), time_s
        if row is not None:
            assert np.array_equal(command.action, rig.actions(1)[row])


def test_a_late_chunk_skips_the_rows_whose_time_has_passed():
    rig = Rig()
    rig.observe()
    chunk = rig.chunk(verdict=passing_verdict(rows=(3, 16)))
    rig.advance(0.15)
    assert rig.deliver(chunk) is None
    assert [c.action_index for c in rig.tick(6)] == [3, 4, 5, 6, 7, -1]
    assert rig.executor.conservation().actions.discarded["late"] == 3
    judged(rig)


def test_a_late_chunk_that_was_checked_from_its_first_row_moves_nothing():
    """Its row of now was checked behind rows that nobody executed: the way there is a jump."""
    rig = Rig()
    rig.observe()
    chunk = rig.chunk()
    rig.advance(0.15)
    assert rig.deliver(chunk) is None
    assert {c.kind for c in rig.tick(6)} == {"hold"}
    assert rig.executor.conservation().chunks.discarded == {"broken_predecessor": 1}
    assert rig.stub.arrivals == 0
    judged(rig)


def test_after_a_pause_no_row_of_the_chunk_follows():
    rig = Rig()
    begin(rig)
    rig.advance(0.05)
    assert [c.reason for c in rig.tick(2)] == ["broken_predecessor", "empty"]
    assert [c.kind for c in rig.run(3)] == ["action"] * 3  # a new one, checked from where it stands
    judged(rig)


def test_two_ticks_in_one_window_send_one_action():
    rig = Rig()
    rig.observe()
    rig.deliver(rig.chunk())
    kinds = [rig.executor.tick(t).kind for t in (0.0, 0.01, 0.049, 0.05)]
    assert kinds == ["action", "hold", "hold", "action"]


def test_a_prefetched_chunk_takes_over_at_its_start():
    rig = Rig()
    rig.observe()
    rig.deliver(rig.chunk())
    first = rig.tick(1)
    rig.observe()
    # The command that will be the last one is known: row 2 of what is queued.
    context = StandInContext(last_action=rig.actions(1)[2])
    assert rig.deliver(rig.chunk(action_start_time_s=0.15, context=context)) is None
    rest = rig.tick(4)
    assert [c.chunk_id for c in first + rest] == ["chunk-1"] * 3 + ["chunk-2"] * 2
    assert [c.action_index for c in first + rest] == [0, 1, 2, 0, 1]
    judged(rig)


def test_the_chain_continues_or_begins_anew():
    rig = Rig()
    begin(rig)
    rig.observe()
    assert rig.executor.chain_head == "chunk-1"
    assert rig.deliver(rig.chunk(predecessor_chunk_id="chunk-1")) is None
    assert rig.deliver(rig.chunk(predecessor_chunk_id="chunk-1")) is R.BROKEN_PREDECESSOR
    rig.executor.force_event(rig.now_s)
    assert rig.executor.chain_head == ""
    rig.observe()
    assert rig.deliver(rig.chunk(predecessor_chunk_id="chunk-2")) is R.BROKEN_PREDECESSOR
    assert rig.deliver(rig.chunk(predecessor_chunk_id="")) is None
    judged(rig)


def test_only_checked_rows_are_executed():
    rig = Rig()
    rig.observe()
    rig.deliver(rig.chunk(verdict=passing_verdict(rows=(1, 4))))
    assert [c.action_index for c in rig.tick(5)] == [-1, 1, 2, 3, -1]
    assert rig.executor.conservation().actions.discarded["infeasible"] == 4
    judged(rig)


@given(order=st.permutations(range(6)), ticks=st.lists(st.integers(0, 3), min_size=6, max_size=6))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_order_of_delivery_only_ever_loses_actions(order, ticks):
    """P5: whatever the order, what is executed is proved action by action."""
    rig = Rig()
    chunks = []
    for _ in range(6):
        rig.observe()
        chunks.append(rig.chunk(predecessor_chunk_id=""))
        rig.advance(0.05)
    for index, count in zip(order, ticks, strict=True):
        rig.deliver(chunks[index])
        rig.tick(count)
    judged(rig)


def test_a_chunk_that_ran_out_may_be_continued():
    rig = Rig()
    begin(rig, ticks=9)
    rig.observe()
    assert rig.executor.chain_head == "chunk-1"
    assert rig.deliver(rig.chunk(predecessor_chunk_id="chunk-1")) is None
    judged(rig)


def test_an_action_due_no_later_than_the_last_one_waits():
    rig = Rig()
    begin(rig)
    rig.tick()  # row 2, due at 0.1 s
    rig.now_ns = 120_000_000
    rig.observe()
    assert rig.deliver(rig.chunk(action_start_time_s=0.1)) is None
    assert rig.executor.tick(0.12).kind == "hold"
    # Its row 1 would be next, and nobody checked the way there from row 2 of the first chunk.
    assert rig.executor.tick(0.15).reason == "broken_predecessor"
    judged(rig)


def test_a_prefetched_chunk_that_was_checked_from_another_command_moves_nothing():
    rig = Rig()
    begin(rig, ticks=1)
    rig.observe()
    assert rig.deliver(rig.chunk(action_start_time_s=0.15)) is None  # from row 0, not row 2
    assert [c.kind for c in rig.tick(4)] == ["action"] * 2 + ["hold"] * 2
    judged(rig)


def test_what_is_due_too_soon_waits_for_its_pace():
    rig = Rig()
    rig.observe()
    rig.deliver(rig.chunk())
    kinds = [rig.executor.tick(t).kind for t in (0.04, 0.05, 0.08499, 0.085, 0.12999, 0.13)]
    assert kinds == ["action", "hold", "hold", "action", "hold", "action"]
    judged(rig)


def test_an_older_chunk_that_ends_does_not_break_the_chain_of_the_newer():
    rig = Rig()
    rig.observe()
    rig.deliver(rig.chunk(valid_until_s=0.06))
    rig.deliver(rig.chunk(action_start_time_s=0.2))
    rig.tick(3)  # the first chunk expires at 0.1 s
    assert rig.executor.chain_head == "chunk-2"
    judged(rig)
