"""Deterministic computing: a row keeps its bits whatever its company."""

import pytest
import torch

from genpolicy.policies.determinism import deterministic
from genpolicy.policies.methods import METHODS
from genpolicy.policies.networks import (
    Dimensions,
)
from genpolicy.policies.settings import HeadConfig, NetworkConfig


@pytest.mark.parametrize("method", list(METHODS))
@pytest.mark.parametrize("rows", [8, 16, 64])
def test_a_row_keeps_its_bits_at_every_place_of_a_batch(method, rows):
    dimensions = Dimensions(
        observation_horizon=2,
        observation_dim=24,
        prediction_horizon=16 if METHODS[method].chunked else 1,
        action_dim=10,
    )
    generator = torch.Generator().manual_seed(1)
    network = METHODS[method].build(dimensions, NetworkConfig(), HeadConfig())
    observations = torch.randn(1, 2, 24, generator=generator).expand(rows, -1, -1).contiguous()
    reads = METHODS[method].reads
    values = time = None
    if reads == "latent":
        values = (
            torch.randn(1, HeadConfig().latent_dim, generator=generator)
            .expand(rows, -1)
            .contiguous()
        )
    elif reads == "chunk":
        values = torch.randn(1, 16, 10, generator=generator).expand(rows, -1, -1).contiguous()
        time = torch.full((rows,), 0.37)
    elif reads == "codes":
        values = torch.randn(1, 32, HeadConfig().code_dim, generator=generator)
        values = values.expand(rows, -1, -1).contiguous()
    with deterministic("cpu"), torch.inference_mode():
        out = network.evaluate(network.encode(observations), values, time)
    assert all(torch.equal(out[0], row) for row in out)
