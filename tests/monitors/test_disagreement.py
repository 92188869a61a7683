"""Disagreement: none with itself, some with another seed, and one seed is said to be one."""

import numpy as np
import pytest

from genpolicy.monitors.disagreement import ONE_SEED, SeedDisagreement
from genpolicy.monitors.protocol import Invocation


def test_a_training_agrees_with_itself(kit):
    policy = kit.policies("chunked_bc")
    monitor = SeedDisagreement.fitted(kit.fit("chunked_bc", others=[policy]))
    invocation = kit.invocation("chunked_bc", candidates=1)
    assert monitor.score(invocation) == pytest.approx(0.0, abs=1e-6)


def test_seeds_disagree_more_where_nobody_was(kit):
    others = [kit.policies("chunked_bc", seed) for seed in (1, 2)]
    monitor = SeedDisagreement.fitted(kit.fit("chunked_bc", others=others))
    near, far = (
        np.mean(
            [
                monitor.score(kit.invocation("chunked_bc", shift=shift, name=name, candidates=1))
                for name in range(5)
            ]
        )
        for shift in (0.0, 3.0)
    )
    assert 0 < near < far


def test_one_seed_is_said_to_be_one(kit):
    assert SeedDisagreement.fitted(kit.fit("flow")) is ONE_SEED
    assert "one seed" in ONE_SEED.why
    assert isinstance(kit.invocation(), Invocation)
