"""The verdict on one chunk: six layers in order, the first reason, a margin each."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from genpolicy.feasibility.settings import LAYERS

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LayerVerdict:
    """One layer's answer.

    Attributes:
        name: Layer.
        passed: None where an earlier layer had already rejected.
        reason: Name of the first check that failed; empty otherwise.
        margin: Limit minus value of the check that decided: of the failed one, or of the
            tightest one (relative to its limit). In the check's unit; NaN where not reached.
        check: Name of the check that the margin belongs to.
    """

    name: str
    passed: bool | None
    reason: str
    margin: float
    check: str


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
        return len(self.layers) == len(LAYERS) and all(v.passed is True for v in self.layers)

    @property
    def first_reason(self) -> str:
        """Name of the check that rejected first; empty if none did."""
        return next((v.reason for v in self.layers if v.passed is False), "")

    @property
    def first_layer(self) -> str:
        """Name of the layer that rejected first; empty if none did."""
        return next((v.name for v in self.layers if v.passed is False), "")

    def layer(self, name: str) -> LayerVerdict:
        """The verdict of the named layer."""
        return self.layers[LAYERS.index(name)]


def judge_layer(
    layer: str, margins: Mapping[str, float], scales: Mapping[str, float]
) -> LayerVerdict:
    """Verdict of one layer from the margins of its checks; a missing or NaN margin fails.

    Args:
        layer: Name of the layer.
        margins: Margin per check.
        scales: Checks of the layer in order, each with the size of its limit, which tells the
            tightest one.
    """
    tightest, tightest_part, tightest_margin = "", float("inf"), float("nan")
    for check, scale in scales.items():
        margin = margins.get(check, float("nan"))
        if not margin >= 0:
            return LayerVerdict(layer, False, check, margin, check)
        part = margin / scale
        if part < tightest_part or not tightest:
            tightest, tightest_part, tightest_margin = check, part, margin
    return LayerVerdict(layer, True, "", tightest_margin, tightest)


def not_reached(name: str) -> LayerVerdict:
    """Layer behind the one that rejected."""
    return LayerVerdict(name, None, "", float("nan"), "")
