"""Simpler policies: would one of them, or one changed factor, have done without a generator?

Chunking alone removes the mean action; a latent answers no observation; another encoder, trunk or
history would have done; a simple policy covers the modes. Each is one number with its interval.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from gates.bounds import counted_interval, share_interval
from gates.claim import SHOWN, trainings
from gates.criterion import Measured, criterion
from gates.evidence import Array, Evidence, MissingEvidenceError, numbers
from gates.need.held import require_asked, require_latent, require_variant, unmatched_baselines
from gates.need.settings import (
    MEASURED,
    MEASURED_FACTORS,
    TRAINED_FACTORS,
    NeedSettings,
)
from gates.recount import AtLeast, Subset, Term, all_hold, is_one, part_said, part_share
from gates.report import Recount
from gates.words import length, number, percent, three
from genpolicy.evidence.documents.given import VARIANTS, TrainedVariant
from genpolicy.evidence.documents.need import LATENT
from genpolicy.evidence.rows.need import FactorModeRow, ModeRow

MODES = f"{MEASURED}/modes.parquet"
FACTOR_MODES = f"{MEASURED_FACTORS}/modes.parquet"
TWO_MODES = AtLeast("modes_present", 2)
"""Of a situation: the demonstrations parted in it."""
VALID = (AtLeast("admissible", "samples"), AtLeast("modes_covered", 1))
"""Of a situation: every sample passes all six layers, and some mode is reached."""


@criterion(
    "<=",
    question="Are the simpler policies frozen under one configuration?",
    look_at="Baselines: configurations differ in more than the head; retrain them matched.",
)
def baselines_matched(evidence: Evidence, settings: NeedSettings) -> Measured:
    """Settings in which the baselines differ although nothing allows it."""
    found = unmatched_baselines(evidence, settings)
    return replace(found, counted=f"all {len(settings.baselines)} simpler policies")


@criterion(
    "<=",
    question="Does chunking alone remove the mean action?",
    look_at="Baselines: temporal context was missing, not a density; keep chunked BC.",
)
def chunking_valid_share(evidence: Evidence, settings: NeedSettings) -> Measured:
    """Upper bound of the share of situations in which the chunked baseline acts validly."""
    method = settings.chunked_baseline
    deployed = is_one("convention", *settings.deployed_conventions)
    rows = evidence.of(MODES, ModeRow, method)
    require_asked(evidence, rows, method, settings, table=MODES)
    found = valid_share(MODES, rows, deployed, confidence=settings.confidence)
    text = (
        f"an admissible chunk of {method} reaches a mode in {found.said}; upper bound over "
        f"{number(found.episodes)} episodes"
    )
    return found.measured(text)


@criterion(
    "<=",
    question="Does the cheapest remedy act validly where the modes part?",
    look_at="Baselines: another training loss, or plain noise, is enough; take that policy.",
    always=True,
)
def remedy_valid_share(evidence: Evidence, settings: NeedSettings) -> Measured:
    """Upper bound of the best share of situations in which a remedy acts validly.

    With as many redraws as everybody: of a situation counts the chance that the first of its
    samples that is admissible exists and reaches a mode.
    """
    absent = sorted({*settings.remedies, settings.one_mode} - set(settings.baselines))
    if absent:
        raise MissingEvidenceError(f"not trained: {', '.join(absent)}")
    # As many chances to look valid as there are remedies: the level is divided among them.
    confidence = 1.0 - (1.0 - settings.confidence) / len(settings.remedies)
    bounds = []
    subset = Subset(MODES, (is_one("convention", *settings.deployed_conventions), TWO_MODES))
    seeds: set[int] = set()
    for method in (*settings.remedies, settings.one_mode):
        stated = evidence.of(MODES, ModeRow, method)
        require_asked(evidence, stated, method, settings, table=MODES)
        rows = subset.of(stated)
        if len(rows) == 0:
            raise MissingEvidenceError(f"no two-mode situation was given to {method} as deployed")
        share, lower, upper = share_interval(
            redrawn_validity(rows, redraws=settings.redraws),
            list(rows["episode_uuid"]),
            confidence=confidence,
            favourable=False,
        )
        bounds.append((upper, lower, share, method, rows))
        seeds |= set(rows["seed"])
    *judged, shown = bounds
    upper, lower, share, method, rows = max(judged, key=lambda one: one[:4])
    each = ", ".join(f"{name} {percent(value)}" for _, _, value, name, _ in judged)
    episodes = rows["episode_uuid"].nunique()
    text = (
        f"share of {number(len(rows))} situations in which the first admissible of "
        f"{settings.redraws} candidates is valid: {each}, {trainings(len(seeds))}; upper bound of "
        f"{method} over {number(episodes)} episodes, level divided among the remedies; "
        f"{shown[3]} in {percent(shown[2])} ({SHOWN}: with one valid mode it stays valid, and what "
        "it loses shows in motion, at Gate D)"
    )
    counted = f"{episodes} episodes"
    recount = subset.counted(rows)
    return Measured(upper, (lower, upper), text, counted=counted, recount=recount, point=share)


def redrawn_validity(rows: pd.DataFrame, *, redraws: int) -> Array:
    """Chance that the first admissible of some candidates exists and reaches a mode. Shape (n,).

    The candidates are a random choice of the samples of the situation: with S samples, A of them
    admissible and V of those in a mode, V / A times one minus C(S - A, R) / C(S, R).
    """
    samples, passed, valid = (numbers(rows, name) for name in ("samples", "admissible", "valid"))
    if np.any(passed > samples) or np.any(valid > passed) or np.any(valid < 0):
        raise MissingEvidenceError("valid samples are no part of the admissible ones")
    none = [
        math.comb(int(s - a), min(redraws, int(s))) / math.comb(int(s), min(redraws, int(s)))
        for s, a in zip(samples, passed, strict=True)
    ]
    chance: Array = (1.0 - np.array(none)) * valid / np.maximum(passed, 1.0)
    return chance


@dataclass(frozen=True)
class ValidShare:
    """Share of two-mode situations with valid samples only.

    Attributes:
        lower: Lower end of its interval over episodes.
        upper: Upper end.
        episodes: Of the situations.
        recount: The situations, and those with valid samples only.
    """

    lower: float
    upper: float
    episodes: int
    recount: Recount

    @property
    def share(self) -> float:
        """The share itself."""
        return part_share(self.recount)

    @property
    def said(self) -> str:
        """The same with its counts."""
        return part_said(self.recount, "situations")

    def measured(self, text: str) -> Measured:
        """Its upper end, which is what is judged; with a sentence of it."""
        return Measured(
            self.upper,
            (self.lower, self.upper),
            text,
            counted=f"{self.episodes} episodes",
            recount=self.recount,
            point=self.share,
        )


def valid_share(table: str, rows: pd.DataFrame, of: Term, *, confidence: float) -> ValidShare:
    """Share of two-mode situations with valid samples only, its interval, and what it is of.

    Valid: every sample passes all six layers, none lies between modes, some mode is reached.

    Args:
        table: Path of the table.
        rows: Its rows.
        of: Which of them are asked about.
        confidence: Coverage of the interval.

    Raises:
        MissingEvidenceError: No situation with two modes.
    """
    subset = Subset(table, (of, TWO_MODES))
    rows = subset.of(rows)
    if len(rows) == 0:
        raise MissingEvidenceError("no situation with two modes was given to the policy")
    _, lower, upper = share_interval(
        all_hold(VALID, rows), list(rows["episode_uuid"]), confidence=confidence, favourable=False
    )
    episodes = rows["episode_uuid"].nunique()
    return ValidShare(lower, upper, episodes, subset.counted(rows, *VALID))


@criterion(
    "<=",
    question="Do ACT's samples depend on the observation beyond chance?",
    look_at="Baselines: train or tune the latent baseline anew, or record more episodes to tell.",
)
def latent_dependence_p(evidence: Evidence, settings: NeedSettings) -> Measured:
    """Upper end of the p-value that a latent's effect is unrelated to the observation.

    A test that does not reject shows nothing: it is held against the latent only where what the
    latent changes is the same in every situation. Otherwise nothing can be said.
    """
    method = settings.latent_baseline
    level = settings.limits.number("latent_dependence_p", otherwise=0.0)
    entries = [entry for entry in evidence.document(MEASURED, LATENT) if entry.method == method]
    if not entries:
        raise MissingEvidenceError(f"{MEASURED}/{LATENT.file} has no test of {method}")
    require_latent(evidence, entries, settings)
    found = []
    for entry in entries:
        ends = counted_interval(entry.exceeding, entry.permutations, confidence=settings.confidence)
        shown = entry.same_everywhere and ends[1] > level
        found.append((shown, ends[1], ends, entry))
    # A style that is shown decides; then the test that is furthest from rejecting.
    shown, upper, interval, worst = max(found, key=lambda item: item[:2])
    text = (
        f"the latent of {method}, drawn by {worst.convention}, moves chunks by "
        f"{length(worst.spread_m)}, of which {percent(worst.condition_share)} (squared) differs "
        f"between {number(worst.situations)} situations; distance correlation with the observation "
        f"{three(worst.distance_correlation)}; p-value of this training, with the interval that "
        f"{number(worst.permutations)} permutations leave"
    )
    counted = f"{worst.situations} situations"
    if upper > level and not shown:
        undecided = f"not decided, neither a strategy nor a style: {text}"
        return Measured(None, interval, undecided, counted=counted)
    return Measured(upper, interval, text, counted=counted)


@criterion(
    "<=",
    question="Was each factor changed alone?",
    look_at="Baselines: a variant changes more than its factor, so nothing is separated.",
)
def factors_isolated(evidence: Evidence, settings: NeedSettings) -> Measured:
    """Settings in which a variant differs from the reference beyond its own factor."""
    variants = _variants(evidence)
    bad = [
        f"{name}.{key}"
        for name, item in variants.items()
        for key in item.changed
        if key not in item.allowed
    ]
    missing = sorted(set(settings.factors) - {item.factor for item in variants.values()})
    if missing:
        raise MissingEvidenceError(f"no variant changes {', '.join(missing)}")
    text = "; ".join(bad) or f"{len(variants)} variants, each with one factor changed"
    return Measured(float(len(bad)), caveat=text, counted=f"all {len(variants)} variants")


@criterion(
    "<=",
    question="Does another encoder, history or trunk alone remove the mean action?",
    look_at="Baselines: the conditioning was too poor; take that encoder, history or trunk.",
)
def factor_valid_share(evidence: Evidence, settings: NeedSettings) -> Measured:
    """Upper bound of the best valid share of a variant that changes no head and no horizon."""
    frame = evidence.rows(FACTOR_MODES, FactorModeRow)
    names = [
        name
        for name, item in _variants(evidence).items()
        if item.factor in settings.conditioning_factors
    ]
    if not names:
        raise MissingEvidenceError("no variant changes the encoder, the history or the trunk")
    for name in names:
        own = frame[frame["variant"] == name]
        require_variant(evidence, own, name, settings, table=FACTOR_MODES)
    # As many chances to look valid as there are variants: the level is divided among them.
    confidence = 1.0 - (1.0 - settings.confidence) / len(names)
    found = {
        name: valid_share(FACTOR_MODES, frame, is_one("variant", name), confidence=confidence)
        for name in names
    }
    name = max(found, key=lambda one: (found[one].upper, found[one].lower, found[one].share, one))
    best = found[name]
    text = (
        f"largest of {len(names)} variants ({', '.join(names)}): {name} acts validly in "
        f"{best.said}; upper bound over {number(best.episodes)} episodes, level divided among the "
        "variants; short training"
    )
    return best.measured(text)


def _variants(evidence: Evidence) -> dict[str, TrainedVariant]:
    variants = evidence.document(TRAINED_FACTORS, VARIANTS).variants
    if not variants:
        raise MissingEvidenceError(f"{TRAINED_FACTORS}/{VARIANTS.file} lists no variants")
    return variants
