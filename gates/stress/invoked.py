"""Invocations of the matched comparison: as many as the rollouts state, of every method alike."""

import pandas as pd

from gates.evidence import Evidence, MissingEvidenceError, numbers
from gates.stress.rollouts import INVOCATIONS, StressSettings, rollouts
from genpolicy.evidence.rows.stress import InvocationRow

INVOKED = "invocations"
"""The column of rollouts that counts them."""
ROLLOUT = ["seed", "perturbation", "start"]


def invocations(evidence: Evidence, settings: StressSettings, method: str) -> pd.DataFrame:
    """Invocations of a method, those of each planned rollout among them; do not write into them.

    Raises:
        MissingEvidenceError: As `rollouts`, the method has no rows, or a rollout states another
            number than is recorded.
    """
    planned = (settings.perturbations, settings.planned_starts, settings.block)
    key = ("invocations", method, *planned)
    return evidence.once(key, lambda: _invocations(evidence, settings, method))


def _invocations(evidence: Evidence, settings: StressSettings, method: str) -> pd.DataFrame:
    rows = evidence.of(INVOCATIONS, InvocationRow, method)
    recorded = rows.groupby(ROLLOUT)["invocation"].nunique().to_dict()
    rolled = rollouts(evidence, settings, method)
    keys = zip(*(rolled[name] for name in ROLLOUT), strict=True)
    for (seed, condition, start), stated in zip(keys, numbers(rolled, INVOKED), strict=True):
        if (found := recorded.get((seed, condition, start), 0)) != stated:
            raise MissingEvidenceError(
                "rollouts state other numbers of invocations than are recorded: rollout "
                f"{method}, {condition}, start {start} states {stated:g}, recorded are {found}"
            )
    return rows
