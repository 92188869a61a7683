"""One invocation's sampler against diffusers on the same weights, and against its own arithmetic.

The diffusion policy of `params.yaml`, of the configured size and untrained, draws candidates of one
observation with 16 DDIM steps. Four ways take turns, call by call, on one thread, so that a machine
that grows slower slows all of them:

- diffusers' `DDIMScheduler` around the eager network, with as many rows as candidates;
- the project's own loop around the eager network, with as many rows;
- the policy as it is deployed (`NetworkPolicy.sample_encoded`), noise by name and physical units
  included;
- the matrix products of the 16 evaluations alone, with nothing between them.

Printed are medians of processor time, and ratios to diffusers and to the products. Before that, the
policy must draw what the plain loop makes of rows of 16, bit for bit, and diffusers what the plain
loop draws, to 1e-4, with 20 steps: with 16, which do not divide 100 levels, diffusers goes from a
level to one that it does not visit next. Who is compared must do the same work.

    python -m benchmarks.sampling
"""

import sys
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import torch
from diffusers import DDIMScheduler
from torch import Tensor, nn

from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.normalisation import MinMax, Normalisation
from genpolicy.integrity.documents import read_yaml
from genpolicy.policies.checkpoint import Provenance
from genpolicy.policies.diffusion_samplers import sample_diffusion
from genpolicy.policies.matched_training import PolicySettings
from genpolicy.policies.policy import NetworkPolicy, load_policy
from genpolicy.policies.schedules import squared_cosine
from genpolicy.policies.settings import SamplerConfig
from genpolicy.policies.training import train
from genpolicy.policies.training_request import TrainingRequest
from genpolicy.policies.windows import Windows
from genpolicy.seeds import counter_noise

PARAMS = read_yaml(Path(__file__).parents[1] / "params.yaml")
HORIZONS = HorizonConfig(**PARAMS["horizons"])
SAMPLER = SamplerConfig(name="ddim", steps=16)
DIVIDING = SamplerConfig(name="ddim", steps=20)
CANDIDATES = (1, 8, 32)
REPEATS, DISCARDED = 60, 5
OBSERVATION, ACTION = 24, 10


NOTHING = "0" * 64


def untrained(folder: Path, *, observation: str = NOTHING, action: str = NOTHING) -> NetworkPolicy:
    """A diffusion policy of the configured size after one update, of contracts by their hashes."""
    settings = PolicySettings(**PARAMS["policy"])
    rng = np.random.default_rng(0)
    windows = Windows(
        rng.normal(size=(64, HORIZONS.observation_horizon, OBSERVATION)),
        rng.normal(size=(64, HORIZONS.prediction_horizon, ACTION)),
        np.zeros((64, HORIZONS.prediction_horizon), dtype=bool),
    )
    bounds = {
        name: MinMax(rows.min(axis=(0, 1)), rows.max(axis=(0, 1)))
        for name, rows in (("observation", windows.observations), ("action", windows.actions))
    }
    request = TrainingRequest(
        method="diffusion", horizons=HORIZONS, normalisation=Normalisation(**bounds),
        network=settings.network, head=settings.head,
        training=settings.training.model_copy(update={"updates": 1}), sampler=SAMPLER,
        provenance=Provenance(
            dataset_manifest_sha256=NOTHING, action_contract_sha256=action,
            observation_contract_sha256=observation,
        ),
        seed=0,
    )  # fmt: skip
    train(folder, request, windows=windows)
    return load_policy(folder)


