"""The verdict on one chunk: six layers in order, the first reason, a margin each."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from genpolicy.feasibility.reasons import Reason, Unit
from genpolicy.feasibility.settings import LAYERS

Array = NDArray[np.float64]


class LayerOutcome(StrEnum):
    """What came of a layer; only the first of these passes."""

    PASSED = "passed"
    """Every check of it holds."""
    FAILED = "failed"
    """A check of it does not hold."""
    UNKNOWN = "unknown"
    """A check of it could not be evaluated: its margin is no number, or is missing."""
    NOT_REACHED = "not_reached"
    """An earlier layer rejected, and it was not asked."""


@dataclass(frozen=True)
class Gauge:
    """How the margin of a check is read.

    Attributes:
        scale: Size of the check's limit in its unit, which tells the tightest check of a layer.
        unit: Its unit.
        undefined: What a margin that is no number says: that the check could not be evaluated, or,
            where it asks for numbers in the first place, that it failed.
    """

    scale: float
    unit: Unit
    undefined: LayerOutcome = LayerOutcome.UNKNOWN


@dataclass(frozen=True)
class LayerVerdict:
    """One layer's answer.

    Attributes:
        name: Layer.
        outcome: What came of it.
        reason: The first check that failed or could not be evaluated; None where it passed or was
            not reached. Behind a rejection that leaves nothing to ask about: that rejection's.
        margin: Limit minus value of the check that decided: of the failed one, or of the
            tightest one (relative to its limit). NaN where none was evaluated.
        check: The check that the margin belongs to.
        unit: Unit of the margin; None where there is none.
        row: First row of the chunk, counted from 0 and late ones included, that offends against
            the reason; None until somebody asks (`LayerChecker.located`), and without a row.
    """

    name: str
    outcome: LayerOutcome
    reason: Reason | None
    margin: float
    check: Reason | None
    unit: Unit | None
    row: int | None = None

    @property
    def passed(self) -> bool | None:
        """Whether it passed, which an unknown layer did not; None where it was not reached."""
        return (
            None
            if self.outcome is LayerOutcome.NOT_REACHED
            else self.outcome is LayerOutcome.PASSED
        )


@dataclass(frozen=True)
class Verdict:
    """Answer of the six layers, always six of them, in order.

    Attributes:
        layers: One verdict each.
        margins: Limit minus value of every check that was evaluated.
        rows: First row that was checked, and the row behind the last one.
        detail: What touched what, for a collision; empty otherwise.
        q_rad: Joint positions of the checked rows, for whoever proves them again; None where
            they were never computed. Shape (n, J).
    """

    layers: tuple[LayerVerdict, ...]
    margins: Mapping[str, float]
    rows: tuple[int, int]
    detail: str = ""
    q_rad: Array | None = field(default=None, compare=False, repr=False)

    @property
    def passed(self) -> bool:
        """Every layer was reached and passed."""
        passed = LayerOutcome.PASSED
        return len(self.layers) == len(LAYERS) and all(v.outcome is passed for v in self.layers)

    @property
    def first(self) -> LayerVerdict | None:
        """The first layer that failed or is unknown; None if none is."""
        return next((v for v in self.layers if v.passed is False), None)

    @property
    def first_reason(self) -> Reason | None:
        """The check that rejected first; None if none did."""
        return self.first.reason if self.first else None

    @property
    def first_layer(self) -> str:
        """Name of the layer that rejected first; empty if none did."""
        return self.first.name if self.first else ""

    def layer(self, name: str) -> LayerVerdict:
        """The verdict of the named layer."""
        return self.layers[LAYERS.index(name)]


def judge_layer(
    layer: str, margins: Mapping[str, float], gauges: Mapping[Reason, Gauge]
) -> LayerVerdict:
    """Verdict of one layer from the margins of its checks; only a margin >= 0 passes.

    Args:
        layer: Name of the layer.
        margins: Margin per check; one that is missing is no number.
        gauges: Checks of the layer in order, each with how its margin is read.
    """
    tightest, tightest_part, tightest_margin = None, float("inf"), float("nan")
    for check, gauge in gauges.items():
        margin = margins.get(check, float("nan"))
        if not margin >= 0:
            outcome = gauge.undefined if math.isnan(margin) else LayerOutcome.FAILED
            return LayerVerdict(layer, outcome, check, margin, check, gauge.unit)
        part = margin / gauge.scale
        if part < tightest_part or tightest is None:
            tightest, tightest_part, tightest_margin = check, part, margin
    unit = None if tightest is None else gauges[tightest].unit
    return LayerVerdict(layer, LayerOutcome.PASSED, None, tightest_margin, tightest, unit)


def not_reached(name: str) -> LayerVerdict:
    """Layer behind the one that rejected."""
    return LayerVerdict(name, LayerOutcome.NOT_REACHED, None, float("nan"), None, None)


def not_answerable(name: str, reason: Reason | None) -> LayerVerdict:
    """Layer that was asked although an earlier one left nothing to ask about."""
    return LayerVerdict(name, LayerOutcome.UNKNOWN, reason, float("nan"), None, None)
