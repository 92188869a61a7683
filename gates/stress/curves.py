"""Success against severity: the curve of a method, and the severity at which it falls to half.

Shown and not judged: what is promoted is promoted by the conditions as they are planned. Starts
are the same at every size, so whole starts are drawn again for the interval of where it halves.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from gates.bounds import wide_interval
from gates.evidence import Evidence, MissingEvidenceError, flags, numbers
from gates.stress.rollouts import CURVES, NOMINAL, ROLLOUTS
from genpolicy.evidence.rows.stress import NEUTRAL, RolloutRow, SeverityRow
from genpolicy.seeds import stream

Array = NDArray[np.float64]

REDRAWS = 2000


@dataclass(frozen=True)
class Point:
    """Success at one size: nothing (nominal), or what was planned.

    Attributes:
        severity: The size.
        judged: Whether it is the one that criteria are held against.
        share: Share of rollouts that succeeded.
        lower: Lower end of its interval.
        upper: Upper end.
        starts: Initial states.
    """

    severity: float
    judged: bool
    share: float
    lower: float
    upper: float
    starts: int


@dataclass(frozen=True)
class Curve:
    """A method under one condition, from nothing on.

    Attributes:
        method: The method.
        condition: The condition.
        field: What grows.
        points: By size, rising; nominal first.
        half: Where success is half of nominal, interpolated, with its interval; infinite where it
            is beyond what was run, NaN where nothing succeeds undisturbed.
    """

    method: str
    condition: str
    field: str
    points: tuple[Point, ...]
    half: tuple[float, float, float]


def curves(
    evidence: Evidence, methods: Sequence[str], *, confidence: float, root_seed: int
) -> list[Curve]:
    """Every planned curve of some methods.

    Args:
        evidence: With `severities.parquet`.
        methods: Who is shown.
        confidence: Coverage of every interval.
        root_seed: Root of the streams that starts are drawn again from.

    Raises:
        MissingEvidenceError: A field whose size without any injection is not known.
    """
    sizes = evidence.rows(CURVES, SeverityRow)
    rows = evidence.rows(ROLLOUTS, RolloutRow)
    rows = rows.assign(success=flags(rows, "success"))
    found = []
    for condition, planned in sizes.groupby("of", sort=True):
        field = str(planned["field"].iloc[0])
        if field not in NEUTRAL:
            raise MissingEvidenceError(f"of {condition}.{field} nobody knows which size is none")
        severities = [NEUTRAL[field], *map(float, numbers(planned, "severity"))]
        names = [NOMINAL, *map(str, planned["perturbation"])]
        for method in methods:
            own = rows[rows["method"] == method]
            by_start = (
                own.groupby(["start", "perturbation"])["success"].mean().unstack("perturbation")
            )
            shares = by_start.reindex(columns=names).dropna().to_numpy(dtype=float)
            if len(shares) == 0:
                continue
            draws = stream(root_seed, "gate", "D", "half", method, str(condition))
            found.append(
                Curve(
                    method,
                    str(condition),
                    field,
                    tuple(
                        _point(own, name, severity, name == condition, confidence)
                        for name, severity in zip(names, severities, strict=True)
                    ),
                    _half(severities, shares, confidence=confidence, draws=draws),
                )
            )
    return found


def _point(
    rows: pd.DataFrame, name: str, severity: float, judged: bool, confidence: float
) -> Point:
    part = rows[rows["perturbation"] == name]
    interval = wide_interval(
        part["success"].to_numpy(), part["start"].to_numpy(), confidence=confidence
    )
    return Point(severity, judged, *interval, part["start"].nunique())


def _half(
    severities: Sequence[float], shares: Array, *, confidence: float, draws: np.random.Generator
) -> tuple[float, float, float]:
    """Where the mean over starts (n, sizes) is half of the first size, and its interval."""
    picked = draws.integers(0, len(shares), size=(REDRAWS, len(shares)))
    again = np.array([halved(severities, shares[rows].mean(axis=0)) for rows in picked])
    known = np.sort(again[~np.isnan(again)])
    point = halved(severities, shares.mean(axis=0))
    if len(known) == 0:
        return point, math.nan, math.nan
    tail = (1.0 - confidence) / 2.0
    last = len(known) - 1
    return point, float(known[int(tail * last)]), float(known[math.ceil((1.0 - tail) * last)])


def halved(severities: Sequence[float], shares: Sequence[float] | Array) -> float:
    """The first size at which success is half of what it is at the first one, between two of them.

    Infinite where it never is; NaN where nothing succeeds at the first.
    """
    half = float(shares[0]) / 2.0
    if not half > 0.0:
        return math.nan
    for place in range(1, len(severities)):
        before, after = float(shares[place - 1]), float(shares[place])
        if after <= half:
            share = (before - half) / (before - after)
            return severities[place - 1] + share * (severities[place] - severities[place - 1])
    return math.inf