class Contenders:
    """The four ways, for one number of candidates."""

    def __init__(self, policy: NetworkPolicy, candidates: int) -> None:
        self.policy, self.count = policy, candidates
        head = policy.checkpoint.config.head
        self.network, self.levels = policy.checkpoint.network, head.diffusion_levels
        seen = np.random.default_rng(1).normal(size=(1, HORIZONS.observation_horizon, OBSERVATION))
        self.condition = policy.encode(policy.preprocess(seen))
        shape = (HORIZONS.prediction_horizon, ACTION)
        names = [(policy.checkpoint_hash, "a", row, 0) for row in range(candidates)]
        noise = np.stack([counter_noise(name, shape=shape) for name in names])
        self.noise = torch.from_numpy(noise.astype(np.float32))
        self.scheduler: Any = DDIMScheduler(
            num_train_timesteps=self.levels, beta_schedule="squaredcos_cap_v2", clip_sample=True,
            timestep_spacing="trailing", set_alpha_to_one=True,
        )  # fmt: skip
        self.layers = [
            (layer, torch.randn(candidates, layer.in_features))
            for part in (self.network.trunk, self.network.head)
            for layer in part.modules()
            if isinstance(layer, nn.Linear)
        ]

    def diffusers(self, steps: int = SAMPLER.steps) -> Tensor:
        """The usual way."""
        condition, x = self.condition.expand(self.count, -1), self.noise
        self.scheduler.set_timesteps(steps)
        for level in self.scheduler.timesteps:
            at = torch.full((self.count,), float(level)) / self.levels
            said = self.network.evaluate(condition, x, at)
            x = self.scheduler.step(said, level, x, use_clipped_model_output=True).prev_sample
        return x

    def plain(self, rows: int = 0, sampler: SamplerConfig = SAMPLER) -> Tensor:
        """Our loop without anything computed ahead; with copies of the last row up to `rows`."""
        more = max(rows - self.count, 0)
        noise = torch.cat([self.noise, self.noise[-1:].expand(more, -1, -1)])
        condition = self.condition.expand(len(noise), -1)
        return sample_diffusion(
            lambda x, at: self.network.evaluate(condition, x, at), lambda _: noise,
            schedule=squared_cosine(self.levels), sampler=sampler,
        )[: self.count]  # fmt: skip

    def deployed(self) -> np.ndarray:
        """What runs."""
        return self.policy.sample_encoded(
            self.condition, noise_names=[("a",)], candidates=self.count
        ).actions[0]

    def products(self) -> None:
        """The products of trunk and head, as often as the sampler evaluates them."""
        for _ in range(SAMPLER.steps):
            for layer, rows in self.layers:
                layer(rows)

    def check(self) -> None:
        """All three draw the same."""
        denormalise = self.policy.checkpoint.normalisation.action.denormalise
        parts = range(0, self.count, 16)
        whole, noise = self.deployed(), self.noise
        found = []
        for first in parts:
            self.noise = noise[first : first + 16]
            self.count = len(self.noise)
            found.append(self.plain(16))
        self.noise, self.count = noise, len(noise)
        plain = denormalise(torch.cat(found).numpy().astype(np.float64))
        if not np.array_equal(plain, whole):
            sys.exit(f"{self.count} candidates: deployed and plain differ by "
                     f"{np.abs(plain - whole).max()}, expected equal bits.")  # fmt: skip
        apart = self.diffusers(DIVIDING.steps) - self.plain(sampler=DIVIDING)
        if not float(apart.abs().max()) <= 1e-4:
            sys.exit(f"{self.count} candidates: diffusers and plain differ by "
                     f"{float(apart.abs().max())}, expected at most 1e-4.")  # fmt: skip


def medians(ways: dict[str, Callable[[], object]]) -> dict[str, float]:
    """Median processor time of a call of each, ms; they take turns."""
    spent: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(DISCARDED + REPEATS):
        for name, way in ways.items():
            begin = time.process_time()
            way()
            spent[name].append(1e3 * (time.process_time() - begin))
    return {name: float(np.median(own[DISCARDED:])) for name, own in spent.items()}


def main() -> None:
    """Draw, compare, time, print."""
    torch.set_num_threads(1)
    with TemporaryDirectory() as folder:
        policy = untrained(Path(folder) / "checkpoint")
    print(f"{SAMPLER.steps} DDIM steps, 1 thread, processor ms (median of {REPEATS})")
    print(f"{'candidates':<12}{'diffusers':>11}{'plain':>9}{'deployed':>10}{'products':>10}"
          f"{'diffusers/deployed':>20}{'deployed/products':>19}")  # fmt: skip
    with torch.inference_mode():
        for count in CANDIDATES:
            own = Contenders(policy, count)
            own.check()
            found = medians(
                {
                    "diffusers": own.diffusers,
                    "plain": own.plain,
                    "deployed": own.deployed,
                    "products": own.products,
                }
            )
            print(f"{count:<12}{found['diffusers']:>11.2f}{found['plain']:>9.2f}"
                  f"{found['deployed']:>10.2f}{found['products']:>10.2f}"
                  f"{found['diffusers'] / found['deployed']:>20.2f}"
                  f"{found['deployed'] / found['products']:>19.2f}")  # fmt: skip


if __name__ == "__main__":
    main()
