"""The registry of methods: by name only, never by a class path from a file."""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import torch
from torch import Tensor

from genpolicy.contract.horizons import HorizonConfig
from genpolicy.errors import ConfigError
from genpolicy.policies.ahead import AheadNetwork, Conditions, Finish
from genpolicy.policies.consistency import SegmentConsistency
from genpolicy.policies.derivative_free import noise_length, search_codes
from genpolicy.policies.diffusion_samplers import DIFFUSION_SAMPLERS, sample_diffusion
from genpolicy.policies.distillation import (
    MULTISTEP,
    Distillation,
    sample_multistep,
    visited_levels,
)
from genpolicy.policies.energy import CODE_BOUND, EnergyContrast, EnergyNetwork
from genpolicy.policies.evaluations import allowed_evaluations
from genpolicy.policies.guidance import Guidance, guided
from genpolicy.policies.langevin import LANGEVIN, climb_codes
from genpolicy.policies.networks import Dimensions, HeadInput, PolicyNetwork
from genpolicy.policies.objectives import (
    ConditionalVae,
    Denoising,
    ObjectiveFactory,
    absolute_error,
    flow_matching,
    squared_error,
)
from genpolicy.policies.ode_samplers import (
    ADAPTIVE_TABLEAUS,
    CONSISTENCY,
    EQUAL_STEPS,
    ODE_SAMPLERS,
    equal_step_times,
    sample_adaptive,
    sample_ode,
)
from genpolicy.policies.offset import OffsetError, OffsetNetwork
from genpolicy.policies.predictions import PREDICTIONS
from genpolicy.policies.samplers import CountedNetwork, NoiseFunction
from genpolicy.policies.schedules import (
    Gains,
    flow_gains,
    squared_cosine,
    trailing_levels,
)
from genpolicy.policies.settings import HeadConfig, NetworkConfig, SamplerConfig
from genpolicy.policies.warm_start import WarmStart, begun

DRAWN = ("z_prior", "offset")
SINGLE_EVALUATION = ("direct", "z_zero", *DRAWN)
DERIVATIVE_FREE = "derivative_free"
ENERGY_SAMPLERS = (DERIVATIVE_FREE, LANGEVIN)
STOCHASTIC_SAMPLERS = (
    *DRAWN, CONSISTENCY, MULTISTEP, *ENERGY_SAMPLERS, *DIFFUSION_SAMPLERS, *ODE_SAMPLERS,
)  # fmt: skip


@dataclass(frozen=True)
class Method:
    """One method: what its head reads, how it is trained and which samplers fit it.

    Attributes:
        name: Its name everywhere.
        chunked: Whether it predicts K actions; False means K = H_e = 1.
        reads: Input of the head: nothing, a latent, a noisy chunk with a time, candidate codes
            to score, or a draw that moves the predicted chunk.
        objective: Makes its training objective.
        samplers: Samplers that fit; the first is the default.
        gains: Fixed gains around the network at a sampler time, for methods that read a chunk.
        weights_of: Method whose trained weights it takes over; None trains its own.
        teacher: Method whose trained policy it distils; None learns from demonstrations alone.
        one_mode: Whether it is trained on the demonstrations of one mode only.
    """

    name: str
    chunked: bool
    reads: Literal["nothing", "latent", "chunk", "codes", "offset"]
    objective: ObjectiveFactory
    samplers: tuple[str, ...]
    gains: Callable[[HeadConfig, Tensor], Gains] | None = None
    weights_of: str | None = None
    teacher: str | None = None
    one_mode: bool = False

    @property
    def rests_on(self) -> str | None:
        """Method that must be trained before it; None where there is none."""
        return self.weights_of or self.teacher

    def horizons(self, horizons: HorizonConfig) -> HorizonConfig:
        """The horizons of this method: those given, or K = H_e = 1."""
        return horizons if self.chunked else horizons.single_action()

    def build(
        self, dimensions: Dimensions, network: NetworkConfig, head: HeadConfig
    ) -> PolicyNetwork:
        """The untrained network.

        Raises:
            ConfigError: The head's budget is too small.
        """
        if self.reads == "codes":
            return EnergyNetwork(dimensions, network, head)
        if self.reads == "offset":
            return OffsetNetwork(dimensions, network)
        numbers = {
            "nothing": 0,
            "latent": head.latent_dim,
            "chunk": dimensions.chunk_numbers,
        }[self.reads]
        gains = functools.partial(self.gains, head) if self.gains is not None else None
        head_input = HeadInput(numbers=numbers, gains=gains)
        return PolicyNetwork(dimensions, network, head_input=head_input)


def _diffusion_gains(head: HeadConfig, time: Tensor) -> Gains:
    gains = PREDICTIONS[head.prediction].gains
    return gains(squared_cosine(head.diffusion_levels), time, data_std=head.conditional_std)


def _flow_gains(head: HeadConfig, time: Tensor) -> Gains:
    return flow_gains(time, data_std=head.conditional_std)


