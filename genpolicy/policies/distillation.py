"""Consistency distillation: where a trained diffusion leads from a noise level, in one evaluation.

The probability flow of a diffusion joins every noisy chunk to one clean chunk. A trained diffusion
walks there in many steps; here a copy of it learns to say the end at once, by agreeing with what
it says itself one step of the teacher further on. At the clean end it says nothing: the chunk there
is the answer, which is what fixes all the others.
"""

import copy
import math

import torch
from torch import Tensor

from genpolicy.policies.networks import Dimensions, PolicyNetwork
from genpolicy.policies.objectives import Batch, Objective, masked_mean, normal_like
from genpolicy.policies.predictions import PREDICTIONS, Share, root
from genpolicy.policies.samplers import NetworkFunction, NoiseFunction
from genpolicy.policies.schedules import DiffusionSchedule, squared_cosine, trailing_levels
from genpolicy.policies.settings import HeadConfig, NetworkConfig, SamplerConfig

MULTISTEP = "multistep_consistency"

# Levels that the teacher's steps join, the clean end besides. More of them make each step of the
# teacher more exact and pass what is known at the clean end back more slowly. ManiCM: 10 of 100.
GRID_STEPS = 10
# Share of the old target kept after an update. The usual averaging of the weights remembers
# hundreds of updates, and what is known at one level reaches the next only through the target.
TARGET_DECAY = 0.95
# Assumed spread of clean chunks, and levels to units of time, in the gains that make the function
# the identity at the clean end and leave it to the network everywhere else.
DATA_STD = 0.5
TIME_PER_LEVEL = 10.0
# Bound of the teacher's clean estimate, as of the sampler that it is used with: normalised
# actions lie within, and where nearly all is noise the estimate is poor.
TEACHER_CLIP = 1.0
CLEAN = -1
# Network evaluations of a window in an update, and those of them with a gradient: the student's
# has one, the teacher's and the target's have none.
EVALUATIONS_PER_WINDOW = 3
GRADIENTS_PER_WINDOW = 1


def grid_levels(levels: int) -> list[int]:
    """Levels of the grid from T - 1 downwards, and `CLEAN`.

    Raises:
        ConfigError: Fewer levels in the training than in the grid.
    """
    return [*trailing_levels(levels, GRID_STEPS), CLEAN]


def visited_levels(levels: int, steps: int) -> list[int]:
    """Levels of the grid that a sampler of so many steps visits, from T - 1 downwards.

    Raises:
        ConfigError: Fewer than one step, or more steps than the grid has.
    """
    grid = grid_levels(levels)
    return [grid[GRID_STEPS - 1 - place] for place in trailing_levels(GRID_STEPS, steps)]


def kept_at(schedule: DiffusionSchedule, level: Tensor, *, dtype: torch.dtype) -> Tensor:
    """Share of the clean variance left at levels (B,); 1 at `CLEAN`. Shape (B, 1, 1)."""
    # `CLEAN` reads the last place of the table, behind all levels.
    table = torch.tensor([*schedule.alpha_bar, 1.0], dtype=dtype, device=level.device)
    return table[level][:, None, None]


def boundary_gains(level: Tensor, *, dtype: torch.dtype) -> tuple[Tensor, Tensor]:
    """Shares of the noisy chunk and of the clean estimate in the function; 1 and 0 at `CLEAN`.

    Args:
        level: Levels. Shape (B,).
        dtype: Type of the result.

    Returns:
        c_skip and c_out. Shapes (B, 1, 1).

    Source:
        Luo et al., arXiv 2310.04378, with the time of ManiCM; here it counts from the clean end,
        where theirs counts from the lowest level.
    """
    time = TIME_PER_LEVEL * (level - CLEAN).to(dtype)[:, None, None]
    variance = time.square() + DATA_STD**2
    return DATA_STD**2 / variance, time / variance.sqrt()


def ddim_step(x: Tensor, clean: Tensor, *, now: Share, after: Share) -> Tensor:
    """Noisy chunks one deterministic step further, by a clean estimate.

    The noise is what the clean estimate leaves of the chunk, whatever the network predicts.

    Args:
        x: Noisy chunks. Shape (B, K, D).
        clean: Estimates of the clean ones, likewise.
        now: Share of the clean variance left, < 1; one number or (B, 1, 1).
        after: The same behind the step; 1 gives the estimate itself.

    Source:
        Song et al., arXiv 2010.02502, with eta = 0.
    """
    rest = (x - root(now, x.dtype) * clean) / root(1.0 - now, x.dtype)
    return root(after, x.dtype) * clean + root(1.0 - after, x.dtype) * rest


def clean_end(
    network: NetworkFunction,
    x: Tensor,
    level: Tensor,
    *,
    schedule: DiffusionSchedule,
    prediction: str,
) -> Tensor:
    """The consistency function: the clean chunks that noisy ones lead to.

    Args:
        network: Its prediction of chunks at time level / T.
        x: Noisy chunks. Shape (B, K, D).
        level: Level of each; at `CLEAN` the chunk itself is the result. Shape (B,).
        schedule: Levels of the training.
        prediction: What the network predicts, a key of `PREDICTIONS`.

    Returns:
        Normalised chunks. Shape (B, K, D).
    """
    time = schedule.level_time(level.clamp(min=0).to(x.dtype))
    kept = kept_at(schedule, level, dtype=x.dtype)
    skip, outer = boundary_gains(level, dtype=x.dtype)
    return skip * x + outer * PREDICTIONS[prediction].clean(x, network(x, time), kept)


