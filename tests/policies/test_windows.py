"""Training windows: shapes agree, the newest rows are kept, padding has no weight."""

import numpy as np
import pytest

from genpolicy.contract.horizons import HorizonConfig
from genpolicy.errors import ContractError, NonFiniteError
from genpolicy.policies.normalisation import MinMax, Normalisation
from genpolicy.policies.windows import Windows, as_batch


def windows(**changes):
    """Two windows of 3 observations of 2 numbers and 4 actions of 1; the last is padding."""
    pad = np.zeros((2, 4), dtype=bool)
    pad[:, 3] = True
    fields = {
        "observations": np.arange(12.0).reshape(2, 3, 2),
        "actions": np.arange(8.0).reshape(2, 4, 1), "is_pad": pad,
    }  # fmt: skip
    return Windows(**{**fields, **changes})


@pytest.mark.parametrize(
    "changes",
    [
        {"observations": np.zeros((2, 3))}, {"observations": np.zeros((3, 3, 2))},
        {"is_pad": np.zeros((2, 3), dtype=bool)},
        {"observations": np.zeros((0, 3, 2)), "actions": np.zeros((0, 4, 1)),
         "is_pad": np.zeros((0, 4), dtype=bool)},
    ],
)  # fmt: skip
def test_shapes_that_do_not_agree_are_refused(changes):
    with pytest.raises(ContractError, match="training windows"):
        windows(**changes)


@pytest.mark.parametrize("name", ["observations", "actions"])
def test_not_a_number_is_named(name):
    values = getattr(windows(), name).copy()
    values[1, 2, 0] = np.inf
    with pytest.raises(NonFiniteError, match=name):
        windows(**{name: values})


def horizons(observations, actions):
    return HorizonConfig(
        observation_horizon=observations, prediction_horizon=actions, execution_horizon=1,
        action_period_s=0.05,
    )  # fmt: skip


def test_shortening_keeps_the_newest_observations_and_the_first_actions():
    short = windows().shortened(horizons(2, 3))
    assert short.observations[0].tolist() == [[2, 3], [4, 5]]
    assert short.actions[1, :, 0].tolist() == [4, 5, 6] and not short.is_pad.any()
    for too_long in (horizons(4, 3), horizons(2, 5)):
        with pytest.raises(ContractError, match="at least"):
            windows().shortened(too_long)


def test_a_batch_is_normalised_and_padding_weighs_nothing():
    statistics = Normalisation(
        MinMax(np.array([0.0, 1.0]), np.array([10.0, 11.0])), MinMax(np.zeros(1), np.full(1, 7.0))
    )
    batch = as_batch(windows(), statistics, mask_padding=True, device="cpu")
    assert batch.observations[0, 0].tolist() == [-1.0, -1.0]
    assert batch.observations[1, 2].tolist() == [1.0, 1.0]
    assert float(batch.actions.min()) == -1.0 and float(batch.actions.max()) == 1.0
    assert batch.weight[0, :, 0].tolist() == [1.0, 1.0, 1.0, 0.0]
    whole = as_batch(windows(), statistics, mask_padding=False, device="cpu")
    assert float(whole.weight.min()) == 1.0
    other = Normalisation(statistics.action, statistics.action)
    with pytest.raises(ContractError, match="normalisation"):
        as_batch(windows(), other, mask_padding=True, device="cpu")
