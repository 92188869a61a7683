"""Times in whole nanoseconds: no row is lost to a rounded float."""

from genpolicy.evidence.shadow.rig import Rig
from genpolicy.execution.nanoseconds import to_ns


def test_float_ticks_hit_every_row_exactly_once():
    rig = Rig()
    rows = []
    for n in range(8 * 300):
        now_s = n * 0.05  # not a multiple of 0.05 for most n
        if n % 8 == 0:
            rig.now_ns = to_ns(now_s)
            rig.executor.observe(now_s, now_s, "approach", "epoch-1")
            assert rig.executor.deliver(rig.chunk(
                action_start_time_s=now_s, condition_observation_event_time_s=now_s,
            ), now_s) is None  # fmt: skip
        rows.append(rig.executor.tick(now_s).action_index)
    assert rows == list(range(8)) * 300
    assert rig.executor.conservation().actions.discarded == {"beyond_execution_horizon": 8 * 300}
