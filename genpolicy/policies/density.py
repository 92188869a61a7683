"""Exact log-density of what a flow or a diffusion head draws: the likelihood of a given chunk.

Both heads carry a standard normal to chunks by an ordinary differential equation; carried back,
log p changes by the divergence of the velocity, d log p / dt = -div v, which is the exact trace of
its Jacobian here, not an estimate with random probes. Chen et al., arXiv 1806.07366, for flows;
Song et al., arXiv 2011.13456, for the equation with the marginals of a diffusion.

Units: nats per chunk, over *normalised* actions. A chunk has metres, rotations and a gripper;
over physical units each of these densities is lower by one constant, K times the sum of the
logarithms of half the ranges, the same for all chunks and methods of one dataset.
"""

import copy
import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from genpolicy.errors import ConfigError, ContractError, NonFiniteError
from genpolicy.policies.determinism import deterministic
from genpolicy.policies.networks import Dimensions, PolicyNetwork
from genpolicy.policies.ode_samplers import sample_ode
from genpolicy.policies.policy import NetworkPolicy
from genpolicy.policies.predictions import PREDICTIONS
from genpolicy.policies.samplers import NetworkFunction, NoiseFunction
from genpolicy.policies.schedules import DiffusionSchedule, squared_cosine
from genpolicy.policies.settings import HeadConfig

Array = NDArray[np.float64]

# Velocity (1, K, D) of chunks (1, K, D) at a flow time or at a noise level.
Velocity = Callable[[Tensor, float], Tensor]

STEPS = 12
"""Steps of fourth order from chunk to noise, two divergences each."""


@dataclass(frozen=True)
class Leg:
    """One step on the way to noise.

    Attributes:
        places: Flow time or noise level at its beginning, middle and end.
        rates: Rate of the equation's own variable there, per step: flow time, or the angle whose
            squared cosine is the share kept.
    """

    places: tuple[float, float, float]
    rates: tuple[float, float, float]

    def along(self, velocity: Velocity) -> NetworkFunction:
        """The velocity per step at progress 0, 1/2 and 1, as an integrator asks for it."""

        def field(x: Tensor, progress: Tensor) -> Tensor:
            node = round(2.0 * float(progress))
            return self.rates[node] * velocity(x, self.places[node])

        return field


def log_density(
    policy: NetworkPolicy, observations: Array, chunks: Array, *, steps: int = STEPS
) -> Array:
    """Log-density of chunks under a policy, each at its own observation.

    Of the flow it is the density of the exact flow, not that of a few solver steps. Of the
    diffusion it is that of the probability-flow equation, without the sampler's bound of the clean
    estimate, at the least noise level of the training: chunks blurred by that noise (0.025 in
    normalised units at 100 levels), since nothing was trained below it.

    The error falls with the fourth power of the step on a mixture's own field. Of trained heads
    with fast time features less is left to say: on demonstrated chunks of about 100 nats (small
    ladder) 12 and 24 steps differ by at most 0.35 nats, 24 and 48 by 0.6 (flow) and 0.1.

    Every chunk is computed alone, in float64 and on one CPU thread: its bits depend on neither
    batch nor order.

    Args:
        policy: A `flow` or a `diffusion`; its sampler is not used.
        observations: Physical units, newest last. Shape (B, H_o, D_o).
        chunks: Physical units. Shape (B, K, D_a).
        steps: Steps of fourth order; a diffusion takes at most one for every two levels.

    Returns:
        Nats over normalised actions. Shape (B,).

    Raises:
        ConfigError: Another method: what it draws has no density, or none that its head states.
            Or fewer than one step.
        ContractError: Wrong shapes.
        NonFiniteError: NaN or infinity in the input, or in the result.
    """
    config = policy.checkpoint.config
    if policy.method not in DENSITIES:
        raise ConfigError(
            where="log-density",
            found=f"method {policy.method!r}",
            expected=f"one of {', '.join(DENSITIES)}",
            action="Compare the other methods by their samples; no surrogate is merged with this.",
        )
    _check_chunks(chunks, len(observations), config.dimensions)
    seen = policy.preprocess(observations).cpu().double()
    clean = torch.from_numpy(policy.checkpoint.normalisation.action.normalise(chunks))
    network = copy.deepcopy(policy.checkpoint.network).to("cpu", torch.float64)
    density = DENSITIES[policy.method]
    with deterministic("cpu"):
        found = [
            density(_conditioned(network, seen[row : row + 1]), clean[row], config.head, steps)
            for row in range(len(clean))
        ]
    result = np.array(found, dtype=np.float64)
    _require_finite(result, f"log-densities of {policy.method}")
    return result


