"""The identity card: what it says of the way from noise to action."""

from types import SimpleNamespace

import pytest

from genpolicy.evidence.reproducibility.identity import _path
from genpolicy.policies.methods import METHODS
from genpolicy.policies.settings import HeadConfig, SamplerConfig

CONFIG = SimpleNamespace(head=HeadConfig(diffusion_levels=50, prediction="v", flow_segments=3))
SAID = {
    "diffusion": ("schedule of 50 levels", "predicts v"),
    "manicm": ("schedule of 50 levels", "consistent at 10 of them", "predicts v"),
    "flow": ("straight path from Gaussian noise", "velocity"),
    "flow_policy": ("consistent in 3 segments",),
}


@pytest.mark.parametrize("method", list(METHODS))
def test_every_sampler_of_a_method_says_its_path_and_the_others_that_there_is_none(method):
    for name in METHODS[method].samplers:
        text = _path(CONFIG, SamplerConfig.model_construct(name=name))
        for part in SAID.get(method, ("no transport",)):
            assert part in text, name
