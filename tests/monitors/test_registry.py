"""Every monitor of the registry scores finitely, or says why it cannot."""

import math

import pytest

from genpolicy.monitors.names import CONTROLS, KINDS
from genpolicy.monitors.protocol import Unavailable
from genpolicy.monitors.registry import MONITORS


@pytest.mark.parametrize("name", MONITORS)
@pytest.mark.parametrize("method", ["flow", "chunked_bc"])
def test_a_score_or_a_reason(kit, name, method):
    monitor = MONITORS[name](kit.fit(method, others=[kit.policies(method, 1)]))
    if isinstance(monitor, Unavailable):
        assert monitor.why
        return
    assert math.isfinite(monitor.score(kit.invocation(method, candidates=2)))


def test_all_are_named_where_no_monitor_is_loaded_the_controls_last():
    assert tuple(MONITORS) == (*KINDS, *CONTROLS)
