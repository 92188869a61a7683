"""Simpler policies: would one of them, or one changed factor, have done without a generator?

Chunking alone removes the mean action; a latent answers no observation; another encoder, trunk or
history would have done; a simple policy covers the modes. Each is one number with its interval.
"""

import math

import numpy as np
import pandas as pd

from gates.bounds import counted_interval, share_interval
from gates.criterion import Measured, criterion
from gates.evidence import Array, Evidence, MissingEvidenceError, counts, numbers
from gates.may_differ import unmatched
from gates.need.settings import (
    MEASURED,
    MEASURED_FACTORS,
    TRAINED,
    TRAINED_FACTORS,
    NeedSettings,
)
from genpolicy.evidence.documents.given import VARIANTS, TrainedVariant
from genpolicy.evidence.documents.need import LATENT
from genpolicy.evidence.rows.need import FactorModeRow, ModeRow

MODES = f"{MEASURED}/modes.parquet"


@criterion(
    "<=",
    question="Are the simpler policies frozen under one configuration?",
    look_at="Baselines: configurations differ in more than the head; retrain them matched.",
)
def baselines_matched(evidence: Evidence, settings: NeedSettings) -> Measured:
    """Settings in which the baselines differ although nothing allows it."""
    return unmatched(evidence, TRAINED, settings.baselines, settings.may_differ)


@criterion(
    "<=",
    question="Does chunking alone remove the mean action?",
    look_at="Baselines: temporal context was missing, not a density; keep chunked BC.",
)
def chunking_valid_share(evidence: Evidence, settings: NeedSettings) -> Measured:
    """Upper bound of the share of situations in which the chunked baseline acts validly."""
    method = settings.chunked_baseline
    rows = evidence.of(MODES, ModeRow, method)
    rows = rows[rows["convention"].isin(settings.deployed_conventions)]
    share, lower, upper, (count, episodes) = valid_share(rows, confidence=settings.confidence)
    text = (
        f"{method} reaches a mode with an admissible chunk in {share:.4g} of {count} situations; "
        "upper bound over episodes"
    )
    return _bounded(share, (lower, upper), text, episodes)


