"""`latent.json`: does what a latent changes depend on the observation?"""

from dataclasses import dataclass

from genpolicy.documents.document import Count, Document

ROUNDING = 1e-4
"""Deviations that differ by less than this share of their size differ by rounding."""
SMALLEST_SPREAD_M = 1e-6
"""A latent that moves no chunk by a micrometre changes nothing."""


def is_the_same(share: float, spread_m: float) -> bool:
    """Whether deviations of this size, of which so much differs between situations, are alike."""
    differs = share >= ROUNDING**2 and spread_m >= SMALLEST_SPREAD_M
    return not differs


@dataclass(frozen=True)
class Dependence:
    """How far deviations depend on observations.

    Attributes:
        situations: Situations compared.
        spread_m: Root mean square deviation of a sample's path from the situation's mean path.
        condition_share: Share of that spread (its square) that differs between situations.
        distance_correlation: Of observations and deviations, 0 to 1, not corrected for chance.
        exceeding: Permutations with at least the measured statistic.
        permutations: Permutations drawn.
    """

    situations: Count
    spread_m: float
    condition_share: float
    distance_correlation: float
    exceeding: Count
    permutations: Count

    @property
    def same_everywhere(self) -> bool:
        """Whether what the latent changes is the same in every situation, or is nothing."""
        return is_the_same(self.condition_share, self.spread_m)


@dataclass(frozen=True)
class LatentDependence(Dependence):
    """The dependence of one checkpoint.

    Attributes:
        method: The method.
        convention: How its latent was drawn.
        seed: Number of its training seed.
    """

    method: str
    convention: str
    seed: int


LATENT = Document("latent.json", list[LatentDependence])
