"""Modes at the chosen NFE: does every one get samples that may be executed, what lies outside?"""

import math

import numpy as np
import pandas as pd

from gates.bounds import share_interval
from gates.criterion import Measured, criterion
from gates.evidence import Evidence, MissingEvidenceError, counts, numbers
from gates.recount import AtLeast, Subset, is_one, part_said, part_share
from gates.reproducibility.settings import MODES, ReproducibilitySettings, chosen_nfe
from gates.situations import require_every_situation
from gates.words import number, percent, share_of
from genpolicy.evidence.rows.need import ModeRow

EVERY_MODE = AtLeast("modes_covered", "modes_present")
"""Of a situation: each of its modes is reached by some sample."""
OUTSIDE = ("between_modes", "far_from_modes")
"""Columns that count samples in no mode."""


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
    hit = AtLeast("fewest_admissible", "samples", settings.mode_minimum_share)
    for seed, rows in situations_of(evidence, settings, candidate).groupby("seed"):
        # There is one situation per episode and phase: those of one episode are one draw.
        share, lower, upper = share_interval(
            hit.holds(rows),
            list(rows["episode_uuid"]),
            confidence=settings.confidence,
            favourable=True,
        )
        reached = int(EVERY_MODE.holds(rows).sum())
        recount = _of_seed(seed).counted(rows, hit)
        found.append((lower, upper, share, recount, rows["episode_uuid"].nunique(), reached))
    lower, upper, share, recount, episodes, reached = min(found, key=lambda seed: seed[0])
    text = (
        f"in {part_said(recount, 'two-mode situations')} every mode gets "
        f"at least {percent(settings.mode_minimum_share)} of the samples, admissible; one sample, "
        f"whether or not it may be executed, reaches every mode in "
        f"{share_of(reached, recount.whole)}; lower bound over {number(episodes)} episodes"
    )
    counted = f"{episodes} episodes"
    return Measured(lower, (lower, upper), text, counted=counted, recount=recount, point=share)


def _of_seed(seed: object) -> Subset:
    return Subset(MODES, (is_one("seed", int(str(seed))),))


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
    for seed, rows in situations_of(evidence, settings, candidate).groupby("seed"):
        between, far = counts(rows, "between_modes"), counts(rows, "far_from_modes")
        share, lower, upper = share_interval(
            (between + far) / numbers(rows, "samples"),
            list(rows["episode_uuid"]),
            confidence=settings.confidence,
            favourable=False,
        )
        recount = _of_seed(seed).summed(rows, OUTSIDE, "samples")
        sizes = (float(far.sum()), len(rows), rows["episode_uuid"].nunique())
        found.append((upper, lower, share, sizes, recount))
    upper, lower, share, (far_away, situations, episodes), recount = max(
        found, key=lambda seed: seed[:4]
    )
    text = (
        f"{part_said(recount, 'samples')} in {number(situations)} "
        f"two-mode situations, {number(far_away)} of them far from every mode; upper bound over "
        f"{number(episodes)} episodes"
    )
    if not math.isclose(share, part_share(recount), abs_tol=1e-9):
        text += f"; of a mean situation {percent(share)}, which is what is bounded"
    counted = f"{episodes} episodes"
    return Measured(upper, (lower, upper), text, counted=counted, recount=recount, point=share)


def situations_of(
    evidence: Evidence, settings: ReproducibilitySettings, candidate: str, *, table: str = MODES
) -> pd.DataFrame:
    """Two-mode situations as the candidate answered them at the NFE that it records.

    Raises:
        MissingEvidenceError: Without samples, at another NFE, drawn in several ways, or not at
            every situation that the audit names.
    """
    rows = evidence.of(table, ModeRow, candidate)
    if not np.all(numbers(rows, "samples") > 0):
        raise MissingEvidenceError("a situation without samples")
    least, most = chosen_nfe(evidence, candidate)
    nfe = numbers(rows, "nfe")
    if not np.all((nfe >= least) & (nfe <= most)):
        raise MissingEvidenceError("modes were not counted at the chosen NFE")
    if rows["convention"].nunique() != 1:
        raise MissingEvidenceError(f"{table} draws {candidate} in several ways")
    planned = None if candidate in settings.brought else settings.seeds
    require_every_situation(
        evidence, rows, candidate, table=table, samples=settings.samples, seeds=planned
    )
    return rows
