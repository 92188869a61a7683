"""Normalisation, as the policies use it; defined with the contracts, shared with the dataset."""

from genpolicy.contract.normalisation import SMALLEST_RANGE, MinMax, Normalisation

__all__ = ["SMALLEST_RANGE", "MinMax", "Normalisation"]
