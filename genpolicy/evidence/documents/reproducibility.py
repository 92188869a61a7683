"""`identity.json` of reload: what pins a candidate."""

from dataclasses import dataclass

from genpolicy.documents.document import Count, Document


@dataclass(frozen=True)
class CandidateIdentity:
    """What pins a candidate, by hash; the first seed is the one that is promoted.

    Attributes:
        checkpoint: Of the first seed.
        checkpoints: Of every seed.
        config: Configuration file of every seed.
        dataset: Manifest of the dataset that it was trained on.
        normalisation: Statistics of the training split.
        seed: Root seed of each training.
        sampler: Configuration of the sampler.
        metadata_mismatches: Fields that a fresh process read otherwise, over all seeds.
        nonfinite_weights: Weights that are NaN or infinite, over all seeds.
    """

    checkpoint: str
    checkpoints: list[str]
    config: list[str]
    dataset: str
    normalisation: str
    seed: list[int]
    sampler: str
    metadata_mismatches: Count
    nonfinite_weights: Count


CANDIDATES = Document("identity.json", dict[str, CandidateIdentity])
"""By method."""
