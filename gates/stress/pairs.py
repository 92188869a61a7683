"""Pairs of the trial: what two methods are worth on the same start."""

import numpy as np
import pandas as pd

from gates.evidence import Array, Evidence, MissingEvidenceError
from gates.stress.rollouts import StressSettings, rollouts
from gates.stress.utility import utilities
from gates.stress.weights import by_cost


def paired_differences(
    evidence: Evidence, settings: StressSettings, method: str, baseline: str
) -> Array:
    """What `method` is worth minus what `baseline` is, per start. Shape (planned_starts,).

    Success, or utility where costs are weighed (`StressSettings.measure`).
    All conditions and seeds of a start are one draw, so that the pairs are independent.
    """
    own, other = (
        worth_by_start(evidence, settings, method),
        worth_by_start(evidence, settings, baseline),
    )
    common = own.index.intersection(other.index)[: settings.planned_starts]
    if len(common) < settings.planned_starts:
        raise MissingEvidenceError(f"only {len(common)} starts are shared with {baseline}")
    return np.asarray(own[common].to_numpy() - other[common].to_numpy(), dtype=np.float64)


def paired_by_condition(
    evidence: Evidence, settings: StressSettings, method: str, baseline: str
) -> dict[str, Array]:
    """The same in each planned condition by itself. Shape (planned_starts,) each.

    Raises:
        MissingEvidenceError: In a condition too few starts are shared.
    """
    own, other = (
        _by_start_and_condition(evidence, settings, name).unstack("perturbation").sort_index()
        for name in (method, baseline)
    )
    found = {}
    for condition in settings.perturbations:
        differences = (own[condition] - other[condition]).dropna()[: settings.planned_starts]
        if len(differences) < settings.planned_starts:
            raise MissingEvidenceError(
                f"only {len(differences)} starts are shared with {baseline} in {condition}"
            )
        found[condition] = np.asarray(differences.to_numpy(), dtype=np.float64)
    return found


def worth_by_start(evidence: Evidence, settings: StressSettings, method: str) -> "pd.Series[float]":
    """What a method is worth per start, over conditions and training seeds, in start order."""
    means = _by_start_and_condition(evidence, settings, method)
    return means.groupby("start").mean().sort_index()


def _by_start_and_condition(
    evidence: Evidence, settings: StressSettings, method: str
) -> "pd.Series[float]":
    """Mean over training seeds, by start and condition; do not write into it."""

    def made() -> "pd.Series[float]":
        rows = rollouts(evidence, settings, method)
        rows = rows.assign(worth=utilities(evidence, settings, method, rows))
        return rows.groupby(["start", "perturbation"])["worth"].mean()

    # Every pair that a method stands in asks for it, over all conditions and in each.
    weights = tuple(by_cost(settings.utility).items())
    planned = (settings.perturbations, settings.planned_starts)
    return evidence.once(("worth", method, *planned, weights, settings.longest_s), made)
