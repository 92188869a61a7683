"""Over what an abort threshold is counted: a share says nothing until it is said of how many.

Shares of answers and ticks are counted over as many as one simulated trial has, shares of trials
over the last trials; and never over so few that a single one would end it. How often such a window
would have ended the candidate's own rollouts inside the envelope is counted beside it: a threshold
that ends what was promoted is no threshold.
"""

import math
from collections.abc import Mapping
from typing import Literal

import numpy as np
import pandas as pd
from pydantic import Field

from gates.evidence import Array, Evidence, MissingEvidenceError, counts, numbers
from gates.report import StrictModel
from gates.stress.cost import STOPS
from gates.stress.rollouts import ROLLOUTS
from genpolicy.errors import IntegrityError
from genpolicy.evidence.rows.stress import RolloutRow

LATENCY = "latency_s"
PARTS = {
    "deadline_miss_share": ("deadline_misses", "invocations"),
    "hold_share": ("hold_ticks", "ticks"),
    "rejection_share": ("rejections", "invocations"),
    "fallback_share": ("fallback_ticks", "ticks"),
}
"""What a share is of what, in the columns of a rollout."""
UNITS: Mapping[str, Literal["answers", "ticks"]] = {"invocations": "answers", "ticks": "ticks"}
QUANTILE = 0.95
"""Of the latencies: so many of the answers must keep the threshold."""


class AbortWindow(StrictModel):
    """The window of one threshold.

    Attributes:
        unit: What is counted.
        count: The last so many.
        ended: Own rollouts inside the envelope (windows of them, of trials) that it would have
            ended at the proposed threshold.
        seen: Of how many; 0 where there are fewer rollouts than a window holds.
    """

    unit: Literal["answers", "ticks", "trials"]
    count: int = Field(ge=1)
    ended: int = Field(ge=0)
    seen: int = Field(ge=0)

    @property
    def over(self) -> str:
        """Over what it is counted, as a person reads it."""
        if self.count == 1:
            return f"over the last {self.unit.removesuffix('s')}"
        return f"over the last {self.count:,} {self.unit}"

    @property
    def tried(self) -> str:
        """What it would have ended."""
        if not self.seen:
            return "fewer rollouts than one window holds: not tried"
        what = "windows of its rollouts" if self.unit == "trials" else "of its rollouts"
        return f"would have ended {self.ended:,} of {self.seen:,} {what}"


def windows_of(
    evidence: Evidence, candidate: str, condition: str, thresholds: Mapping[str, float]
) -> dict[str, AbortWindow]:
    """A window for each threshold, from the rollouts inside the envelope.

    Args:
        evidence: Below the root.
        candidate: Whose rollouts.
        condition: Name of the condition that ran inside the card's envelope.
        thresholds: Proposed, by name.

    Raises:
        IntegrityError: The candidate has no rollout there, or a column is missing.
    """
    try:
        rows = evidence.of(ROLLOUTS, RolloutRow, candidate)
        rows = rows[rows["perturbation"] == condition].sort_values(["seed", "start"])
        if len(rows) == 0:
            raise MissingEvidenceError(f"{candidate} has no rollout under {condition}")
        return {name: _window(rows, name, limit) for name, limit in thresholds.items()}
    except MissingEvidenceError as error:
        raise IntegrityError(
            where=ROLLOUTS,
            found=str(error),
            expected="rollouts of the candidate inside the card's envelope",
            action="Run `dvc repro stress`.",
        ) from error


def _window(rows: pd.DataFrame, name: str, limit: float) -> AbortWindow:
    if name == LATENCY:
        # A rollout without an answer has none that came late: the share of holds tells of it.
        ended = rows["latency_p95_s"].astype(float).to_numpy() > limit
        least = math.ceil(1 / (1 - QUANTILE))
        return _of_a_trial("answers", numbers(rows, "invocations"), least, ended)
    if name in PARTS:
        part, whole = PARTS[name]
        all_of = numbers(rows, whole)
        ended = numbers(rows, part) > limit * all_of
        return _of_a_trial(UNITS[whole], all_of, _more_than_one(limit), ended)
    hit = (
        rows["outcome"].isin(STOPS) if name == "reset_share" else counts(rows, "interventions") > 0
    )
    return _of_trials(np.asarray(hit, bool), _more_than_one(limit), limit)


def _of_a_trial(
    unit: Literal["answers", "ticks"], sizes: Array, least: int, ended: np.ndarray
) -> AbortWindow:
    usual = int(np.sort(sizes)[(len(sizes) - 1) // 2])
    return AbortWindow(
        unit=unit, count=max(least, usual), ended=int(np.sum(ended)), seen=len(sizes)
    )


def _of_trials(hit: np.ndarray, count: int, limit: float) -> AbortWindow:
    """Windows one after the other, in the order of the starts: each rollout counts once."""
    whole = len(hit) // count
    shares = hit[: whole * count].reshape(whole, count).mean(axis=1)
    return AbortWindow(unit="trials", count=count, ended=int(np.sum(shares > limit)), seen=whole)


def _more_than_one(limit: float) -> int:
    """Fewest of which a single one is not more than the limit; 1 where none is allowed."""
    return max(1, math.ceil(1 / limit)) if limit > 0 else 1
