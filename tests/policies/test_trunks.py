"""Trunks and encoders: one budget, rows that keep their bits, gradients everywhere."""

import pytest
import torch

from genpolicy.errors import ConfigError
from genpolicy.policies.determinism import deterministic
from genpolicy.policies.methods import METHODS
from genpolicy.policies.networks import Dimensions, flops_per_evaluation, parameter_counts
from genpolicy.policies.settings import HeadConfig, NetworkConfig
from genpolicy.policies.trunks import OBSERVATION_TOKENS, Block, TransformerTrunk, Trunk

SIZES = Dimensions(observation_horizon=2, observation_dim=24, prediction_horizon=16, action_dim=10)
CONFIGS = {
    "default": NetworkConfig(trunk="transformer"),
    "smoke": NetworkConfig(
        trunk="transformer", encoder_width=128, condition_dim=64, trunk_width=192,
        head_parameters=80_000,
    ),
    "small": NetworkConfig(
        trunk="transformer", encoder_width=32, condition_dim=32, trunk_width=64, trunk_blocks=1,
        head_parameters=40_000,
    ),
}  # fmt: skip


def build(config, method="chunked_bc"):
    return METHODS[method].build(SIZES, config, HeadConfig())


@pytest.mark.parametrize("name", list(CONFIGS))
def test_a_transformer_has_the_budget_of_the_mlp(name):
    config = CONFIGS[name]
    own = parameter_counts(build(config))
    other = parameter_counts(build(config.model_copy(update={"trunk": "mlp"})))
    assert own["trunk"] == pytest.approx(other["trunk"], rel=0.05)
    assert own["encoder"] == other["encoder"] and own["head"] == other["head"]


def test_a_linear_encoder_has_one_layer():
    counts = parameter_counts(build(NetworkConfig(encoder="linear")))
    assert counts["encoder"] == (2 * 24 + 1) * 128
    assert counts["trunk"] == parameter_counts(build(NetworkConfig()))["trunk"]


@pytest.mark.parametrize("config", [NetworkConfig(encoder="linear"), CONFIGS["default"]])
@pytest.mark.parametrize("rows", [8, 16, 64])
def test_a_row_keeps_its_bits_at_every_place_of_a_batch(config, rows):
    network = build(config)
    observations = torch.randn(1, 2, 24, generator=torch.Generator().manual_seed(1))
    observations = observations.expand(rows, -1, -1).contiguous()
    with deterministic("cpu"), torch.inference_mode():
        out = network.evaluate(network.encode(observations))
    assert all(torch.equal(out[0], row) for row in out)


def test_every_parameter_of_a_transformer_learns():
    network = build(CONFIGS["small"], "flow")
    chunk, time = torch.randn(4, 16, 10), torch.rand(4)
    network.evaluate(network.encode(torch.randn(4, 2, 24)), chunk, time).square().sum().backward()
    assert all(
        parameter.grad is not None and bool(parameter.grad.abs().sum() > 0)
        for parameter in network.parameters()
    )


def test_the_action_token_reads_the_observation_tokens():
    trunk = TransformerTrunk(CONFIGS["small"])
    hidden, condition = torch.randn(1, 64), torch.randn(2, 1, 32)
    found = [trunk(hidden, trunk.prepare(one)) for one in condition]
    assert not torch.allclose(*found)


@pytest.mark.parametrize("kind", [Trunk, TransformerTrunk])
def test_what_is_prepared_once_serves_all_rows(kind):
    """To rounding: other products of as many rows."""
    trunk = kind(CONFIGS["small"])
    hidden, condition = torch.randn(5, 64), torch.randn(1, 32)
    whole = trunk(hidden, trunk.prepare(condition.expand(5, -1)))
    assert torch.allclose(trunk(hidden, trunk.prepare(condition)), whole, atol=1e-6)


def test_attention_is_a_mean_of_values():
    """Golden: with equal keys attention is the plain mean over tokens."""
    block = Block(16, 16)
    with torch.no_grad():
        for layer in (block.attention, block.mixed, block.first, block.second):
            layer.weight.zero_()
            layer.bias.zero_()
        block.attention.weight[32:] = torch.eye(16)
        block.mixed.weight.copy_(torch.eye(16))
    tokens = torch.randn(3, OBSERVATION_TOKENS + 1, 16)
    normed = torch.nn.functional.layer_norm(tokens, (16,))
    expected = tokens + normed.mean(dim=1, keepdim=True)
    torch.testing.assert_close(block(tokens), expected)


def test_operations_count_every_token():
    mlp, transformer = (
        flops_per_evaluation(build(NetworkConfig(trunk=name)))["trunk"]
        for name in ("mlp", "transformer")
    )
    assert 3 * mlp < transformer < 5 * mlp


def test_a_budget_too_small_for_tokens_is_refused():
    config = NetworkConfig(trunk="transformer", trunk_width=16, trunk_blocks=1, condition_dim=16)
    assert sum(p.numel() for p in Trunk(config).parameters()) < 1200
    with pytest.raises(ConfigError, match="transformer"):
        TransformerTrunk(config)
