"""One update of one training: as a stage runs it, as a plain loop runs it, and its products alone.

Windows are drawn, not recorded: what an update costs does not hang on their numbers.
"""

import copy
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from diffusers import DDPMScheduler
from diffusers.training_utils import EMAModel
from torch import Tensor, nn
from torch.nn import functional

from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.normalisation import MinMax, Normalisation
from genpolicy.integrity.documents import read_yaml
from genpolicy.policies import training
from genpolicy.policies.checkpoint import Provenance
from genpolicy.policies.matched_training import PolicySettings
from genpolicy.policies.methods import method_named
from genpolicy.policies.networks import PolicyNetwork
from genpolicy.policies.objectives import Batch, Objective
from genpolicy.policies.settings import SamplerConfig
from genpolicy.policies.training_request import TrainingRequest
from genpolicy.policies.windows import Windows
from genpolicy.seeds import integer_seed

PARAMS = read_yaml(Path(__file__).parents[2] / "params.yaml")
HORIZONS = HorizonConfig(**PARAMS["horizons"])
SETTINGS = PolicySettings(**PARAMS["policy"])
METHODS = ("chunked_bc", "flow", "diffusion")
OBSERVATION, ACTION, WINDOWS = 24, 10, 4096
NOTHING = "0" * 64


@dataclass(frozen=True)
class Size:
    """Batch and trunk width; the other widths in the proportions of `params.yaml`."""

    width: int = SETTINGS.network.trunk_width
    batch: int = SETTINGS.training.batch_size

    def of(self, request: TrainingRequest) -> TrainingRequest:
        """The same training at this size; at the configured one, the very same."""
        training_ = request.training.model_copy(update={"batch_size": self.batch})
        request, own = replace(request, training=training_), request.network
        if self.width == own.trunk_width:
            return request
        share = self.width / own.trunk_width
        hidden, condition, branch = (
            16 * max(1, round(share * wide / 16))
            for wide in (own.encoder_width, own.condition_dim, 128)
        )
        outputs = HORIZONS.prediction_horizon * ACTION
        chunk = outputs * self.width + self.width
        time = (own.time_features + 1 + condition + 1) * condition
        ends = (self.width + 1) * outputs + branch * (self.width + 1 + outputs) + outputs
        return replace(request, network=own.model_copy(update={
            "encoder_width": hidden, "condition_dim": condition, "trunk_width": self.width,
            "head_parameters": chunk + time + ends,
        }))  # fmt: skip


def windows() -> Windows:
    """Drawn windows of the default task's sizes."""
    rng = np.random.default_rng(0)
    seen = rng.normal(size=(WINDOWS, HORIZONS.observation_horizon, OBSERVATION))
    actions = rng.normal(size=(WINDOWS, HORIZONS.prediction_horizon, ACTION))
    return Windows(seen, actions, np.zeros(actions.shape[:2], dtype=bool))


def request_of(method: str, data: Windows, seed: int) -> TrainingRequest:
    """The training of `params.yaml`, which tells its loss after every update."""
    bounds = {
        name: MinMax(rows.min(axis=(0, 1)), rows.max(axis=(0, 1)))
        for name, rows in (("observation", data.observations), ("action", data.actions))
    }
    return TrainingRequest(
        method=method, horizons=HORIZONS, normalisation=Normalisation(**bounds),
        network=SETTINGS.network, head=SETTINGS.head,
        training=SETTINGS.training.model_copy(update={"validation_every": 1}),
        sampler=SamplerConfig(name=method_named(method).samplers[0]),
        provenance=Provenance(
            dataset_manifest_sha256=NOTHING, action_contract_sha256=NOTHING,
            observation_contract_sha256=NOTHING,
        ),
        seed=seed,
    )  # fmt: skip


class Start:
    """What every way begins with: network and objective before the first update, and the data.

    Args:
        method: Its name.
        data: Windows, physical units.
        seed: Of the training.
        size: Of network and batch.
    """

    def __init__(self, method: str, data: Windows, *, seed: int = 0, size: Size | None = None):
        request = request_of(method, data, seed)
        self.request = request if size is None else size.of(request)
        self.data: Batch = training._batch_of(data, HORIZONS, self.request, "cpu")
        self.network: PolicyNetwork
        self.objective: Objective
        self.network, self.objective = training._build(
            method_named(method), self.request, "cpu", teacher=None
        )
        self.objective.prepare(self.network, self.data)

    def order(self) -> Iterator[np.ndarray]:
        """Rows of each batch."""
        config, count = self.request.training, len(self.data.actions)
        return training._batch_order(count, config.batch_size, self.request.seed)

    def generator(self) -> torch.Generator:
        """Noise of the training."""
        return torch.Generator().manual_seed(integer_seed(self.request.seed, "training_noise"))