def flow_log_density(velocity: NetworkFunction, clean: Tensor, *, steps: int) -> float:
    """Log-density of one chunk under a flow from the standard normal, at flow time 1.

    Args:
        velocity: Velocity of chunks (1, K, D) at flow times (1,).
        clean: Normalised, float64. Shape (K, D).
        steps: Equal steps of fourth order.

    Raises:
        ConfigError: Fewer than one step.
    """
    _check_steps(steps)
    grid = [1.0 - half / (2 * steps) for half in range(2 * steps + 1)]
    legs = [
        Leg((grid[2 * step], grid[2 * step + 1], grid[2 * step + 2]), (-1.0 / steps,) * 3)
        for step in range(steps)
    ]
    return _log_density(lambda x, time: velocity(x, x.new_tensor([time])), clean, legs)


def diffusion_log_density(
    network: NetworkFunction,
    clean: Tensor,
    *,
    schedule: DiffusionSchedule,
    prediction: str,
    steps: int,
) -> float:
    """Log-density of one chunk, blurred by level 0, under the probability flow of a diffusion.

    With kept = cos^2(angle) the equation is dx / d angle = v, v = cos noise - sin clean, which is
    stiff at neither end. The network knows whole levels only (between them the fastest time
    feature turns by more than it saw), so every node of a step is a level.

    Args:
        network: Its prediction of chunks (1, K, D) at times level / T (1,).
        clean: Normalised, float64. Shape (K, D).
        schedule: Levels of the training, at least 3.
        prediction: What the network predicts, a key of `PREDICTIONS`.
        steps: Steps of fourth order, at most one for two levels.

    Raises:
        ConfigError: Fewer than one step, or fewer than three levels.
    """
    _check_steps(steps)
    angles = np.arctan2(np.sqrt(1.0 - schedule.alpha_bar), np.sqrt(schedule.alpha_bar))
    legs = [_leg(levels, angles) for levels in _levels(schedule.levels, steps)]

    def velocity(x: Tensor, level: float) -> Tensor:
        kept = float(schedule.alpha_bar[round(level)])
        predicted = network(x, schedule.level_time(x.new_tensor([level])))
        estimate = PREDICTIONS[prediction].clean(x, predicted, kept)
        noise = (x - math.sqrt(kept) * estimate) / math.sqrt(1.0 - kept)
        return math.sqrt(kept) * noise - math.sqrt(1.0 - kept) * estimate

    scale = math.sqrt(schedule.alpha_bar[0])
    return _log_density(velocity, scale * clean, legs) + clean.numel() * math.log(scale)


def divergence(velocity: Velocity, x: Tensor, place: float) -> tuple[Tensor, float]:
    """A velocity and its divergence at one point, the exact trace of its Jacobian.

    Args:
        velocity: Of chunks (1, K, D) at a place, of differentiable operations.
        x: Shape (1, K, D).
        place: Flow time or noise level.

    Returns:
        The velocity (1, K, D), and the divergence.
    """

    def twice(values: Tensor) -> tuple[Tensor, Tensor]:
        found = velocity(values, place)
        return found, found

    # All of it by reverse mode: two thirds of the time of forward mode for these networks.
    jacobian, value = torch.func.jacrev(twice, has_aux=True)(x)
    return value, float(jacobian.reshape(x.numel(), x.numel()).trace())


