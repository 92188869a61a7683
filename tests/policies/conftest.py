"""Small policies, trained in a second, shared by the tests of this folder."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from genpolicy.contract.horizons import HorizonConfig
from genpolicy.policies.checkpoint import Provenance
from genpolicy.policies.methods import METHODS
from genpolicy.policies.normalisation import MinMax, Normalisation
from genpolicy.policies.settings import HeadConfig, NetworkConfig, SamplerConfig, TrainingConfig
from genpolicy.policies.training import train
from genpolicy.policies.training_request import TrainingRequest
from genpolicy.policies.windows import Windows

SAMPLERS = {
    "bc": ("direct", 1),
    "chunked_bc": ("direct", 1),
    "chunked_l1": ("direct", 1),
    "bc_noise": ("offset", 1),
    "one_mode_bc": ("direct", 1),
    "act": ("z_zero", 1),
    "cvae": ("z_prior", 1),
    "ibc": ("derivative_free", 8),
    "diffusion": ("ddim", 10),
    "flow": ("euler", 8),
    "flow_policy": ("consistency", 2),
    "manicm": ("multistep_consistency", 1),
}
POPULATION = {"derivative_free": 32}
NETWORK = NetworkConfig(
    encoder_width=16, condition_dim=16, trunk_width=48, trunk_blocks=2, time_features=16,
    head_parameters=6000,
)  # fmt: skip


def two_mode_windows(count: int = 512, *, seed: int = 0) -> Windows:
    """One observation, two equally likely chunks: K = 4 actions of 2 numbers, around -1 or +1."""
    generator = np.random.default_rng(seed)
    observations = generator.normal(0.0, 0.1, (count, 2, 3))
    side = generator.choice([-1.0, 1.0], count)
    actions = np.empty((count, 4, 2))
    actions[:, :, 0] = side[:, None] * (1.0 + 0.05 * generator.standard_normal(count))[:, None]
    actions[:, :, 1] = observations[:, -1, :1] * 3.0
    is_pad = np.zeros((count, 4), dtype=bool)
    is_pad[: count // 8, 3] = True
    return Windows(observations, actions, is_pad)


def request_for(
    method: str, *, seed: int = 3, updates: int = 20, **changes: object
) -> TrainingRequest:
    windows = two_mode_windows()
    numbers = {
        name: values.reshape(-1, values.shape[-1])
        for name, values in (("observation", windows.observations), ("action", windows.actions))
    }
    name, sampler_steps = SAMPLERS[method]
    fields: dict[str, object] = {
        "method": method,
        "horizons": HorizonConfig(
            observation_horizon=2, prediction_horizon=4, execution_horizon=2, action_period_s=0.05
        ),
        "normalisation": Normalisation(
            **{part: MinMax(rows.min(0), rows.max(0)) for part, rows in numbers.items()}
        ),
        "network": NETWORK,
        "head": HeadConfig(latent_dim=4, posterior_width=16),
        "training": TrainingConfig(
            updates=updates,
            batch_size=128,
            learning_rate=3e-3,
            warmup_updates=10,
            validation_every=10,
        ),
        "sampler": SamplerConfig(
            name=name, steps=sampler_steps, population=POPULATION.get(name, 1)
        ),
        "provenance": Provenance(
            dataset_manifest_sha256="a" * 64,
            action_contract_sha256="b" * 64,
            observation_contract_sha256="c" * 64,
        ),
        "seed": seed,
    }
    return TrainingRequest(**{**fields, **changes})


def train_with_teacher(
    folder: Path, request: TrainingRequest, *, windows: Windows, validation: Windows | None = None
) -> str:
    """Train a method alike; where it has a teacher, that one first, next to it."""
    teacher, beside = METHODS[request.method].teacher, None
    if teacher is not None:
        beside = folder.with_name(f"{folder.name}_teacher")
        sampler = request_for(teacher).sampler
        train(beside, replace(request, method=teacher, sampler=sampler), windows=windows)
    return train(folder, request, windows=windows, validation=validation, weights_of=beside)


@pytest.fixture(scope="session", name="train_with_teacher")
def _train_with_teacher():
    return train_with_teacher


@pytest.fixture(scope="session", name="two_mode_windows")
def _two_mode_windows():
    return two_mode_windows


@pytest.fixture(scope="session", name="request_for")
def _request_for():
    return request_for


@pytest.fixture(scope="session")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """One barely trained checkpoint per method."""
    root = tmp_path_factory.mktemp("checkpoints")
    windows = two_mode_windows()
    for method in SAMPLERS:
        train_with_teacher(root / method, request_for(method), windows=windows, validation=windows)
    return {method: root / method for method in SAMPLERS}