METHODS = {
    method.name: method
    for method in (
        Method("bc", False, "nothing", squared_error, ("direct",)),
        Method("chunked_bc", True, "nothing", squared_error, ("direct",)),
        # As `chunked_bc` with the other usual error: the median in place of the mean.
        Method("chunked_l1", True, "nothing", absolute_error, ("direct",)),
        # The same weights, moved by a draw of the size of their training residuals.
        Method("bc_noise", True, "offset", OffsetError, ("offset",), weights_of="chunked_bc"),
        Method("one_mode_bc", True, "nothing", squared_error, ("direct",), one_mode=True),
        Method("act", True, "latent", ConditionalVae, ("z_zero", "z_prior")),
        # The same network and objective as `act`; drawn from its prior it is a generator and
        # stands for promotion like the others.
        Method("cvae", True, "latent", ConditionalVae, ("z_prior",)),
        Method("ibc", True, "codes", EnergyContrast, ENERGY_SAMPLERS),
        Method("diffusion", True, "chunk", Denoising, DIFFUSION_SAMPLERS, _diffusion_gains),
        Method("flow", True, "chunk", flow_matching, ODE_SAMPLERS, _flow_gains),
        # The network of `flow`, trained to say where the flow leads, for one or few evaluations.
        Method("flow_policy", True, "chunk", SegmentConsistency, (CONSISTENCY,), _flow_gains),
        # The network of `diffusion`, trained to say where that one leads.
        Method(
            name="manicm",
            chunked=True,
            reads="chunk",
            objective=Distillation,
            samplers=(MULTISTEP,),
            gains=_diffusion_gains,
            teacher="diffusion",
        ),
    )
}


def method_named(name: str) -> Method:
    """The registered method of that name.

    Raises:
        ConfigError: There is none.
    """
    if name not in METHODS:
        raise ConfigError(
            where="method",
            found=repr(name),
            expected=f"one of {', '.join(METHODS)}",
            action="Choose a registered method; a class path is never loaded.",
        )
    return METHODS[name]


def check_sampler(method: Method, sampler: SamplerConfig, head: HeadConfig) -> None:
    """Refuse a sampler that does not fit the method or its training.

    Raises:
        ConfigError: Wrong kind, fewer than one step, more steps than levels of the training (or of
            the distillation's grid), several steps of a method that evaluates its network once, a
            population of a sampler that has none, fresh noise of another than DDIM, a cap that is
            missing or too low to ever finish, or jumps that do not fit the segments of the
            training.
    """
    if sampler.name not in method.samplers:
        raise ConfigError(
            where=f"sampler of {method.name}",
            found=repr(sampler.name),
            expected=f"one of {', '.join(method.samplers)}",
            action="Choose a sampler that fits the method.",
        )
    if sampler.name in DIFFUSION_SAMPLERS:
        trailing_levels(head.diffusion_levels, sampler.steps)
    if sampler.name == MULTISTEP:
        visited_levels(head.diffusion_levels, sampler.steps)
    single = sampler.name in SINGLE_EVALUATION
    if not sampler.steps >= 1 or (single and sampler.steps != 1):
        raise ConfigError(
            where=f"sampler_steps of {method.name}",
            found=str(sampler.steps),
            expected="exactly 1" if single else "at least 1",
            action="Correct the sampler's steps.",
        )
    searches = sampler.name in ENERGY_SAMPLERS
    if searches != (sampler.population > 1):
        raise ConfigError(
            where=f"sampler.population of {method.name}",
            found=str(sampler.population),
            expected="at least 2" if searches else "exactly 1",
            action="Set a population for the energy's search, and for no other sampler.",
        )
    if sampler.eta != 0.0 and sampler.name != "ddim":
        raise ConfigError(
            where=f"sampler.eta of {method.name}",
            found=str(sampler.eta),
            expected=f"0 for {sampler.name}",
            action="Only `ddim` chooses its share of fresh noise.",
        )
    if sampler.name == CONSISTENCY and sampler.steps % head.flow_segments != 0:
        raise ConfigError(
            where=f"sampler_steps of {method.name}",
            found=str(sampler.steps),
            expected=f"a multiple of the {head.flow_segments} segments of the training",
            action="A jump must not cross the end of a segment; train with other segments.",
        )
    _check_cap(method, sampler)


def _check_cap(method: Method, sampler: SamplerConfig) -> None:
    """An adaptive solver must have a cap, and no sampler one that it cannot keep."""
    least = allowed_evaluations(sampler).least
    if sampler.nfe_cap is not None and sampler.nfe_cap < least:
        raise ConfigError(
            where=f"sampler.nfe_cap of {method.name}",
            found=str(sampler.nfe_cap),
            expected=f"at least {least}",
            action="Allow as many network evaluations as the deadline has time for.",
        )


