"""Normalisation: there and back, constants, refusals."""

import json

import numpy as np
import pytest

from genpolicy.errors import ContractError, NonFiniteError
from genpolicy.policies.normalisation import MinMax, Normalisation


def test_normalisation_round_trip_and_constants():
    rng = np.random.default_rng(0)
    values = rng.normal(0.0, 3.0, (50, 4))
    values[:, 2] = 0.7
    statistics = MinMax(values.min(0), values.max(0))
    normalised = statistics.normalise(values)
    assert np.all(normalised[:, 2] == 0.0)
    assert np.abs(normalised).max() == pytest.approx(1.0)
    np.testing.assert_allclose(statistics.denormalise(normalised), values, atol=1e-9)
    both = Normalisation(statistics, statistics)
    copy = Normalisation.from_json(json.loads(json.dumps(both.as_json())))
    assert np.array_equal(copy.action.minimum, statistics.minimum)
    with pytest.raises(NonFiniteError):
        MinMax(np.array([np.nan]), np.array([1.0]))
    with pytest.raises(ContractError):
        Normalisation.from_json({"observation": {}})
