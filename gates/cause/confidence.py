"""How sure is a verdict? What resampled audits agree on, less what no resample of the data shows.

Resampled audits look where the whole one looked, so where it is blind all of them agree. On 300
recordings that the detector was not made on, 8 of the 173 verdicts that nearly every resample
shared were not right all the same; that share is taken off every confidence. And a verdict that
denies modes is no surer than the part of the way on which modes would have been found.
"""

from collections.abc import Sequence

from gates.cause.answers import CauseName, Topic
from gates.cause.numbers import Numbers
from genpolicy.audit.reach_rows import Reach

# Jeffreys' estimate of 8 of 173 that were not right: docs/audit-real.md, half of commit 096fb73.
UNSEEN = (8 + 0.5) / (173 + 1)


def confidence_of(
    verdict: CauseName, red: Topic, agreeing: tuple[int, int], numbers: Numbers
) -> float | None:
    """Confidence of a verdict; None without resamples.

    Args:
        verdict: The cause that is said.
        red: The topic that decided it.
        agreeing: How many of how many resampled audits share it.
        numbers: What was measured.
    """
    same, draws = agreeing
    if not draws:
        return None
    sure = (1.0 - UNSEEN) * same / (draws + 1)
    denies = verdict is CauseName.UNIMODAL and red is Topic.STRUCTURE
    return sure * looked_share(numbers) if denies else sure


def looked_share(numbers: Numbers) -> float:
    """Share of the situations that could be looked at, in the fifth of the way that has least.

    Both kinds of evidence count alike: neighbours say how many stand near by declared scales, what
    predicts says where modes would have been found.
    """
    kinds = [part for part in (numbers.reach, numbers.other_reach) if _asked(part)]
    shares = [
        sum(row.share for row in rows) / len(rows)
        for fifth in sorted({row.fifth for part in kinds for row in part})
        if (rows := [row for part in kinds for row in part if row.fifth == fifth and row.queries])
    ]
    return min(shares, default=numbers.counts.share)


def _asked(part: Sequence[Reach]) -> bool:
    return any(row.queries for row in part)
