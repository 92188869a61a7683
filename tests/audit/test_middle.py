"""The median along the first axis is NumPy's, to the bit."""

import numpy as np
import pytest

from genpolicy.audit.middle import middle
from genpolicy.seeds import stream


@pytest.mark.parametrize("shape", [(1,), (2,), (7,), (12,), (5, 3), (8, 2, 2)])
def test_it_is_the_median_of_numpy(shape):
    rng = stream(1, "middle")
    for values in (rng.normal(size=shape), rng.integers(0, 3, size=shape).astype(float) / 3.0):
        before = values.copy()
        assert np.array_equal(middle(values), np.median(values, axis=0))
        assert np.array_equal(values, before)
