"""`latent.json`: does what a latent changes depend on the observation?"""

from dataclasses import dataclass

from genpolicy.documents.document import Count, Document


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
