"""Times in whole nanoseconds: no row is lost to a rounded float."""

import math
from decimal import Decimal

import numpy as np
import pytest

from genpolicy.errors import NonFiniteError
from genpolicy.evidence.shadow.rig import Rig
from genpolicy.execution.nanoseconds import NEVER_NS, ns_or_none, to_ns


def test_float_ticks_hit_every_row_exactly_once():
    rig = Rig()
    rows = []
    for n in range(8 * 300):
        now_s = n * 0.05  # not a multiple of 0.05 for most n
        if n % 8 == 0:
            rig.now_ns = to_ns(now_s)
            rig.executor.observe(now_s, now_s, "approach", "epoch-1", tcp_m=rig.tcp_m)
            assert rig.executor.deliver(rig.chunk(
                action_start_time_s=now_s, condition_observation_event_time_s=now_s,
            ), now_s) is None  # fmt: skip
        rows.append(rig.executor.tick(now_s).action_index)
    assert rows == list(range(8)) * 300
    assert rig.executor.conservation().actions.discarded == {"beyond_execution_horizon": 8 * 300}


NO_TIMES = (
    math.nan, math.inf, -math.inf, 1e300, -1e300, 10**400, -NEVER_NS / 1e9, None, "1.0", b"1", True,
    1j, [1.0], object(), Decimal(1),
)  # fmt: skip


@pytest.mark.parametrize("value", NO_TIMES, ids=lambda value: repr(value)[:12])
def test_what_is_no_time_is_none_and_refused_by_name(value):
    assert ns_or_none(value) is None
    with pytest.raises(NonFiniteError, match=r"a time is .*, expected finite, s"):
        to_ns(value)


def test_times_of_any_number_type():
    for value in (1.5, np.float64(1.5), np.float32(1.5)):
        assert ns_or_none(value) == to_ns(value) == 1_500_000_000
    assert to_ns(2) == to_ns(np.int64(2)) == 2_000_000_000
    assert ns_or_none(-1e-9) == -1