def sample_multistep(
    network: NetworkFunction,
    noise: NoiseFunction,
    *,
    schedule: DiffusionSchedule,
    sampler: SamplerConfig,
    prediction: str,
) -> Tensor:
    """Clean chunks by jumps to the clean end, with fresh noise up to the next level between them.

    Args:
        network: Distilled network: its prediction of chunks at time level / T.
        noise: Noise of each sampler step, one draw a step.
        schedule: Levels of the training.
        sampler: Steps, and `clip`: bound of every end.
        prediction: What the network predicts, a key of `PREDICTIONS`.

    Returns:
        Normalised chunks. Shape (B, K, D).

    Raises:
        ConfigError: Fewer than one step, or more steps than the grid has.

    Source:
        Song et al., arXiv 2303.01469, algorithm 1.
    """
    x = noise(0)
    for step, level in enumerate(visited_levels(schedule.levels, sampler.steps)):
        if step > 0:
            kept = float(schedule.alpha_bar[level])
            x = math.sqrt(kept) * x + math.sqrt(1.0 - kept) * noise(step)
        levels = torch.full(x.shape[:1], level, device=x.device)
        x = clean_end(network, x, levels, schedule=schedule, prediction=prediction)
        if sampler.clip is not None:
            x = x.clamp(-sampler.clip, sampler.clip)
    return x


class Distillation(Objective):
    """A noisy chunk, and where one step of the teacher takes it, must lead to the same clean one.

    The student starts from the teacher's weights. Its target is itself, averaged over the last
    updates, behind the teacher's step; behind the lowest level that step ends at the clean chunk,
    and the target is what the teacher says. Neither has a gradient.

    Source:
        Lu et al., arXiv 2406.01586 (ManiCM), on Luo et al., arXiv 2310.04378. Their program gives
        the teacher's clean estimate to a step that asks for its noise; here the noise is computed
        from it.
    """

    def __init__(self, dimensions: Dimensions, network: NetworkConfig, head: HeadConfig) -> None:
        super().__init__()
        self._schedule = squared_cosine(head.diffusion_levels)
        self._prediction = head.prediction
        self._grid = grid_levels(head.diffusion_levels)
        self.teacher: PolicyNetwork | None = None
        self.target: PolicyNetwork | None = None

    def learn_from(self, teacher: PolicyNetwork, network: PolicyNetwork) -> None:
        """Freeze the teacher, and start from its weights."""
        network.load_state_dict(teacher.state_dict())
        self.teacher = teacher.requires_grad_(False)
        self.target = copy.deepcopy(network).requires_grad_(False)

    def updated(self, network: PolicyNetwork) -> None:
        """Move the target towards the student, after each update."""
        assert self.target is not None
        kept: list[Tensor] = list(self.target.parameters())
        current: list[Tensor] = list(network.parameters())
        torch._foreach_lerp_(kept, current, 1.0 - TARGET_DECAY)

    def loss(self, network: PolicyNetwork, batch: Batch, generator: torch.Generator) -> Tensor:
        """Masked mean squared difference of the two clean chunks."""
        assert self.target is not None
        grid = torch.tensor(self._grid, device=batch.actions.device)
        rows = (len(batch.actions),)
        place = torch.randint(GRID_STEPS, rows, generator=generator, device=grid.device)
        level, after = grid[place], grid[place + 1]
        noise = normal_like(batch.actions, generator)
        x = self._schedule.add_noise(batch.actions, noise, level)
        found = self._end(network, batch.observations, x, level)
        with torch.no_grad():
            further = self.teacher_step(batch.observations, x, level=level, after=after)
            target = self._end(self.target, batch.observations, further, after)
        return masked_mean((found - target).square(), batch.weight)

    def teacher_step(
        self, observations: Tensor, x: Tensor, *, level: Tensor, after: Tensor
    ) -> Tensor:
        """Where the teacher takes noisy chunks (B, K, D) between levels (B,); no gradient."""
        assert self.teacher is not None
        time = self._schedule.level_time(level.to(x.dtype))
        now = kept_at(self._schedule, level, dtype=x.dtype)
        with torch.no_grad():
            said = self.teacher.evaluate(self.teacher.encode(observations), x, time)
        clean = PREDICTIONS[self._prediction].clean(x, said, now).clamp(-TEACHER_CLIP, TEACHER_CLIP)
        return ddim_step(x, clean, now=now, after=kept_at(self._schedule, after, dtype=x.dtype))

    def _end(
        self, network: PolicyNetwork, observations: Tensor, x: Tensor, level: Tensor
    ) -> Tensor:
        condition = network.encode(observations)

        def evaluate(values: Tensor, time: Tensor) -> Tensor:
            return network.evaluate(condition, values, time)

        return clean_end(evaluate, x, level, schedule=self._schedule, prediction=self._prediction)
