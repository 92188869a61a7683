"""Centre and spread of which up to half may be wrong."""

import numpy as np
import pytest

from genpolicy.audit.semantics.robust import densest_half
from genpolicy.seeds import stream


def test_the_densest_half_stays_in_one_cluster():
    rng = stream(3, "half")
    values = np.concatenate([rng.normal(size=600), 50 + rng.normal(size=500)])
    centre, spread = densest_half(values)
    assert abs(centre) < 1.0 and 0.5 < spread < 3.0
    assert densest_half(rng.normal(size=2000))[1] == pytest.approx(1.0, abs=0.15)
