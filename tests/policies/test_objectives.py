"""Losses: what padding and weights leave out."""

import torch

from genpolicy.policies.objectives import masked_mean


def test_masked_mean_counts_only_weighted_entries():
    values = torch.tensor([[[1.0, 3.0], [100.0, 100.0]]])
    assert float(masked_mean(values, torch.tensor([[[1.0], [0.0]]]))) == 2.0