class Ours:
    """The update of a stage: the loop of `training.train` itself, taken one at a time."""

    def __init__(self, start: Start) -> None:
        self.network, self.averaged = start.network, copy.deepcopy(start.network)
        self._course = training._optimise(
            self.network, self.averaged, start.objective,
            data=start.data, followed=None, request=start.request, device="cpu", of=Path("ours"),
        )  # fmt: skip

    def __call__(self) -> None:
        next(self._course)


class Peer:
    """The usual way, with the same batches and noise.

    Optimiser and schedule by torch; noise levels and averaged weights by diffusers.
    """

    def __init__(self, start: Start) -> None:
        self.network, self.data, config = start.network, start.data, start.request.training
        self.method, self.config = start.request.method, config
        self.order, self.generator = start.order(), start.generator()
        levels = start.request.head.diffusion_levels
        self.scheduler: Any = DDPMScheduler(levels, beta_schedule="squaredcos_cap_v2")
        self.optimiser = torch.optim.AdamW(
            self.network.parameters(), lr=config.learning_rate,
            betas=(config.beta_1, config.beta_2), weight_decay=config.weight_decay,
        )  # fmt: skip
        self.rate = torch.optim.lr_scheduler.LambdaLR(
            self.optimiser,
            lambda update: training.learning_rate(update, config) / config.learning_rate,
        )
        self.average = EMAModel(
            self.network.parameters(), decay=config.ema_cap, use_ema_warmup=True,
            power=config.ema_power,
        )  # fmt: skip

    def drawn(self, actions: Tensor) -> tuple[Tensor | None, Tensor | None, Tensor]:
        """Noisy chunks, their times and what the network must say."""
        if self.method == "chunked_bc":
            return None, None, actions
        if self.method == "flow":
            noise = torch.randn(actions.shape, generator=self.generator)
            time = torch.rand(len(noise), generator=self.generator)
            return torch.lerp(noise, actions, time[:, None, None]), time, actions - noise
        levels = len(self.scheduler)
        level = torch.randint(levels, (len(actions),), generator=self.generator)
        noise = torch.randn(actions.shape, generator=self.generator)
        return self.scheduler.add_noise(actions, noise, level), level / levels, noise

    def __call__(self) -> None:
        rows = torch.from_numpy(next(self.order))
        values, time, target = self.drawn(self.data.actions[rows])
        said = self.network.evaluate(
            self.network.encode(self.data.observations[rows]), values, time
        )
        errors = functional.mse_loss(said, target, reduction="none")
        loss = (errors * self.data.weight[rows]).mean()
        self.optimiser.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(self.network.parameters(), self.config.gradient_clip)
        self.optimiser.step()
        self.rate.step()
        self.average.step(self.network.parameters())


@dataclass(frozen=True)
class Layer:
    """A matrix of an update: its sizes, and whether the gradient goes on below it."""

    inputs: int
    outputs: int
    rows: int
    below: bool

    @property
    def operations(self) -> int:
        """Multiplications and additions of its two or three products."""
        return 2 * self.inputs * self.outputs * self.rows * (2 + self.below)


def layers_of(start: Start) -> list[Layer]:
    """Matrices that one update multiplies by, as its forward pass meets them."""
    found: list[Layer] = []

    def met(layer: nn.Linear, given: tuple[Tensor], out: Tensor) -> None:
        rows = out.numel() // layer.out_features
        found.append(Layer(layer.in_features, layer.out_features, rows, given[0].requires_grad))

    hooks = [
        layer.register_forward_hook(met)
        for layer in start.network.modules()
        if isinstance(layer, nn.Linear)
    ]
    rows = torch.from_numpy(next(start.order()))
    data = start.data
    batch = Batch(data.observations[rows], data.actions[rows], data.weight[rows])
    start.objective.loss(start.network, batch, start.generator())
    for hook in hooks:
        hook.remove()
    return found


class Products:
    """Matrix products of an update: forward, gradient of inputs, gradient of weights.

    Args:
        layers: Of one network.
        copies: Networks; of more than one each product is a batched one.
    """

    def __init__(self, layers: list[Layer], copies: int = 1) -> None:
        generator = torch.Generator().manual_seed(0)
        lead = (copies,) if copies > 1 else ()
        self.product = torch.bmm if copies > 1 else torch.mm

        def some(*shape: int) -> Tensor:
            return torch.randn(*lead, *shape, generator=generator)

        self.work = []
        for own in layers:
            rows, weight = some(own.rows, own.inputs), some(own.outputs, own.inputs)
            above = some(own.rows, own.outputs)
            self.work.append((rows, weight.mT, torch.empty_like(above)))
            if own.below:
                self.work.append((above, weight, torch.empty_like(rows)))
            self.work.append((above.mT, rows, torch.empty_like(weight)))

    def __call__(self) -> None:
        for one, other, out in self.work:
            self.product(one, other, out=out)
