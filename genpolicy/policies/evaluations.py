"""How often a sampler must evaluate its network: the definitions, apart from the samplers' code.

A count at the network says what was done; this says what the method is. Where the two differ, a
solver evaluates more or less often than the method that it is named after.
"""

from dataclasses import dataclass

from genpolicy.errors import ConfigError
from genpolicy.policies.settings import SamplerConfig


@dataclass(frozen=True)
class Evaluations:
    """Network evaluations of one sample.

    Attributes:
        per_step: In each sampler step, of an adaptive solver in each step that it tries.
        once: Besides these, however many steps there are.
        growth: Largest ratio of two steps that follow each other, where the solver chooses their
            lengths; None where they are equal.
    """

    per_step: int
    once: int = 0
    growth: int | None = None


@dataclass(frozen=True)
class AllowedEvaluations:
    """Counts that the definition of a sampler allows; a single one unless it is adaptive.

    Attributes:
        least: The smallest.
        most: The largest; of an adaptive solver, within its cap.
        stride: Difference of two that follow each other.
    """

    least: int
    most: int
    stride: int

    def nearest(self, counted: int) -> int:
        """The allowed count that is nearest to a counted one."""
        inside = min(max(counted, self.least), self.most)
        return self.least + round((inside - self.least) / self.stride) * self.stride


# Reviewed by hand, never derived from the samplers: a table that followed the code would agree
# with every mistake in it.
EVALUATIONS = {
    # One pass, no solver.
    "direct": Evaluations(1),
    "z_zero": Evaluations(1),
    "z_prior": Evaluations(1),
    "offset": Evaluations(1),
    # One prediction a level. DPM-Solver++(2M) takes the earlier one of its two from the step
    # before, and its last step is of first order.
    "ddpm": Evaluations(1),
    "ddim": Evaluations(1),
    "dpm_1": Evaluations(1),
    "dpm_2m": Evaluations(1),
    "dpm_sde": Evaluations(1),
    # The stages of the Runge-Kutta tableau; none of them is shared between steps.
    "euler": Evaluations(1),
    "heun": Evaluations(2),
    "midpoint": Evaluations(2),
    "rk4": Evaluations(4),
    # One jump from its place in a segment.
    "consistency": Evaluations(1),
    # One jump from a noise level to the clean end; between jumps only noise is added.
    "multistep_consistency": Evaluations(1),
    # Three slopes a tried step, accepted or not: the first one is the last of the step before,
    # or, after a rejected step, the same again. A step is at most five times the one before.
    "bosh3": Evaluations(3, once=1, growth=5),
    # Every round scores its candidates, and the last ones are scored once more.
    "derivative_free": Evaluations(1, once=1),
    # Every move asks for slopes, which come with the scores; the last candidates are scored once.
    "langevin": Evaluations(1, once=1),
}


def allowed_evaluations(sampler: SamplerConfig) -> AllowedEvaluations:
    """Network evaluations that one invocation may take by the definition of its sampler.

    Raises:
        ConfigError: Nobody wrote down what this sampler costs, or an adaptive one has no cap.
    """
    cost = EVALUATIONS.get(sampler.name)
    if cost is None:
        raise ConfigError(
            where="sampler.name",
            found=repr(sampler.name),
            expected=f"one of {', '.join(EVALUATIONS)}",
            action="Write down how often the sampler must evaluate its network.",
        )
    if cost.growth is None:
        count = cost.per_step * sampler.steps + cost.once
        return AllowedEvaluations(count, count, cost.per_step)
    if sampler.nfe_cap is None:
        raise ConfigError(
            where="sampler.nfe_cap",
            found="None",
            expected=f"a number, for {sampler.name} chooses its steps by itself",
            action="Allow as many network evaluations as the deadline has time for.",
        )
    # No fewer than where every step, from 1 / steps on, is accepted and followed by the longest.
    tried, way, step = 0, 0, 1
    while way < sampler.steps:
        tried, way, step = tried + 1, way + step, step * cost.growth
    within = (sampler.nfe_cap - cost.once) // cost.per_step
    return AllowedEvaluations(
        least=cost.once + cost.per_step * tried,
        most=cost.once + cost.per_step * within,
        stride=cost.per_step,
    )
