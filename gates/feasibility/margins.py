"""What the layers state of each candidate: margins that contradict its verdict are no evidence.

A table that says "passed" beside a margin below zero was not written by the layers. Which margin
a layer must have, in numbers, is asked where Gate C's evidence is derived again.
"""

from collections.abc import Iterator

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from gates.evidence import Array, MissingEvidenceError, flags
from gates.feasibility.settings import FAILED, LAYERS, NOT_REACHED, PASSED, UNKNOWN

Rows = NDArray[np.bool_]
KNOWN = (PASSED, FAILED, UNKNOWN, NOT_REACHED)
OF_THE_ROW = {"check": "margin_check", "margin": "layer_margin", "unit": "margin_unit",
              "row": "first_row"}  # fmt: skip
"""What the columns of a layer are called in those of the whole row."""
SAME_SHARE = 1e-9
"""Shares that differ by less are as small."""


def require_consistent(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows, each of which states margins that its verdict follows from.

    Args:
        rows: Of `candidates.parquet`.

    Raises:
        MissingEvidenceError: One contradicts itself; the first of them is named.
    """
    for wrong, said in _contradictions(rows):
        if np.any(wrong):
            row = rows.iloc[int(np.argmax(wrong))]
            name = "/".join(str(row[c]) for c in ("method", "fixture", "observation", "candidate"))
            more = f", and {wrong.sum() - 1} more" if wrong.sum() > 1 else ""
            raise MissingEvidenceError(f"candidate {name}: {said}{more}")
    return rows


def _contradictions(rows: pd.DataFrame) -> Iterator[tuple[Rows, str]]:
    """Each rule: rows that break it, and what they say."""
    rejected = np.zeros(len(rows), dtype=bool)
    shares = []
    for layer in LAYERS:
        yield from _of_layer(rows, layer)
        outcome = rows[f"outcome_{layer}"].to_numpy()
        reached = outcome != NOT_REACHED
        yield rejected & reached, f"{layer} was reached behind a layer that rejected"
        yield ~rejected & ~reached, f"{layer} was not reached, and no layer before it rejected"
        first = ~rejected & reached & (outcome != PASSED)
        yield from _of_the_first(rows, layer, first)
        rejected |= first
        shares.append(_number(rows, f"share_{layer}"))
    passed = rows["outcome"].to_numpy() == PASSED
    yield passed == rejected, "its outcome is not that of its layers"
    yield passed & _said(rows, "first_reason"), "a reason, and no layer rejected"
    yield from _of_the_tightest(rows, ~rejected, np.stack(shares, axis=1))


def _of_layer(rows: pd.DataFrame, layer: str) -> Iterator[tuple[Rows, str]]:
    outcome = rows[f"outcome_{layer}"].to_numpy()
    yield ~np.isin(outcome, KNOWN), f"{layer} ended in no word of {', '.join(KNOWN)}"
    reached = outcome != NOT_REACHED
    yield reached != rows[layer].notna().to_numpy(), f"{layer} was reached in one column alone"
    passed = outcome == PASSED
    yield passed != flags(rows, layer), f"{layer} passed in one column alone"
    margin, share = _number(rows, f"margin_{layer}"), _number(rows, f"share_{layer}")
    known = ~np.isnan(margin)
    yield passed & (margin < 0), f"{layer} passed with a margin below 0"
    yield (outcome == FAILED) & (margin >= 0), f"{layer} failed with a margin of 0 or more"
    numberless = (outcome == UNKNOWN) | ~reached
    yield known & numberless, f"{layer} is unknown or was not reached, and has a margin"
    yield known & ~np.isfinite(margin), f"{layer} has a margin that is no finite number"
    same = np.sign(share) == np.sign(margin)
    yield known & ~same | ~known & ~np.isnan(share), f"{layer} has another share than margin"
    named = _said(rows, f"check_{layer}")
    yield named != _said(rows, f"unit_{layer}"), f"{layer} has a check or a unit alone"
    yield known & ~named, f"{layer} has a margin of no check"
    yield passed & named & ~known, f"{layer} passed, and its check has no margin"
    yield ~reached & named, f"{layer} was not reached, and has a check"
    yield (
        (passed | ~reached) & rows[f"row_{layer}"].notna().to_numpy(),
        (f"an action offends against {layer}, which did not reject"),
    )


def _of_the_first(rows: pd.DataFrame, layer: str, first: Rows) -> Iterator[tuple[Rows, str]]:
    """What the row states of the layer that rejects is what the layer states."""
    yield first & _differ(rows, "outcome", f"outcome_{layer}"), f"its outcome is not {layer}'s"
    check = _differ(rows, "first_reason", f"check_{layer}")
    yield first & check, f"{layer} rejects it, and not for its first reason"
    yield from _as_the_layer(rows, layer, first)


def _of_the_tightest(rows: pd.DataFrame, passed: Rows, shares: Array) -> Iterator[tuple[Rows, str]]:
    """What the row of a candidate that passed states is of the layer with the least share left."""
    names = rows["margin_layer"].to_numpy()
    measured = ~np.isnan(shares).all(axis=1)
    stated = (names != "") | ~np.isnan(_number(rows, "layer_margin"))
    yield passed & ~measured & stated, "it has a margin, and none of its layers measured one"
    known = passed & measured
    yield known & ~np.isin(names, LAYERS), "it passed, and no layer is its tightest"
    least = np.min(np.where(np.isnan(shares), np.inf, shares), axis=1)
    for place, layer in enumerate(LAYERS):
        own = known & (names == layer)
        tightest = shares[:, place] <= least + SAME_SHARE
        yield own & ~tightest, f"{layer} is not the layer with the least share of its limit left"
        yield from _as_the_layer(rows, layer, own)


def _as_the_layer(rows: pd.DataFrame, layer: str, of: Rows) -> Iterator[tuple[Rows, str]]:
    yield of & (rows["margin_layer"].to_numpy() != layer), f"its margin is of another than {layer}"
    for what, column in OF_THE_ROW.items():
        yield of & _differ(rows, column, f"{what}_{layer}"), f"{column} is not that of {layer}"


def _differ(rows: pd.DataFrame, one: str, other: str) -> Rows:
    """Rows in which two columns differ; both empty is the same."""
    a, b = rows[one], rows[other]
    same = (a == b) | (a.isna() & b.isna())
    return np.asarray(~same.to_numpy(dtype=bool, na_value=False))


def _said(rows: pd.DataFrame, column: str) -> Rows:
    return np.asarray(rows[column].to_numpy() != "")


def _number(rows: pd.DataFrame, column: str) -> Array:
    """A column of numbers, NaN where it is empty. Shape (rows,).

    Raises:
        MissingEvidenceError: It holds other things.
    """
    try:
        return np.asarray(rows[column].to_numpy(dtype=np.float64, na_value=np.nan))
    except (TypeError, ValueError) as error:
        raise MissingEvidenceError(f"column {column} holds no numbers") from error
