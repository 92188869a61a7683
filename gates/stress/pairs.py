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


def success_by_start(
    evidence: Evidence, settings: StressSettings, method: str
) -> "pd.Series[float]":
    """Mean success of a method per start, over conditions and training seeds, in start order."""
    rows = rollouts(evidence, settings, method)
    rows = rows.assign(success=flags(rows, "success").astype(np.float64))
    means = rows.groupby(["start", "perturbation"])["success"].mean()
    return means.groupby("start").mean().sort_index()