def _log_density(velocity: Velocity, start: Tensor, legs: list[Leg]) -> float:
    """Log-density at `start` (K, D), whose way along the legs ends in the standard normal.

    The way is taken by the classic method of fourth order; the divergence is integrated along it
    by Simpson's rule, its middle point by the cubic through both ends and their slopes. That is
    of fourth order too, with two divergences a step in place of four.
    """
    x, gained = start[None], 0.0
    slope, trace = divergence(velocity, x, legs[0].places[0])
    for leg in legs:
        end = sample_ode(leg.along(velocity), _always(x), name="rk4", steps=1)
        slope_there, trace_there = divergence(velocity, end, leg.places[2])
        bend = leg.rates[0] * slope - leg.rates[2] * slope_there
        between = divergence(velocity, (x + end) / 2.0 + bend / 8.0, leg.places[1])[1]
        gained += leg.rates[0] * trace + 4.0 * leg.rates[1] * between + leg.rates[2] * trace_there
        x, slope, trace = end, slope_there, trace_there
    normal = -0.5 * (float(x.square().sum()) + x.numel() * math.log(2.0 * math.pi))
    return normal + gained / 6.0


def _levels(count: int, steps: int) -> list[tuple[int, int, int]]:
    """First, middle and last level of every step, from the least noise to the most."""
    if not count >= 3:
        raise ConfigError(
            where="head.diffusion_levels",
            found=str(count),
            expected="at least 3 for a log-density",
            action="Train with more noise levels.",
        )
    pairs = (count - 1) // 2
    ends = (2 * np.linspace(0, pairs, min(steps, pairs) + 1).round()).astype(np.int64).tolist()
    ends[-1] = count - 1
    return [(first, (first + last) // 2, last) for first, last in itertools.pairwise(ends)]


def _leg(levels: tuple[int, int, int], angles: Array) -> Leg:
    """A step over three levels: the angle runs along the parabola through theirs."""
    start, middle, end = (float(angles[level]) for level in levels)
    rates = (4.0 * middle - 3.0 * start - end, end - start, start - 4.0 * middle + 3.0 * end)
    return Leg((float(levels[0]), float(levels[1]), float(levels[2])), rates)


def _always(x: Tensor) -> NoiseFunction:
    return lambda _: x


def _conditioned(network: PolicyNetwork, observation: Tensor) -> NetworkFunction:
    """The network at one normalised observation (1, H_o, D_o)."""
    condition = network.encode(observation).detach()
    return lambda x, time: network.evaluate(condition, x, time)


def _of_flow(network: NetworkFunction, clean: Tensor, head: HeadConfig, steps: int) -> float:
    return flow_log_density(network, clean, steps=steps)


def _of_diffusion(network: NetworkFunction, clean: Tensor, head: HeadConfig, steps: int) -> float:
    return diffusion_log_density(
        network,
        clean,
        schedule=squared_cosine(head.diffusion_levels),
        prediction=head.prediction,
        steps=steps,
    )


DENSITIES: dict[str, Callable[[NetworkFunction, Tensor, HeadConfig, int], float]] = {
    "flow": _of_flow,
    "diffusion": _of_diffusion,
}
"""Methods whose draws have a density that their head states, and how it is computed."""


def _check_chunks(chunks: Array, count: int, sizes: Dimensions) -> None:
    expected = (count, sizes.prediction_horizon, sizes.action_dim)
    if chunks.shape != expected:
        raise ContractError(
            where="chunks of a log-density",
            found=f"of shape {chunks.shape}",
            expected=f"{expected}, one chunk per observation",
            action="Deliver whole chunks in the units of the action contract.",
        )
    _require_finite(chunks, "chunks of a log-density")


def _check_steps(steps: int) -> None:
    if not steps >= 1:
        raise ConfigError(
            where="steps of a log-density",
            found=str(steps),
            expected="at least 1",
            action="Choose at least one step.",
        )


def _require_finite(values: Array, where: str) -> None:
    if not np.isfinite(values).all():
        place = np.argwhere(~np.isfinite(values))[0].tolist()
        raise NonFiniteError(
            where=f"{where}, {place}",
            found=str(values[tuple(place)]),
            expected="a finite number",
            action="Leave the chunk out; do not clip or fill it.",
        )
