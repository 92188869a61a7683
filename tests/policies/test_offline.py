"""Offline errors: by phase, without padding."""

import numpy as np
import pytest

from genpolicy.policies.normalisation import MinMax, Normalisation
from genpolicy.policies.offline import masked_errors
from genpolicy.policies.protocol import Samples
from genpolicy.policies.windows import Windows


class ConstantPolicy:
    """Answers the same action everywhere."""

    method, checkpoint_hash, sampler_config_hash = "constant", "c" * 64, "s" * 64
    stochastic = False

    def __init__(self, horizon):
        self.prediction_horizon = horizon

    def sample(self, observations, *, noise_names, candidates):
        shape = (len(observations), candidates, self.prediction_horizon, 10)
        return Samples(np.full(shape, 0.5), 1)


def case(horizon):
    actions = np.full((4, 3, 10), 0.5)
    actions[2:, 0, 0] += 0.03
    actions[:, 2] = 77.0
    is_pad = np.zeros((4, 3), dtype=bool)
    is_pad[:, 2] = True
    statistics = MinMax(np.zeros(10), np.full(10, 2.0))
    return masked_errors(
        ConstantPolicy(horizon),
        Windows(np.zeros((4, 2, 5)), actions, is_pad),
        phases=np.array(["align", "align", "insert", "insert"]),
        normalisation=Normalisation(statistics, statistics),
        noise_names=[("w", i) for i in range(4)],
    )


@pytest.mark.parametrize(("horizon", "counted"), [(1, 1), (3, 2)])
def test_errors_by_phase_leave_padding_out(horizon, counted):
    align, insert = case(horizon)
    assert (align.phase, align.masked_mae, align.position_rmse_m) == ("align", 0.0, 0.0)
    assert insert.windows == 2
    assert insert.masked_mae == pytest.approx(0.03 / 10 / counted)
    assert insert.position_rmse_m == pytest.approx(0.03 / counted**0.5)
