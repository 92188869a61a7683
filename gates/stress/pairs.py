"""Pairs of the trial: success of two methods on the same start."""

import numpy as np
import pandas as pd

from gates.evidence import Array, Evidence, MissingEvidenceError, flags
from gates.stress.rollouts import StressSettings, rollouts


def paired_differences(
    evidence: Evidence, settings: StressSettings, method: str, baseline: str
) -> Array:
    """Success of `method` minus that of `baseline`, per start. Shape (planned_starts,).

    All conditions and seeds of a start are one draw, so that the pairs are independent.
    """
    own, other = (
        success_by_start(evidence, settings, method),
        success_by_start(evidence, settings, baseline),
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


def success_by_start(
    evidence: Evidence, settings: StressSettings, method: str
) -> "pd.Series[float]":
    """Mean success of a method per start, over conditions and training seeds, in start order."""
    means = _by_start_and_condition(evidence, settings, method)
    return means.groupby("start").mean().sort_index()


def _by_start_and_condition(
    evidence: Evidence, settings: StressSettings, method: str
) -> "pd.Series[float]":
    """Mean success over training seeds, by start and condition."""
    rows = rollouts(evidence, settings, method)
    rows = rows.assign(success=flags(rows, "success").astype(np.float64))
    return rows.groupby(["start", "perturbation"])["success"].mean()
