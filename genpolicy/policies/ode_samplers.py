"""Integrating the flow from time 0 (noise) to time 1 (action): Runge-Kutta methods as tables.

A method is a tableau; one loop takes equal steps with any of them. An embedded pair holds two
orders in one tableau; their difference, candidate by candidate, decides the next step's length.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from genpolicy.errors import ConfigError
from genpolicy.policies.samplers import CountedNetwork, NetworkFunction, NoiseFunction, refuse_name

# Bounds of the next step against this one, and the share of the estimated step that is taken.
SHRINK, GROW, SAFETY = 0.2, 5.0, 0.9


@dataclass(frozen=True)
class Blend:
    """A weighted sum of slopes; weights are integers over one divisor, as tables are printed.

    Attributes:
        weights: One integer for each slope so far.
        divisor: What all of them are divided by.
    """

    weights: tuple[int, ...]
    divisor: int = 1

    def sum(self, slopes: Sequence[Tensor]) -> Tensor:
        """The sum of integer multiples, from the first slope to the last, not yet divided."""
        terms = [
            slope if weight == 1 else float(weight) * slope
            for weight, slope in zip(self.weights, slopes, strict=True)
            if weight
        ]
        total = terms[0]
        for term in terms[1:]:
            total = total + term
        return total


@dataclass(frozen=True)
class Tableau:
    """An explicit Runge-Kutta method.

    Attributes:
        nodes: Place of each slope in the step, 0 to 1 (Butcher's c).
        stages: How the point of each slope after the first is blended from those before it (a).
        result: How the step is (b).
        embedded: The same with a lower order (b hat); None where nothing is estimated.
        order: Order of the lower of the two results, or of the only one.
    """

    nodes: tuple[float, ...]
    stages: tuple[Blend, ...]
    result: Blend
    order: int
    embedded: Blend | None = None


EULER = Tableau((0.0,), (), Blend((1,)), order=1)

# Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.1.
FIXED_TABLEAUS = {
    "euler": EULER,
    "midpoint": Tableau((0.0, 0.5), (Blend((1,), 2),), Blend((0, 1)), order=2),
    "heun": Tableau((0.0, 1.0), (Blend((1,)),), Blend((1, 1), 2), order=2),
    "rk4": Tableau(
        (0.0, 0.5, 0.5, 1.0),
        (Blend((1,), 2), Blend((0, 1), 2), Blend((0, 0, 1))),
        Blend((1, 2, 2, 1), 6),
        order=4,
    ),
}

# Source: Bogacki and Shampine 1989, 3(2). Its last stage is its result, so that the last slope
# of an accepted step is the first one of the next.
ADAPTIVE_TABLEAUS = {
    "bosh3": Tableau(
        (0.0, 0.5, 0.75, 1.0),
        (Blend((1,), 2), Blend((0, 3), 4), Blend((2, 3, 4), 9)),
        Blend((2, 3, 4, 0), 9),
        order=2,
        embedded=Blend((7, 6, 8, 3), 24),
    ),
}

ODE_SAMPLERS = (*FIXED_TABLEAUS, *ADAPTIVE_TABLEAUS)

# A jump along the mean velocity of the way left in a segment is an Euler step.
CONSISTENCY = "consistency"
EQUAL_STEPS = {**FIXED_TABLEAUS, CONSISTENCY: EULER}


def sample_ode(
    velocity: NetworkFunction, noise: NoiseFunction, *, name: str, steps: int, skipped: int = 0
) -> Tensor:
    """Clean chunks by equal steps.

    Args:
        velocity: Velocity of chunks at a flow time.
        noise: Noise function; only step 0, the start, is drawn.
        name: A key of `EQUAL_STEPS`.
        steps: Equal steps from time 0 to 1.
        skipped: The first of them that are not taken: step 0 of the noise lies behind them.

    Returns:
        Normalised chunks, not clipped. Shape (B, K, D).

    Raises:
        ConfigError: Unknown sampler or fewer than one step.
    """
    if name not in EQUAL_STEPS:
        refuse_name(name, tuple(EQUAL_STEPS))
    _check_steps(steps)
    tableau = EQUAL_STEPS[name]
    x = noise(0)
    h = 1.0 / steps
    for times in equal_step_times(name, steps)[skipped:]:
        slopes: list[Tensor] = []
        for time, blend in zip(times, (None, *tableau.stages), strict=True):
            point = x if blend is None else x + h / blend.divisor * blend.sum(slopes)
            slopes.append(velocity(point, x.new_full(x.shape[:1], time)))
        x = x + h / tableau.result.divisor * tableau.result.sum(slopes)
    return x


def equal_step_times(name: str, steps: int) -> list[list[float]]:
    """Flow times at which a sampler with equal steps evaluates the velocity, step by step."""
    h, nodes = 1.0 / steps, EQUAL_STEPS[name].nodes
    return [[step / steps + node * h for node in nodes] for step in range(steps)]


def sample_adaptive(
    velocity: CountedNetwork, noise: NoiseFunction, *, name: str, steps: int, tolerance: float
) -> Tensor:
    """Clean chunks by steps of each candidate's own length.

    Each row has its own time, step and error, so that its sample does not depend on its company;
    a row that has arrived keeps its chunk while the others go on. Every call, of rejected steps
    too, counts against the cap of `velocity`, which is what ends a run that does not converge.

    Args:
        velocity: Velocity of chunks at flow times; it must have a cap.
        noise: Noise function; only step 0, the start, is drawn.
        name: A key of `ADAPTIVE_TABLEAUS`.
        steps: The first step tried is 1 / steps.
        tolerance: Tolerated difference of the two orders in one step, times one plus the largest
            number of the chunk; normalised units, > 0.

    Returns:
        Normalised chunks, not clipped. Shape (B, K, D).

    Raises:
        ConfigError: Unknown sampler or fewer than one step.
        EvaluationCapError: A row has not arrived within the cap.
    """
    if name not in ADAPTIVE_TABLEAUS:
        refuse_name(name, tuple(ADAPTIVE_TABLEAUS))
    _check_steps(steps)
    assert velocity.cap is not None and tolerance > 0.0
    tableau = ADAPTIVE_TABLEAUS[name]
    x = noise(0)
    # Times and lengths are plain numbers: a power taken by a vector kernel may differ in its
    # last bit with the place of the row.
    times, lengths = [0.0] * len(x), [1.0 / steps] * len(x)
    first = velocity(x, _per_row(times, x))
    while any(time < 1.0 for time in times):
        tried = [min(length, 1.0 - time) for length, time in zip(lengths, times, strict=True)]
        h = _per_row(tried, x).reshape(-1, *[1] * (x.ndim - 1))
        slopes, reached = [first], x
        for node, blend in zip(tableau.nodes[1:], tableau.stages, strict=True):
            reached = x + h / blend.divisor * blend.sum(slopes)
            places = [time + node * own for time, own in zip(times, tried, strict=True)]
            slopes.append(velocity(reached, _per_row(places, x)))
        errors = _errors(tableau, slopes, h=h, x=x, reached=reached, tolerance=tolerance)
        moves = [time < 1.0 and error <= 1.0 for time, error in zip(times, errors, strict=True)]
        chosen = torch.tensor(moves, device=x.device).reshape(h.shape)
        x, first = torch.where(chosen, reached, x), torch.where(chosen, slopes[-1], first)
        for row, moved in enumerate(moves):
            if moved:
                # The last step is cut to what is left: it ends at 1, not at a rounded sum.
                times[row] = 1.0 if tried[row] == 1.0 - times[row] else times[row] + tried[row]
            lengths[row] = tried[row] * _factor(errors[row], tableau.order)
    return x


def _errors(
    tableau: Tableau,
    slopes: Sequence[Tensor],
    *,
    h: Tensor,
    x: Tensor,
    reached: Tensor,
    tolerance: float,
) -> list[float]:
    """Difference of the two orders over what is tolerated, one number a row; NaN is never <= 1."""
    assert tableau.embedded is not None
    lower = x + h / tableau.embedded.divisor * tableau.embedded.sum(slopes)
    difference = (reached - lower).flatten(1).abs().amax(dim=1)
    size = torch.maximum(x.abs(), reached.abs()).flatten(1).amax(dim=1)
    found: list[float] = (difference / (tolerance * (1.0 + size))).tolist()
    return found


def _factor(error: float, order: int) -> float:
    """Next step over this one."""
    if not error < float("inf"):
        return SHRINK
    if error == 0.0:
        return GROW
    estimated = math.pow(error, -1.0 / (order + 1))
    return min(GROW, max(SHRINK, SAFETY * estimated))


def _per_row(values: Sequence[float], x: Tensor) -> Tensor:
    return torch.tensor(values, dtype=x.dtype, device=x.device)


def _check_steps(steps: int) -> None:
    if not steps >= 1:
        raise ConfigError(
            where="sampler_steps",
            found=str(steps),
            expected="at least 1",
            action="Choose at least one sampler step.",
        )
