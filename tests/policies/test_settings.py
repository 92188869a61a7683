"""Settings of networks and samplers: widths of whole registers, names known, hashes of all."""

import pytest
from pydantic import ValidationError

from genpolicy.policies.settings import WIDTH_UNIT, NetworkConfig, SamplerConfig, TrainingConfig


@pytest.mark.parametrize("field", ["encoder_width", "condition_dim", "trunk_width"])
def test_a_width_is_a_multiple_of_a_vector_register(field):
    assert getattr(NetworkConfig(**{field: 2 * WIDTH_UNIT}), field) == 32
    with pytest.raises(ValidationError, match="multiple"):
        NetworkConfig(**{field: 2 * WIDTH_UNIT + 1})


@pytest.mark.parametrize(
    ("section", "values"),
    [
        (NetworkConfig, {"time_features": 3}), (NetworkConfig, {"trunk": "convolution"}),
        (TrainingConfig, {"beta_1": 1.0}), (TrainingConfig, {"learning_rate": 0.0}),
        (TrainingConfig, {"ema_cap": 1.0}), (TrainingConfig, {"updates": "10"}),
        (SamplerConfig, {"name": "telepathy"}), (SamplerConfig, {"name": "ddim", "clip": 0.0}),
        (SamplerConfig, {"name": "ddim", "eta": 1.1}),
        (SamplerConfig, {"name": "bosh3", "nfe_cap": 0}),
        (SamplerConfig, {"name": "bosh3", "tolerance": 0.0}),
        (SamplerConfig, {"name": "ddim", "surprise": 0.0}),
    ],
)  # fmt: skip
def test_what_is_out_of_range_or_unknown_is_refused(section, values):
    with pytest.raises(ValidationError):
        section(**values)


def test_the_hash_of_a_sampler_covers_every_setting():
    base = SamplerConfig(name="ddim", steps=4)
    others = [
        SamplerConfig(name="ddpm", steps=4), SamplerConfig(name="ddim", steps=5),
        SamplerConfig(name="ddim", steps=4, clip=None),
        SamplerConfig(name="ddim", steps=4, population=2),
        SamplerConfig(name="ddim", steps=4, batch_rows=8),
        SamplerConfig(name="ddim", steps=4, eta=0.5),
        SamplerConfig(name="ddim", steps=4, tolerance=0.1),
        SamplerConfig(name="ddim", steps=4, nfe_cap=9),
    ]  # fmt: skip
    assert base.hash() == SamplerConfig(name="ddim", steps=4).hash()
    assert len({base.hash(), *(other.hash() for other in others)}) == 9
    assert len(others) == len(SamplerConfig.model_fields)
