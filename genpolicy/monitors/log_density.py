"""Log-density: how little a policy's own distribution thinks of what it drew."""

from genpolicy.monitors.protocol import NO_WEIGHTS, Fit, Invocation, Unavailable
from genpolicy.policies.density import DENSITIES, log_density
from genpolicy.policies.policy import NetworkPolicy

STEPS = 4
"""Steps of fourth order: a monitor needs the order of scores, not their last nat."""


class LogDensity:
    """Minus the exact log-density of the first candidate, over normalised actions."""

    def __init__(self, policy: NetworkPolicy) -> None:
        self._policy = policy

    @classmethod
    def fitted(cls, fit: Fit) -> "LogDensity | Unavailable":
        """Nothing is learned: the density is the policy's."""
        if fit.policy is None:
            return NO_WEIGHTS
        if fit.policy.method not in DENSITIES:
            return Unavailable(f"{fit.policy.method} states no density of what it draws")
        return cls(fit.policy)

    def score(self, invocation: Invocation) -> float:
        """Nats."""
        seen, drawn = invocation.observations[None], invocation.chunks[:1]
        return -float(log_density(self._policy, seen, drawn, steps=STEPS)[0])
