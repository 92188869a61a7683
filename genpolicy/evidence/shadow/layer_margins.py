"""How far a chunk stays from the limits of each layer: one margin a layer, in its own unit.

A layer that rejects states the margin of the check it rejects for. Of a layer that passes the
tightest of its checks is kept, by the share of its limit that is left: numbers of different units
are never compared. A check that answers yes or no is nobody's tightest; it would be so always,
with the margin 0.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from genpolicy.feasibility.checker import LayerChecker
from genpolicy.feasibility.reasons import Reason
from genpolicy.feasibility.settings import LAYERS
from genpolicy.feasibility.verdict import (
    Gauge,
    LayerOutcome,
    LayerVerdict,
    Verdict,
    judge_layer,
    not_reached,
)

Gauges = Mapping[str, Mapping[Reason, Gauge]]
"""By layer and check, how its margin is read."""

NO_DISTANCE = frozenset({
    Reason.SHAPE, Reason.FINITE, Reason.ROTATION_DEGENERATE, Reason.ACTION_PERIOD,
    Reason.CONTROLLER_MODE, Reason.SESSION_EPOCH, Reason.CALIBRATION_MISMATCH,
    Reason.PHASE_TRANSITION, Reason.CHECKPOINT_MISMATCH, Reason.SAMPLER_MISMATCH,
    Reason.FUTURE_OBSERVATION, Reason.BEHIND_ACCEPTED,
})  # fmt: skip
"""Checks to which nothing comes close: they ask for a form, for what must be equal, or for an
order that the newest observation keeps with 0."""
TWO_UNITS = frozenset({Reason.PROJECTION_TOO_LARGE, Reason.UNREACHABLE, Reason.START_POSE})
"""Checks whose margin is in m of one chunk and in rad of another, so that it compares with none.

How far projection moved and turned has columns of its own.
"""
CONTACT = LAYERS[4]
"""The layer whose checks say exactly 0 where they do not apply."""


@dataclass(frozen=True)
class LayerMargin:
    """What the table states of one layer.

    Attributes:
        outcome: Word of `LayerOutcome`.
        check: The check that the margin belongs to; empty without one.
        margin: Limit minus value, in `unit`; None where the layer was not reached, is unknown, or
            measured nothing, and where it asks for numbers and there are none.
        unit: Unit of the check; empty without one.
        share: The margin over the size of the limit.
        row: First row that offends; None where it passed, was not reached or has none.
    """

    outcome: str
    check: str = ""
    margin: float | None = None
    unit: str = ""
    share: float | None = None
    row: int | None = None


def gauges_of(checker: LayerChecker) -> Gauges:
    """How the margins of a checker are read."""
    return {
        layer: {c.name: c.gauge(checker.cell) for c in checker.checks if c.layer == layer}
        for layer in LAYERS
    }


def layer_margins(verdict: Verdict, gauges: Gauges) -> dict[str, LayerMargin]:
    """The margin of each layer, in their order.

    Args:
        verdict: What was decided; with rows, where somebody asked for them.
        gauges: How its margins are read.
    """
    return {
        layer.name: _of_layer(layer, verdict.margins, gauges[layer.name])
        for layer in verdict.layers
    }


def decides(found: Mapping[str, LayerMargin]) -> str:
    """The layer that rejects; of a chunk that passes the one with the smallest share left.

    Empty where none of them measured anything.
    """
    for name, own in found.items():
        if own.outcome != LayerOutcome.PASSED:
            return name
    shares = {name: own.share for name, own in found.items() if own.share is not None}
    return min(shares, key=lambda name: shares[name], default="")


def in_order(margins: Mapping[str, float]) -> tuple[float, ...]:
    """The margin of every check in the order of `Reason`; NaN where it was not evaluated."""
    return tuple(float(margins.get(reason, math.nan)) for reason in Reason)


def judged_again(margins: tuple[float, ...], gauges: Gauges) -> dict[str, LayerMargin]:
    """What the margins of all checks say of the layers; without rows, which they do not tell.

    Args:
        margins: As `in_order` gives them.
        gauges: How they are read.

    Raises:
        ValueError: There are more or fewer than checks.
    """
    told: dict[str, float] = dict(zip(Reason, margins, strict=True))
    layers: list[LayerVerdict] = []
    for name in LAYERS:
        alive = all(layer.passed for layer in layers)
        layers.append(judge_layer(name, told, gauges[name]) if alive else not_reached(name))
    return layer_margins(Verdict(tuple(layers), told, (0, 0)), gauges)


def columns_of(found: Mapping[str, LayerMargin]) -> dict[str, Any]:
    """The columns of a table that state it: `<what>_<layer>`."""
    return {
        f"{what}_{name}": value for name, own in found.items() for what, value in vars(own).items()
    }


def _of_layer(
    layer: LayerVerdict, margins: Mapping[str, float], gauges: Mapping[Reason, Gauge]
) -> LayerMargin:
    if layer.outcome is LayerOutcome.NOT_REACHED:
        return LayerMargin(str(layer.outcome))
    check = _closest(layer.name, margins, gauges) if layer.passed else layer.check
    if check is None:
        return LayerMargin(str(layer.outcome))
    gauge, margin = gauges[check], margins.get(check, math.nan)
    known = math.isfinite(margin)
    return LayerMargin(
        outcome=str(layer.outcome),
        check=str(check),
        margin=float(margin) if known else None,
        unit=str(gauge.unit),
        share=float(margin / gauge.scale) if known else None,
        row=layer.row,
    )


def _closest(
    layer: str, margins: Mapping[str, float], gauges: Mapping[Reason, Gauge]
) -> Reason | None:
    """The check of a layer with the smallest share of its limit left, of those that measure."""
    shares = {
        check: margins.get(check, math.nan) / gauge.scale
        for check, gauge in gauges.items()
        if check not in NO_DISTANCE | TWO_UNITS
    }
    known = {
        check: share
        for check, share in shares.items()
        if math.isfinite(share) and not (layer == CONTACT and share == 0.0)
    }
    return min(known, key=lambda check: known[check], default=None)
