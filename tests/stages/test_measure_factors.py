"""Stage `measure_factors`: its intervals cover as much as those that the gates judge by."""

from types import SimpleNamespace

import pytest

from genpolicy.errors import ConfigError
from stages.measure_factors import confidence_of


def test_the_confidence_is_the_one_of_all_gates():
    assert confidence_of(SimpleNamespace(raw={"confidence": 0.9, "seed": 1})) == 0.9


@pytest.mark.parametrize("raw", [{}, {"confidence": 0.4}, {"confidence": "0.9"}])
def test_another_one_is_refused(raw):
    with pytest.raises(ConfigError, match="confidence"):
        confidence_of(SimpleNamespace(raw=raw))
