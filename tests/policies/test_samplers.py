"""The counter around a network: what it counts, and where it ends."""

import pytest
import torch

from genpolicy.errors import EvaluationCapError
from genpolicy.policies.samplers import CountedNetwork


def test_nothing_is_evaluated_beyond_the_cap():
    seen = []
    counted = CountedNetwork(lambda x, time: seen.append(len(x)) or x, cap=2)
    x = torch.ones(5, 1, 1)
    for _ in range(2):
        counted(x, torch.zeros(5))
    with pytest.raises(EvaluationCapError, match=r"more than 2.*at most sampler\.nfe_cap, 2"):
        counted(x, torch.zeros(5))
    assert seen == [5, 5] and counted.nfe == 2


def test_without_a_cap_it_only_counts():
    counted = CountedNetwork(lambda x, time: x)
    for _ in range(100):
        counted(torch.ones(2, 1, 1), torch.zeros(2))
    assert counted.nfe == 100