@criterion(
    "<=",
    question="Does the cheapest remedy act validly where the modes part?",
    look_at="Baselines: an error of another power, or plain noise, is enough; take it.",
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
    for method in (*settings.remedies, settings.one_mode):
        rows = evidence.of(MODES, ModeRow, method)
        rows = rows[rows["convention"].isin(settings.deployed_conventions)]
        rows = rows[numbers(rows, "modes_present") >= 2]
        if len(rows) == 0:
            raise MissingEvidenceError(f"no two-mode situation was given to {method} as deployed")
        share, lower, upper = share_interval(
            redrawn_validity(rows, redraws=settings.redraws),
            list(rows["episode_uuid"]),
            confidence=confidence,
            favourable=False,
        )
        sizes = (len(rows), rows["episode_uuid"].nunique())
        bounds.append((upper, lower, share, method, sizes))
    *judged, shown = bounds
    upper, lower, share, method, (count, episodes) = max(judged)
    each = ", ".join(f"{name} {value:.3g}" for _, _, value, name, _ in judged)
    text = (
        f"{method} with {share:.4g} of {count} situations, {settings.redraws} candidates each "
        f"({each}); upper bound over episodes, level divided among the remedies; "
        f"{shown[3]} {shown[2]:.3g} (shown, not judged: with one valid mode it stays valid, and "
        "what it loses shows in motion, at Gate D)"
    )
    return _bounded(share, (lower, upper), text, episodes)


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


def valid_share(
    rows: pd.DataFrame, *, confidence: float
) -> tuple[float, float, float, tuple[int, int]]:
    """Share of two-mode situations with valid samples only, its interval, and what it is of.

    Returns:
        Share, lower end, upper end, and the numbers of situations and of their episodes.

    Valid: every sample passes all six layers, none lies between modes, some mode is reached.

    Raises:
        MissingEvidenceError: No situation with two modes.
    """
    rows = rows[numbers(rows, "modes_present") >= 2]
    if len(rows) == 0:
        raise MissingEvidenceError("no situation with two modes was given to the policy")
    passed = numbers(rows, "admissible") >= numbers(rows, "samples")
    valid = passed & (numbers(rows, "modes_covered") >= 1)
    share, lower, upper = share_interval(
        valid, list(rows["episode_uuid"]), confidence=confidence, favourable=False
    )
    return share, lower, upper, (len(rows), rows["episode_uuid"].nunique())


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
    found = []
    for entry in entries:
        ends = counted_interval(entry.exceeding, entry.permutations, confidence=settings.confidence)
        shown = entry.same_everywhere and ends[1] > level
        found.append((shown, ends[1], ends, entry))
    # A style that is shown decides; then the test that is furthest from rejecting.
    shown, upper, interval, worst = max(found, key=lambda item: item[:2])
    text = (
        f"{method} drawn by {worst.convention}: its latent moves chunks by "
        f"{1000.0 * worst.spread_m:.3g} mm, "
        f"of which {100 * worst.condition_share:.3g} % (squared) differs between "
        f"{worst.situations} situations; distance correlation with the observation "
        f"{worst.distance_correlation:.3g}; p-value of this training, with the interval that "
        f"{worst.permutations} permutations leave"
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
    return Measured(float(len(bad)), caveat=text)


@criterion(
    "<=",
    question="Does another encoder, history or trunk alone remove the mean action?",
    look_at="Baselines: the conditioning was too poor; take that encoder, history or trunk.",
)
def factor_valid_share(evidence: Evidence, settings: NeedSettings) -> Measured:
    """Upper bound of the best valid share of a variant that changes no head and no horizon."""
    frame = evidence.rows(f"{MEASURED_FACTORS}/modes.parquet", FactorModeRow)
    names = [
        name
        for name, item in _variants(evidence).items()
        if item.factor in settings.conditioning_factors
    ]
    if not names:
        raise MissingEvidenceError("no variant changes the encoder, the history or the trunk")
    # As many chances to look valid as there are variants: the level is divided among them.
    confidence = 1.0 - (1.0 - settings.confidence) / len(names)
    bounds = []
    for name in names:
        rows = frame[frame["variant"] == name]
        share, lower, upper, (_, episodes) = valid_share(rows, confidence=confidence)
        bounds.append((upper, lower, share, name, episodes))
    upper, lower, share, name, episodes = max(bounds)
    text = (
        f"largest of {len(names)} variants ({', '.join(names)}), {name} with {share:.4g}; upper "
        "bound over episodes, level divided among the variants; short training"
    )
    return _bounded(share, (lower, upper), text, episodes)


def _bounded(share: float, ends: tuple[float, float], text: str, episodes: int) -> Measured:
    """An upper bound of a share over episodes."""
    return Measured(ends[1], ends, text, counted=f"{episodes} episodes", point=share)


def _variants(evidence: Evidence) -> dict[str, TrainedVariant]:
    variants = evidence.document(TRAINED_FACTORS, VARIANTS).variants
    if not variants:
        raise MissingEvidenceError(f"{TRAINED_FACTORS}/{VARIANTS.file} lists no variants")
    return variants


@criterion(
    "<=",
    question="Does the best simple policy lose modes?",
    look_at="Baselines: a simple policy already covers the modes; keep it.",
)
def baseline_mode_coverage(evidence: Evidence, settings: NeedSettings) -> Measured:
    """Mode coverage of the best baseline as it is deployed; a mode counts by admissible samples.

    What a baseline covers when its latent is drawn stands in the caveat: drawn from, it is a
    generator itself and has to pass the gates like any other candidate. Wide scatter reaches
    modes by chance, so the share of its samples that pass all six layers stands beside it.
    """
    deployed: list[tuple[float, str]] = []
    drawn: list[tuple[float, str]] = []
    admissible: dict[str, float] = {}
    for method in settings.baselines:
        rows = evidence.of(MODES, ModeRow, method)
        rows = rows[numbers(rows, "modes_present") >= 2]
        generative = method in settings.generative_baselines
        if not (generative or rows["convention"].isin(settings.deployed_conventions).any()):
            raise MissingEvidenceError(f"no two-mode situation was given to {method} as deployed")
        share = counts(rows, "modes_valid") / numbers(rows, "modes_present")
        means = rows.assign(share=share).groupby("convention")["share"].mean()
        for name, value in means.items():
            fixed = name in settings.deployed_conventions and not generative
            into = deployed if fixed else drawn
            into.append((float(value), f"{method}, {name}"))
            own = rows[rows["convention"] == name]
            passed = numbers(own, "admissible").sum() / numbers(own, "samples").sum()
            admissible[f"{method}, {name}"] = float(passed)
    if not deployed:
        raise MissingEvidenceError("no baseline is judged as it is deployed")
    best, name = max(deployed)
    text = f"best of {len(deployed)} deployed conventions, by {name}"
    if drawn:
        text += "; drawn at random, as a generator: " + ", ".join(
            f"{who} {value:.3g} ({admissible[who]:.0%} of samples admissible)"
            for value, who in sorted(drawn, reverse=True)
        )
    return Measured(best, caveat=text)
