"""What Gate A holds against the need: the simpler explanations of a mean that fails (chapter 1.2).

Chunking alone removes it; the task phase collapses the modes; a latent answers no observation;
another encoder, trunk or history would have done. Each is one number with its interval.
"""

import pandas as pd

from gates.bounds import counted_interval, share_interval
from gates.engine import Case, Measured
from gates.evidence import MissingEvidenceError, number, numbers
from gates.need import AUDIT, BASELINES

FACTORS = "artifacts/factors"
LATENT = f"{BASELINES}/latent.json"
VARIANTS = f"{FACTORS}/factors.json"
MODE_COLUMNS = ("modes_present", "modes_covered", "samples", "admissible", "episode_uuid")


def chunking_valid(case: Case) -> Measured:
    """Upper bound of the share of situations in which the chunked baseline acts validly."""
    method = case.params.chunked_baseline
    path = f"{BASELINES}/modes.parquet"
    rows = case.evidence.of(path, method, "convention", *MODE_COLUMNS)
    rows = rows[rows["convention"].isin(case.params.deployed_conventions)]
    share, lower, upper, count = valid_share(rows, confidence=case.params.confidence)
    text = (
        f"{method} reaches a mode with an admissible chunk in {share:.4g} of {count} situations; "
        "upper bound over episodes"
    )
    return Measured(upper, (lower, upper), text)


def valid_share(rows: pd.DataFrame, *, confidence: float) -> tuple[float, float, float, int]:
    """Share of two-mode situations with valid samples only, its interval, and how many there are.

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
    return share, lower, upper, len(rows)


def phase_collapse(case: Case) -> Measured:
    """Upper bound of the share of episodes whose modes the task phase takes away."""
    document = case.evidence.document(f"{AUDIT}/summary.json")
    without, seen = number(document, "modes_without_phase"), number(document, "modes_with_phase")
    if without == 0:
        return Measured(0.0, caveat="no episode has modes without the phase")
    lost = max(0.0, without - seen)
    interval = counted_interval(lost, without, confidence=case.params.confidence)
    text = (
        f"episodes with modes: {without:g} without the phase, {seen:g} with it; upper bound. With "
        "one phase only both are the same, because there is nothing to look at"
    )
    return Measured(interval[1], interval, text)


def latent_dependence(case: Case) -> Measured:
    """Upper end of the p-value that a latent's effect is unrelated to the observation."""
    method = case.params.latent_baseline
    entries = [
        entry
        for entry in case.evidence.listing(LATENT)
        if isinstance(entry, dict) and entry.get("method") == method
    ]
    if not entries:
        raise MissingEvidenceError(f"{LATENT} has no test of {method}")
    found = []
    for entry in entries:
        trials, exceeding = number(entry, "permutations"), number(entry, "exceeding")
        ends = counted_interval(exceeding, trials, confidence=case.params.confidence)
        found.append((ends, entry))
    interval, worst = max(found, key=lambda item: item[0][1])
    unit = 1000.0 * number(worst, "spread_m")
    text = (
        f"{method} drawn by {worst.get('convention')}: its latent moves chunks by {unit:.3g} mm, "
        f"of which {100 * number(worst, 'condition_share'):.3g} % (squared) differs between "
        f"{number(worst, 'situations'):g} situations; distance correlation with the observation "
        f"{number(worst, 'distance_correlation'):.3g}; p-value with the interval of "
        f"{number(worst, 'permutations'):g} permutations"
    )
    return Measured(interval[1], interval, text)


def factors_isolated(case: Case) -> Measured:
    """Settings in which a variant differs from the reference beyond its own factor."""
    variants = _variants(case)
    bad, factors = [], set()
    for name, item in variants.items():
        changed, allowed = item.get("changed"), item.get("allowed")
        if not isinstance(changed, list) or not isinstance(allowed, list):
            raise MissingEvidenceError(f"{VARIANTS} does not compare {name}")
        factors.add(str(item.get("factor")))
        bad += [f"{name}.{key}" for key in changed if key not in allowed]
    missing = sorted(set(case.params.factors) - factors)
    if missing:
        raise MissingEvidenceError(f"no variant changes {', '.join(missing)}")
    text = "; ".join(bad) or f"{len(variants)} variants, each with one factor changed"
    return Measured(float(len(bad)), caveat=text)


def factor_valid(case: Case) -> Measured:
    """Upper bound of the best valid share of a variant that changes no head and no horizon."""
    path = f"{FACTORS}/modes.parquet"
    frame = case.evidence.frame(path, "variant", "seed", *MODE_COLUMNS)
    names = [
        name
        for name, item in _variants(case).items()
        if item.get("factor") in case.params.conditioning_factors
    ]
    if not names:
        raise MissingEvidenceError("no variant changes the encoder, the history or the trunk")
    # As many chances to look valid as there are variants: the level is divided among them.
    confidence = 1.0 - (1.0 - case.params.confidence) / len(names)
    bounds = []
    for name in names:
        rows = frame[frame["variant"] == name]
        share, lower, upper, _ = valid_share(rows, confidence=confidence)
        bounds.append((upper, lower, share, name))
    upper, lower, share, name = max(bounds)
    text = (
        f"largest of {len(names)} variants ({', '.join(names)}), {name} with {share:.4g}; upper "
        "bound over episodes, level divided among the variants; short training"
    )
    return Measured(upper, (lower, upper), text)


def _variants(case: Case) -> dict[str, dict[str, object]]:
    variants = case.evidence.document(VARIANTS).get("variants")
    if not isinstance(variants, dict) or not variants:
        raise MissingEvidenceError(f"{VARIANTS} lists no variants")
    return variants
