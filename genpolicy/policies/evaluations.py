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
        per_step: In each sampler step.
        once: Besides these, however many steps there are.
    """

    per_step: int
    once: int = 0


# Reviewed by hand, never derived from the samplers: a table that followed the code would agree
# with every mistake in it.
EVALUATIONS = {
    # One pass, no solver.
    "direct": Evaluations(1),
    "z_zero": Evaluations(1),
    "z_prior": Evaluations(1),
    "offset": Evaluations(1),
    # One noise estimate a level. DPM-Solver++(2M) takes the earlier one of its two from the step
    # before, and its last step is of first order.
    "ddpm": Evaluations(1),
    "ddim": Evaluations(1),
    "dpm_2m": Evaluations(1),
    # The stages of the Runge-Kutta tableau; none of them is shared between steps.
    "euler": Evaluations(1),
    "heun": Evaluations(2),
    "rk4": Evaluations(4),
    # Every round scores its candidates, and the last ones are scored once more.
    "derivative_free": Evaluations(1, once=1),
}


def expected_evaluations(sampler: SamplerConfig) -> int:
    """Network evaluations of one invocation by the definition of its sampler.

    Raises:
        ConfigError: Nobody wrote down what this sampler costs.
    """
    cost = EVALUATIONS.get(sampler.name)
    if cost is None:
        raise ConfigError(
            where="sampler.name",
            found=repr(sampler.name),
            expected=f"one of {', '.join(EVALUATIONS)}",
            action="Write down how often the sampler must evaluate its network.",
        )
    return cost.per_step * sampler.steps + cost.once
