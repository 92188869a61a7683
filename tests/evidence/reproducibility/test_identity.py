"""The identity card: what it says of the way from noise to action."""

from types import SimpleNamespace

import pytest

from genpolicy.candidates.described import path_of
from genpolicy.candidates.joining import READS, JoiningSettings
from genpolicy.evidence.reproducibility.identity import rule_sha256
from genpolicy.policies.methods import METHODS
from genpolicy.policies.settings import HeadConfig, SamplerConfig

CONFIG = SimpleNamespace(head=HeadConfig(diffusion_levels=50, prediction="v", flow_segments=3))
SAID = {
    "diffusion": ("schedule of 50 levels", "predicts v"),
    "manicm": ("schedule of 50 levels", "consistent at 10 of them", "predicts v"),
    "flow": ("straight path from Gaussian noise", "velocity"),
    "flow_policy": ("consistent in 3 segments",),
}


def test_no_two_rules_have_one_hash_and_what_a_rule_does_not_read_changes_none():
    """Most of them stand in one file."""
    plain = {rule: rule_sha256(JoiningSettings(rule=rule)) for rule in READS}
    assert len({*plain.values()}) == len(READS)
    other = {"decay": 0.5, "newest": 0.5, "guidance": 2.0}
    for rule, read in READS.items():
        for name, value in other.items():
            changed = rule_sha256(JoiningSettings(rule=rule, **{name: value}))
            assert (changed == plain[rule]) is (name not in read), (rule, name)


@pytest.mark.parametrize("method", list(METHODS))
def test_every_sampler_of_a_method_says_its_path_and_the_others_that_there_is_none(method):
    for name in METHODS[method].samplers:
        text = path_of(CONFIG, SamplerConfig.model_construct(name=name))
        for part in SAID.get(method, ("no transport",)):
            assert part in text, name
