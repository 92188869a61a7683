"""Over what an abort threshold is counted: a share says nothing until it is said of how many.

Shares of answers and ticks are counted over as many as one simulated trial has, shares of trials
over the last trials; and never over so few that a single one would be more than what is proposed.
In how many of the candidate's own rollouts inside the envelope, each as a whole, the share was
above the threshold is counted beside it: what ends the policy that was promoted is no threshold.
"""

import math
from collections.abc import Mapping
from typing import Literal

import numpy as np
import pandas as pd
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from pydantic import Field

from gates.evidence import Array, Evidence, MissingEvidenceError, counts, numbers
from gates.report import StrictModel
from gates.stress.cost import STOPS
from gates.stress.rollouts import INVOCATIONS, ROLLOUTS
from genpolicy.errors import IntegrityError
from genpolicy.evidence.rows.stress import InvocationRow, RolloutRow

LATENCY = "latency_s"
KEYS = ("seed", "perturbation", "start")
MOST = 10_000
"""A share of less than one of so many is none."""
PARTS = {
    "deadline_miss_share": ("deadline_misses", "invocations"),
    "hold_share": ("hold_ticks", "ticks"),
    "rejection_share": ("rejections", "invocations"),
    "fallback_share": ("fallback_ticks", "ticks"),
}
"""What a share is of what, in the columns of a rollout."""
UNITS: Mapping[str, Literal["answers", "ticks"]] = {"invocations": "answers", "ticks": "ticks"}
LATE_SHARE = 0.05
"""Of the answers: no more may come later than the threshold; the first of a session is cold."""


class AbortWindow(StrictModel):
    """The window of one threshold.

    Attributes:
        unit: What is counted.
        count: The last so many.
        above: Own rollouts inside the envelope whose share is above what is proposed, each as a
            whole; of trials, runs of so many rollouts in the order of the starts.
        seen: Of how many; 0 where there are fewer rollouts than a run has.
    """

    unit: Literal["answers", "ticks", "trials"]
    count: int = Field(ge=1)
    above: int = Field(ge=0)
    seen: int = Field(ge=0)

    @property
    def over(self) -> str:
        """Over what it is counted, as a person reads it."""
        if self.count == 1:
            return f"over the last {self.unit.removesuffix('s')}"
        return f"over the last {self.count:,} {self.unit}"

    @property
    def tried(self) -> str:
        """Where the candidate's own rollouts stand to it."""
        if not self.seen:
            return "not tried inside the envelope, where there are fewer rollouts"
        runs = self.unit == "trials" and self.count > 1
        of = f"runs of {self.count:,} rollouts" if runs else "rollouts"
        above = f"{self.above:,}" if self.above else "none"
        return f"above what is proposed in {above} of {self.seen:,} {of} inside the envelope"


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
        rows = rows[rows["perturbation"] == condition].sort_values(list(KEYS))
        if len(rows) == 0:
            raise MissingEvidenceError(f"{candidate} has no rollout under {condition}")
        times = evidence.of(INVOCATIONS, InvocationRow, candidate)
        warm = times[(times["perturbation"] == condition) & (times["invocation"] != 0)]
        return {
            name: _of_latency(rows, warm, limit) if name == LATENCY else _window(rows, name, limit)
            for name, limit in thresholds.items()
        }
    except MissingEvidenceError as error:
        raise IntegrityError(
            where=ROLLOUTS,
            found=str(error),
            expected="rollouts of the candidate inside the card's envelope",
            action="Run `dvc repro stress`.",
        ) from error


def require_aborts(
    thresholds: Mapping[str, float],
    windows: Mapping[str, AbortWindow],
    proposed: Mapping[str, float],
    counted: Mapping[str, AbortWindow],
) -> None:
    """Refuse a draft that ends a trial otherwise than gate D and the rollouts say.

    Raises:
        IntegrityError: A threshold or a window is another one, missing, or of nothing.
    """
    for where, stated, expected in (
        ("abort_thresholds", thresholds, proposed),
        ("abort_windows", windows, counted),
    ):
        other = sorted(n for n in {*stated, *expected} if stated.get(n) != expected.get(n))
        if other:
            raise IntegrityError(
                where=f"the draft's {where}.{other[0]}",
                found=str(stated.get(other[0], "missing")),
                expected=str(expected.get(other[0], "nothing of this name")),
                action="Run `dvc repro card`, which drafts it again.",
            )


def _of_latency(rows: pd.DataFrame, warm: pd.DataFrame, limit: float) -> AbortWindow:
    """A rollout without a warm answer has none that came late: the share of holds tells of it."""
    late = warm.assign(late=numbers(warm, "latency_s") > limit).groupby(list(KEYS))["late"].mean()
    above = int(np.sum(late.to_numpy() > LATE_SHARE))
    return _of_a_trial("answers", numbers(rows, "invocations"), _more_than_one(LATE_SHARE), above)


def _window(rows: pd.DataFrame, name: str, limit: float) -> AbortWindow:
    if name in PARTS:
        part, whole = PARTS[name]
        all_of = numbers(rows, whole)
        above = int(np.sum(numbers(rows, part) > limit * all_of))
        return _of_a_trial(UNITS[whole], all_of, _more_than_one(limit), above)
    helped, stopped = counts(rows, "interventions") > 0, rows["outcome"].isin(STOPS).to_numpy()
    return _of_trials(stopped if name == "reset_share" else helped, _more_than_one(limit), limit)


def _of_a_trial(
    unit: Literal["answers", "ticks"], sizes: Array, least: int, above: int
) -> AbortWindow:
    usual = int(np.sort(sizes)[(len(sizes) - 1) // 2])
    return AbortWindow(unit=unit, count=max(least, usual), above=above, seen=len(sizes))


def _of_trials(hit: NDArray[np.bool_], count: int, limit: float) -> AbortWindow:
    """Every run of so many rollouts that follow each other in the order of the starts."""
    if len(hit) < count:
        return AbortWindow(unit="trials", count=count, above=0, seen=0)
    shares = sliding_window_view(hit, count).mean(axis=1)
    above = int(np.sum(shares > limit))
    return AbortWindow(unit="trials", count=count, above=above, seen=len(shares))


def _more_than_one(limit: float) -> int:
    """Fewest of which a single one is not more than the limit; 1 where none is allowed."""
    return max(1, math.ceil(1 / limit)) if limit > 1 / MOST else 1
