"""A checkpoint with its sampler as one function of arrays: every step written out.

Observation and noise in physical units and plain numbers, actions out; normalisation is part of
it, in double precision as ours is.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn

from genpolicy.contract.normalisation import SMALLEST_RANGE, MinMax
from genpolicy.errors import ConfigError
from genpolicy.policies.diffusion_samplers import DIFFUSION_SAMPLERS, sample_diffusion
from genpolicy.policies.distillation import MULTISTEP, sample_multistep
from genpolicy.policies.methods import SINGLE_EVALUATION, STOCHASTIC_SAMPLERS, noise_shape
from genpolicy.policies.ode_samplers import EQUAL_STEPS, sample_ode
from genpolicy.policies.policy import NetworkPolicy
from genpolicy.policies.samplers import NoiseFunction
from genpolicy.policies.schedules import squared_cosine

OBSERVATION, NOISE, CONDITION, ACTIONS = "observation", "noise", "condition", "actions"
READOUT = "head.direct.weight"
"""A weight that each evaluation of any of our networks uses once."""
UNROLLED = (*SINGLE_EVALUATION, *EQUAL_STEPS, *DIFFUSION_SAMPLERS, MULTISTEP)
Draw = Callable[[Tensor, NoiseFunction], Tensor]


class EncoderProgram(nn.Module):
    """From observations (H_o, D_o), physical units, to the condition (C,)."""

    def __init__(self, policy: NetworkPolicy) -> None:
        super().__init__()
        self.network = policy.checkpoint.network
        self.normalise = _Affine(policy.checkpoint.normalisation.observation, back=False)

    def forward(self, observation: Tensor) -> Tensor:
        """One condition."""
        normalised = self.normalise(observation).to(torch.float32)
        condition: Tensor = self.network.encode(normalised[None])[0]
        return condition


class SamplerProgram(nn.Module):
    """From the condition (C,) and noise to actions (K, D_a), physical units."""

    def __init__(self, policy: NetworkPolicy) -> None:
        super().__init__()
        self.network = policy.checkpoint.network
        self.denormalise = _Affine(policy.checkpoint.normalisation.action, back=True)
        self._draw = _draw_of(policy)
        shape = _noise_shape(policy)
        self.steps = _draws(self._draw, policy, shape)
        self.noise_shape = shape

    def forward(self, condition: Tensor, noise: Tensor | None = None) -> Tensor:
        """One chunk."""

        def drawn(step: int) -> Tensor:
            assert noise is not None  # a sampler that draws is exported with noise
            return noise[step][None] if self.steps > 1 else noise[None]

        normalised = self._draw(condition[None], drawn)[0]
        actions: Tensor = self.denormalise(normalised.to(torch.float64))
        return actions


class PolicyProgram(nn.Module):
    """Both, as one program."""

    def __init__(self, policy: NetworkPolicy) -> None:
        super().__init__()
        self.encoder, self.sampler = EncoderProgram(policy), SamplerProgram(policy)

    def forward(self, observation: Tensor, noise: Tensor | None = None) -> Tensor:
        """One chunk."""
        actions: Tensor = self.sampler(self.encoder(observation), noise)
        return actions


@dataclass(frozen=True)
class Exported:
    """A program to be written, with examples of what it takes.

    Attributes:
        module: The program.
        inputs: Examples by name, in the order of its arguments; sizes are fixed by them.
        output: Name of what it gives.
        counted_weight: See `hosts.kinds.ProgramEntry`; None of an encoder.
        steps: Draws of noise that one chunk takes.
    """

    module: nn.Module
    inputs: dict[str, Tensor]
    output: str
    counted_weight: str | None = None
    steps: int = 0

    def noise(self, stream: str) -> dict[str, object]:
        """What an entry says of its noise; see `hosts.kinds.Noise`."""
        whole_shape = list(self.inputs[NOISE].shape)
        shape = whole_shape[1:] if self.steps > 1 else whole_shape
        steps = {"steps": self.steps} if self.steps > 1 else {}
        return {"input": NOISE, "shape": shape, **steps, "stream": stream}


def whole(policy: NetworkPolicy) -> Exported:
    """The whole policy as one program.

    Raises:
        ConfigError: A sampler that cannot be written out.
    """
    module = PolicyProgram(policy)
    module.eval()
    inputs = {OBSERVATION: _observation(policy), **_noise(module.sampler)}
    weight = f"sampler.network.{READOUT}"
    return Exported(module, inputs, ACTIONS, weight, module.sampler.steps)


def apart(policy: NetworkPolicy) -> tuple[Exported, Exported]:
    """Encoder and sampler as two programs, so that each can be timed.

    Raises:
        ConfigError: A sampler that cannot be written out.
    """
    encoder, sampler = EncoderProgram(policy), SamplerProgram(policy)
    encoder.eval(), sampler.eval()
    seen = _observation(policy)
    with torch.no_grad():
        condition = encoder(seen)
    return (
        Exported(encoder, {OBSERVATION: seen}, CONDITION),
        Exported(
            sampler,
            {CONDITION: condition, **_noise(sampler)},
            ACTIONS,
            f"network.{READOUT}",
            sampler.steps,
        ),
    )


class _Affine(nn.Module):
    """`MinMax` there or back, with its numbers as constants."""

    scale: Tensor
    middle: Tensor

    def __init__(self, statistics: MinMax, *, back: bool) -> None:
        super().__init__()
        half = (statistics.maximum - statistics.minimum) / 2.0
        constant = half * 2.0 <= SMALLEST_RANGE
        self.back = back
        scale = np.where(constant, 0.0 if back else np.inf, half)
        self.register_buffer("scale", torch.from_numpy(scale))
        self.register_buffer(
            "middle", torch.from_numpy((statistics.minimum + statistics.maximum) / 2.0)
        )

    def forward(self, values: Tensor) -> Tensor:
        """Values (..., D); a constant number becomes 0, and back its middle."""
        if self.back:
            return self.middle + values * self.scale
        return (values - self.middle) / self.scale


def _draw_of(policy: NetworkPolicy) -> Draw:
    """Normalised chunks (1, K, D_a) of a condition (1, C), by the sampler written out."""
    network, sampler, head = (
        policy.checkpoint.network,
        policy.sampler,
        policy.checkpoint.config.head,
    )
    if sampler.name not in UNROLLED:
        raise ConfigError(
            where=f"sampler of {policy.method}",
            found=f"{sampler.name!r}, whose steps depend on what it finds",
            expected=f"one whose steps can be written out ({', '.join(UNROLLED)})",
            action="Serve the checkpoint (kind trained), or sample it with one of these.",
        )

    def draw(condition: Tensor, noise: NoiseFunction) -> Tensor:
        def evaluate(values: Tensor, time: Tensor) -> Tensor:
            return network.evaluate(condition, values, time)

        if sampler.name in SINGLE_EVALUATION:
            if sampler.name == "direct":
                return network.evaluate(condition)
            drawn = sampler.name in STOCHASTIC_SAMPLERS
            return network.evaluate(
                condition, noise(0) if drawn else condition.new_zeros(1, head.latent_dim)
            )
        if sampler.name in EQUAL_STEPS:
            return sample_ode(evaluate, noise, name=sampler.name, steps=sampler.steps)
        walk = sample_multistep if sampler.name == MULTISTEP else sample_diffusion
        return walk(
            evaluate, noise, schedule=squared_cosine(head.diffusion_levels), sampler=sampler,
            prediction=head.prediction,
        )  # fmt: skip

    return draw


def _draws(draw: Draw, policy: NetworkPolicy, shape: tuple[int, ...]) -> int:
    """How many steps of noise the sampler asks for; it is run once.

    That run also fills what is computed once for all runs (frequencies, schedules) with numbers,
    before a tracer could put its own stand-ins there.
    """
    asked: set[int] = set()

    def noise(step: int) -> Tensor:
        asked.add(step)
        return torch.zeros(1, *shape)

    with torch.no_grad():
        normalised = policy.preprocess(_observation(policy).numpy()[None])
        draw(policy.checkpoint.network.encode(normalised), noise)
    return max(asked, default=-1) + 1


def _noise_shape(policy: NetworkPolicy) -> tuple[int, ...]:
    config = policy.checkpoint.config
    return noise_shape(config.dimensions, policy.sampler, config.head)


def _observation(policy: NetworkPolicy) -> Tensor:
    sizes = policy.checkpoint.config.dimensions
    return torch.zeros(sizes.observation_horizon, sizes.observation_dim, dtype=torch.float64)


def _noise(sampler: SamplerProgram) -> dict[str, Tensor]:
    if sampler.steps == 0:
        return {}
    axis = (sampler.steps,) if sampler.steps > 1 else ()
    return {NOISE: torch.zeros(*axis, *sampler.noise_shape)}
