"""Barely trained policies of one small task, and invocations of them."""

from types import SimpleNamespace

import numpy as np
import pytest

from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.normalisation import Normalisation, statistics_of
from genpolicy.monitors.protocol import Fit, Invocation
from genpolicy.policies.checkpoint import Provenance
from genpolicy.policies.policy import load_policy
from genpolicy.policies.settings import HeadConfig, NetworkConfig, SamplerConfig, TrainingConfig
from genpolicy.policies.training import train
from genpolicy.policies.training_request import TrainingRequest
from genpolicy.policies.windows import Windows

PERIOD_S = 0.05
SAMPLERS = {
    "chunked_bc": SamplerConfig(name="direct"),
    "diffusion": SamplerConfig(name="ddim", steps=10),
    "flow": SamplerConfig(name="euler", steps=8),
}


def training_windows(count=256, seed=0):
    """Two modes at each observation; chunks of four actions of two numbers."""
    rng = np.random.default_rng(seed)
    observations = rng.normal(0.0, 0.1, (count, 2, 3))
    actions = np.empty((count, 4, 2))
    actions[:, :, 0] = rng.choice([-1.0, 1.0], count)[:, None]
    actions[:, :, 1] = observations[:, -1, :1] * 3.0
    return Windows(observations, actions, np.zeros((count, 4), dtype=bool))


@pytest.fixture(scope="session")
def statistics():
    windows = training_windows()
    return Normalisation(
        statistics_of(windows.observations.reshape(-1, 3)),
        statistics_of(windows.actions.reshape(-1, 2)),
    )


@pytest.fixture(scope="session")
def policies(tmp_path_factory, statistics):
    """By method and training seed, on demand."""
    root, made = tmp_path_factory.mktemp("policies"), {}

    def of(method, seed=0, updates=200):
        if (method, seed) not in made:
            folder = root / f"{method}_{seed}"
            request = TrainingRequest(
                method=method,
                horizons=HorizonConfig(
                    action_period_s=PERIOD_S,
                    observation_horizon=2,
                    prediction_horizon=4,
                    execution_horizon=2,
                ),
                network=NetworkConfig(
                    encoder_width=16,
                    condition_dim=16,
                    trunk_width=48,
                    trunk_blocks=2,
                    time_features=16,
                    head_parameters=6000,
                ),
                head=HeadConfig(latent_dim=4, posterior_width=16),
                training=TrainingConfig(
                    updates=updates,
                    batch_size=64,
                    learning_rate=3e-3,
                    warmup_updates=10,
                    validation_every=updates,
                ),
                sampler=SAMPLERS[method],
                normalisation=statistics,
                provenance=Provenance(
                    dataset_manifest_sha256="a" * 64,
                    action_contract_sha256="b" * 64,
                    observation_contract_sha256="c" * 64,
                ),
                seed=seed,
            )
            train(folder, request, windows=training_windows())
            made[method, seed] = load_policy(folder)
        return made[method, seed]

    return of


@pytest.fixture(scope="session")
def kit(policies, statistics):
    """Fits and invocations."""

    def fit(method=None, others=(), seed=0):
        return Fit(
            windows=training_windows(),
            normalisation=statistics,
            action_period_s=PERIOD_S,
            policy=None if method is None else policies(method, seed),
            others=others,
            candidates=4,
        )

    def invocation(method="flow", *, shift=0.0, time_s=0.1, before=None, name=0, candidates=4):
        seen = training_windows(seed=5).observations[name] + shift
        drawn = policies(method).sample(
            seen[None], noise_names=[("test", name)], candidates=candidates
        )
        return Invocation(time_s, seen, drawn.actions[0], before)

    return SimpleNamespace(fit=fit, invocation=invocation, policies=policies)
