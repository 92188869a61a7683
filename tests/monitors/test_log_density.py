"""Log-density: the order of scores is that of the exact density."""

import numpy as np

from genpolicy.monitors.log_density import LogDensity
from genpolicy.monitors.protocol import NO_WEIGHTS, Invocation, Unavailable
from genpolicy.policies.density import log_density


def test_score_is_minus_the_log_density(kit):
    monitor = LogDensity.fitted(kit.fit("flow"))
    own = kit.invocation()
    middle = Invocation(own.time_s, own.observations, np.zeros_like(own.chunks))
    exact = -log_density(kit.policies("flow"), own.observations[None], own.chunks[:1])[0]
    assert abs(monitor.score(own) - exact) < 3.0  # nats; coarser steps
    assert monitor.score(middle) > monitor.score(own)


def test_who_states_no_density_has_none(kit):
    found = LogDensity.fitted(kit.fit("chunked_bc"))
    assert isinstance(found, Unavailable)
    assert "no density" in found.why
    assert LogDensity.fitted(kit.fit()) is NO_WEIGHTS
