"""Several seeds in one update: their weights stacked, a batched product for each layer.

A prototype, for the networks that `params.yaml` has by default (an encoder of two layers, the MLP
trunk). Each seed keeps its own initial weights, batches, noise and gradient norm, so that stacked
and alone it is the same training, but for the order in which sums are rounded.
"""

from collections.abc import Sequence
from typing import Literal

import torch
from torch import Tensor, nn
from torch.func import functional_call, stack_module_state, vmap
from torch.nn import functional

from benchmarks.training.steps import Start
from genpolicy.policies.networks import PolicyNetwork, _frequencies
from genpolicy.policies.objectives import masked_mean
from genpolicy.policies.schedules import squared_cosine, straight_path
from genpolicy.policies.training import averaging_decay, learning_rate

Drawn = tuple[Tensor | None, Tensor | None, Tensor]
Way = Literal["vmap", "bmm"]
SMALL = 1e-6
"""What `clip_grad_norm_` adds to a norm."""


def stack(own: Sequence[Tensor | None]) -> Tensor | None:
    """What all seeds have, or what none has."""
    there = [part for part in own if part is not None]
    return torch.stack(there) if there else None


class Evaluation(nn.Module):
    """A network from observations to chunks in one call, which is what `vmap` maps."""

    def __init__(self, network: PolicyNetwork) -> None:
        super().__init__()
        self.network = network

    def forward(self, observations: Tensor, values: Tensor | None, time: Tensor | None) -> Tensor:
        return self.network.evaluate(self.network.encode(observations), values, time)


class Stacked:
    """Trainings of one method that differ in their seed.

    Args:
        starts: One for each seed.
        way: `vmap` over the network as it is, or the same forward pass written with `bmm`.
    """

    def __init__(self, starts: Sequence[Start], way: Way) -> None:
        self.starts, self.config = starts, starts[0].request.training
        self.say = self._mapped if way == "vmap" else self._multiplied
        self.one = Evaluation(starts[0].network)
        self.weights, _ = stack_module_state([Evaluation(start.network) for start in starts])
        self.current = list(self.weights.values())
        self.average = [weight.detach().clone() for weight in self.current]
        self.optimiser = torch.optim.AdamW(
            self.current, lr=self.config.learning_rate,
            betas=(self.config.beta_1, self.config.beta_2), weight_decay=self.config.weight_decay,
        )  # fmt: skip
        self.orders = [start.order() for start in starts]
        self.generators = [start.generator() for start in starts]
        self.schedule = squared_cosine(starts[0].request.head.diffusion_levels)
        self.done = 0

    def drawn(self, actions: Tensor, generator: torch.Generator) -> Drawn:
        """Noisy chunks, their times and the target of one seed, as its objective draws them."""
        method = self.starts[0].request.method
        if method == "chunked_bc":
            return None, None, actions
        if method == "flow":
            noise = torch.randn(actions.shape, generator=generator)
            time = torch.rand(len(noise), generator=generator)
            point, velocity = straight_path(noise, actions, time)
            return point, time, velocity
        level = torch.randint(self.schedule.levels, (len(actions),), generator=generator)
        noise = torch.randn(actions.shape, generator=generator)
        noisy = self.schedule.add_noise(actions, noise, level)
        return noisy, self.schedule.level_time(level.to(noisy.dtype)), noise

    def _mapped(self, seen: Tensor, values: Tensor | None, time: Tensor | None) -> Tensor:
        given = (seen, values, time)
        places = tuple(None if part is None else 0 for part in given)

        def one(weights: dict[str, Tensor], *parts: Tensor | None) -> Tensor:
            return functional_call(self.one, weights, parts)

        return vmap(one, in_dims=(0, *places))(self.weights, *given)

    def _linear(self, name: str, rows: Tensor) -> Tensor:
        weight, bias = (self.weights[f"network.{name}.{part}"] for part in ("weight", "bias"))
        return torch.baddbmm(bias[:, None], rows, weight.mT)

    def _multiplied(self, seen: Tensor, values: Tensor | None, time: Tensor | None) -> Tensor:
        linear, silu, network = self._linear, functional.silu, self.one.network
        condition = linear("encoder.out", silu(linear("encoder.hidden", seen.flatten(2))))
        hidden, gains = None, None
        if values is None or time is None:
            start = self.weights["network.head.start"]
            hidden = start[:, None].expand(*seen.shape[:2], -1)
        else:
            features = _frequencies(network.head.time_features)
            angles = time[..., None] * features
            embedded = linear("head.time.0", torch.cat([angles.sin(), angles.cos()], dim=-1))
            condition = condition + linear("head.time.2", silu(embedded))
            own = network._gains(time.flatten())
            gains = [part.reshape(*time.shape, 1) for part in (own.inner, own.skip, own.outer)]
            hidden = linear("head.entry", gains[0] * values.flatten(2))
        blocks = len(network.trunk.first)
        modulation = linear("trunk.modulation", silu(condition)).chunk(2 * blocks, dim=-1)
        for place in range(blocks):
            shift, scale = modulation[2 * place], modulation[2 * place + 1]
            normed = functional.layer_norm(hidden, (network.trunk.width,))
            modulated = torch.addcmul(shift, normed, 1.0 + scale)
            entered = silu(linear(f"trunk.first.{place}", modulated))
            hidden = hidden + linear(f"trunk.second.{place}", entered)
        branch = linear("head.branch_out", silu(linear("head.branch_in", silu(hidden))))
        chunk = linear("head.direct", hidden) + branch
        if gains is not None and values is not None:
            chunk = gains[1] * values.flatten(2) + gains[2] * chunk
        sizes = network.dimensions
        return chunk.reshape(*seen.shape[:2], sizes.prediction_horizon, sizes.action_dim)

    def __call__(self) -> None:
        seen, given, weight = [], [], []
        for start, order, generator in zip(self.starts, self.orders, self.generators, strict=True):
            rows, data = torch.from_numpy(next(order)), start.data
            seen.append(data.observations[rows])
            weight.append(data.weight[rows])
            given.append(self.drawn(data.actions[rows], generator))
        values, time, target = zip(*given, strict=True)
        said = self.say(torch.stack(seen), stack(values), stack(time))
        errors = (said - torch.stack(target)).square()
        losses = [masked_mean(*own) for own in zip(errors, weight, strict=True)]
        for group in self.optimiser.param_groups:
            group["lr"] = learning_rate(self.done, self.config)
        self.optimiser.zero_grad(set_to_none=True)
        torch.stack(losses).sum().backward()
        with torch.no_grad():
            self._clip()
            self.optimiser.step()
            share = 1.0 - averaging_decay(self.done, self.config)
            torch._foreach_lerp_(self.average, self.current, share)
        self.done += 1

    def _clip(self) -> None:
        """Each seed by its own norm."""
        gradients = [weight.grad for weight in self.current]
        norms = torch.stack([own.flatten(1).norm(dim=1) for own in gradients]).norm(dim=0)
        share = (self.config.gradient_clip / (norms + SMALL)).clamp(max=1.0)
        for own in gradients:
            own.mul_(share.reshape(-1, *[1] * (own.ndim - 1)))

    def of_seed(self, place: int) -> list[Tensor]:
        """Averaged weights of a seed, in the order of its network's parameters."""
        named = dict(zip(self.weights, self.average, strict=True))
        return [named[name][place] for name, _ in self.one.named_parameters()]
