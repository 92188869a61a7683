"""Modes at the chosen NFE: does every one get samples that may be executed, what lies outside?"""

import numpy as np
import pandas as pd

from gates.bounds import share_interval
from gates.criterion import Measured, criterion
from gates.evidence import Evidence, MissingEvidenceError, counts, numbers
from gates.reproducibility.settings import MODES, ReproducibilitySettings, chosen_nfe
from genpolicy.evidence.rows.need import ModeRow


@criterion(
    ">=",
    question="Does every mode get its share of admissible samples?",
    look_at="Sampler: modes are lost at this NFE; look at the coverage curve and at training.",
    per_candidate=True,
)
def mode_coverage_lower(
    evidence: Evidence, settings: ReproducibilitySettings, candidate: str
) -> Measured:
    """Lower bound of the share of situations of which every mode gets admissible samples enough."""
    found = []
    for _, rows in situations_of(evidence, candidate).groupby("seed"):
        drawn, fewest = numbers(rows, "samples"), numbers(rows, "fewest_admissible")
        hits = fewest >= settings.mode_minimum_share * drawn
        # There is one situation per episode and phase: those of one episode are one draw.
        _, lower, upper = share_interval(
            hits, list(rows["episode_uuid"]), confidence=settings.confidence, favourable=True
        )
        reached = float((numbers(rows, "modes_covered") >= numbers(rows, "modes_present")).mean())
        found.append((lower, upper, hits, rows, reached))
    lower, upper, hits, rows, reached = min(found, key=lambda seed: seed[0])
    episodes = rows["episode_uuid"].nunique()
    text = (
        f"in {hits.sum()} of {len(rows)} two-mode situations every mode gets at least "
        f"{settings.mode_minimum_share:g} of the samples, admissible; "
        f"one sample, whether or not it may be executed, reaches every mode in {reached:.4g}; "
        f"lower bound over {episodes} episodes"
    )
    share = float(hits.mean())
    counted = f"{episodes} episodes"
    return Measured(lower, (lower, upper), text, counted=counted, point=share)


@criterion(
    "<=",
    question="What share of the samples lies in no mode?",
    look_at="Sampler: samples between the modes are where nobody went; look at training and NFE.",
    per_candidate=True,
)
def outside_modes_upper(
    evidence: Evidence, settings: ReproducibilitySettings, candidate: str
) -> Measured:
    """Upper bound of the share of samples between two modes, or far from all of them."""
    found = []
    for _, rows in situations_of(evidence, candidate).groupby("seed"):
        between, far = counts(rows, "between_modes"), counts(rows, "far_from_modes")
        share, lower, upper = share_interval(
            (between + far) / numbers(rows, "samples"),
            list(rows["episode_uuid"]),
            confidence=settings.confidence,
            favourable=False,
        )
        sizes = (len(rows), rows["episode_uuid"].nunique())
        found.append((upper, lower, share, float(far.sum()), sizes))
    upper, lower, share, far_away, (situations, episodes) = max(found)
    text = (
        f"share {share:.4g} over {situations} two-mode situations, {far_away:g} samples far from "
        "every mode; upper bound over episodes"
    )
    counted = f"{episodes} episodes"
    return Measured(upper, (lower, upper), text, counted=counted, point=share)


def situations_of(evidence: Evidence, candidate: str, *, table: str = MODES) -> pd.DataFrame:
    """Two-mode situations as the candidate answered them at the NFE that it records.

    Raises:
        MissingEvidenceError: Without samples, or at another NFE.
    """
    rows = evidence.of(table, ModeRow, candidate)
    if not np.all(numbers(rows, "samples") > 0):
        raise MissingEvidenceError("a situation without samples")
    least, most = chosen_nfe(evidence, candidate)
    nfe = numbers(rows, "nfe")
    if not np.all((nfe >= least) & (nfe <= most)):
        raise MissingEvidenceError("modes were not counted at the chosen NFE")
    return rows