def announced_times(sampler: SamplerConfig, head: HeadConfig, skipped: int = 0) -> list[float]:
    """Times at which a sampler evaluates its network, as float32 holds them, where it knows them.

    An energy has one score whatever the time; an adaptive solver finds its times on the way, and
    one pass has none. A warm start skips some steps, and theirs.
    """
    if sampler.name in ENERGY_SAMPLERS:
        return [0.0]
    schedule, times = squared_cosine(head.diffusion_levels), torch.empty(0)
    if sampler.name in DIFFUSION_SAMPLERS:
        levels = trailing_levels(head.diffusion_levels, sampler.steps)
        times = schedule.level_time(torch.tensor(levels, dtype=torch.float32))
    elif sampler.name == MULTISTEP:
        levels = visited_levels(head.diffusion_levels, sampler.steps)
        times = schedule.level_time(torch.tensor(levels, dtype=torch.float32))
    elif sampler.name in EQUAL_STEPS:
        times = torch.tensor(equal_step_times(sampler.name, sampler.steps)).flatten()
    found: list[float] = times.tolist()
    return found[skipped * (len(found) // sampler.steps) :]


def generate(
    network: PolicyNetwork,
    conditions: Conditions,
    noise: NoiseFunction,
    *,
    sampler: SamplerConfig,
    head: HeadConfig,
    call_rows: Callable[[int], int],
    finish: Finish | None = None,
    guidance: Guidance | WarmStart | None = None,
) -> tuple[Tensor, int]:
    """Normalised chunks of conditions, and the network evaluations that they took.

    Args:
        network: Trained network of a method that fits the sampler.
        conditions: Encoded observations of B rows.
        noise: Noise of a sampler step, of `noise_shape` per row.
        sampler, head: Settings, of the sampler and of the training.
        call_rows: Rows that a network call for so many rows has, padded.
        finish: The rest of an evaluation with the network's bits; None: the network's own.
        guidance: What the chunks go on from, or start from; None: nothing.

    Returns:
        Chunks (B, K, D_a) and the counted NFE: calls of the slowest row, and backward passes.

    Raises:
        ConfigError: Guidance, or a warm start, of a sampler that has no path.
        EvaluationCapError: The sampler's cap was reached.
    """
    noise, skipped = begun(noise, guidance, sampler=sampler, head=head)
    times, climbs = announced_times(sampler, head, skipped), sampler.name == LANGEVIN
    finish = network.climb if isinstance(network, EnergyNetwork) and climbs else finish
    ahead = AheadNetwork(network, conditions, times=times, call_rows=call_rows, finish=finish)

    def once(values: Tensor, _: Tensor) -> Tensor:
        return network.evaluate(conditions.rows, *(() if sampler.name == "direct" else (values,)))

    asked = once if sampler.name in SINGLE_EVALUATION else ahead
    counted = CountedNetwork(asked, cap=sampler.nfe_cap)
    walked = guided(counted, sampler, head, guidance if isinstance(guidance, Guidance) else None)
    if sampler.name in DIFFUSION_SAMPLERS or sampler.name == MULTISTEP:
        left = {"skipped": skipped} if skipped else {}  # a jump of the distilled has none
        walk = sample_multistep if sampler.name == MULTISTEP else sample_diffusion
        schedule, said = squared_cosine(head.diffusion_levels), head.prediction
        chunks = walk(walked, noise, schedule=schedule, sampler=sampler, prediction=said, **left)
    elif sampler.name in ENERGY_SAMPLERS:
        assert isinstance(network, EnergyNetwork)
        search = climb_codes if climbs else search_codes
        codes = search(counted, noise, iterations=sampler.steps, bound=CODE_BOUND)
        chunks = network.code.decode(codes)
    elif sampler.name in ADAPTIVE_TABLEAUS:
        chunks = sample_adaptive(
            counted, noise, name=sampler.name, steps=sampler.steps, tolerance=sampler.tolerance
        )
    elif sampler.name in EQUAL_STEPS:
        chunks = sample_ode(walked, noise, name=sampler.name, steps=sampler.steps, skipped=skipped)
    else:
        latent = noise(0) if sampler.name in DRAWN else conditions.zeros(head.latent_dim)
        chunks = counted(latent, latent.new_zeros(len(latent)))
    return chunks, counted.nfe


def noise_shape(
    dimensions: Dimensions, sampler: SamplerConfig, head: HeadConfig
) -> tuple[int, ...]:
    """Shape of one row's noise per sampler step: a latent, an offset, a chunk, or codes."""
    if sampler.name in ENERGY_SAMPLERS:
        length = min(head.code_dim, dimensions.chunk_numbers)
        drawn = length if sampler.name == LANGEVIN else noise_length(length)
        return (sampler.population, drawn)
    if sampler.name == "offset":
        return (dimensions.action_dim,)
    if sampler.name in SINGLE_EVALUATION:
        return (head.latent_dim,)
    return (dimensions.prediction_horizon, dimensions.action_dim)
