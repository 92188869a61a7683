"""Table of Gate C: how close admitted candidates come to the limits of each layer."""

import numpy as np
import pandas as pd

from gates.bounds import draws_for_quantile
from gates.evidence import Array, Evidence, MissingEvidenceError, numbers
from gates.feasibility.candidates import admissible, episodes_of
from gates.feasibility.margins import require_consistent
from gates.feasibility.settings import CANDIDATES, HELD_OUT, LAYERS
from gates.pages.figures import Folded, Listing, Table, in_order
from gates.pages.reasons import PERSONAL, personal, said
from gates.report import GateReport
from gates.words import percent
from genpolicy.evidence.rows.shadow import CandidateRow

CLOSE, MIDDLE = 0.05, 0.5
"""Quantiles that are shown; the lower of two order statistics, which is the closer one."""
ANY = "the tightest of all"


def _close(evidence: Evidence, report: GateReport) -> Table:
    """Of each method one line a layer, and one of what is tightest over all of them."""
    confidence, lines = float(report.settings["confidence"]), []
    frame = _admitted(evidence)
    for method in in_order(frame["method"]):
        rows = frame[frame["method"] == method]
        lines += [(method, layer, *_of_layer(rows, layer, confidence)) for layer in LAYERS]
        lines.append((method, ANY, *_of_all(rows, confidence)))
    heads = ("method", "layer", "closest check", "of them", "left: p5, median",
             "layer, share left: p5, median", "episodes")  # fmt: skip
    return heads, *lines


def _each(evidence: Evidence, report: GateReport) -> Table:
    """One line for each check that was the closest of its layer to any candidate."""
    confidence, lines = float(report.settings["confidence"]), []
    frame = _admitted(evidence)
    for method in in_order(frame["method"]):
        rows = frame[frame["method"] == method]
        for layer in LAYERS:
            for check in _checks(rows, layer):
                own = rows[rows[f"check_{layer}"] == check]
                lines.append(
                    (method, layer, said(check), f"{len(own)} of {len(rows)}", _left(own, layer),
                     _shares(numbers(own, f"share_{layer}")), _episodes(own, confidence))
                )  # fmt: skip
    heads = ("method", "layer", "check", "closest to", "left: p5, median",
             "share left: p5, median", "episodes")  # fmt: skip
    return heads, *lines


def _admitted(evidence: Evidence) -> pd.DataFrame:
    """Admitted candidates of held-out observations, none of which contradicts itself."""
    frame = require_consistent(evidence.rows(CANDIDATES, CandidateRow))
    held: pd.DataFrame = frame[
        (frame["fixture"] == HELD_OUT).to_numpy() & (admissible(frame) == 1.0)
    ]
    if len(held) == 0:
        raise MissingEvidenceError("no admissible held-out candidate")
    return held


def _checks(rows: pd.DataFrame, layer: str) -> list[str]:
    """The checks that are the closest of a layer to some candidate; most often first."""
    counts = rows[f"check_{layer}"].value_counts()
    return sorted((str(name) for name in counts.index if name), key=lambda n: (-counts[n], n))


def _of_layer(rows: pd.DataFrame, layer: str, confidence: float) -> tuple[str, ...]:
    checks = _checks(rows, layer)
    if not checks:
        return "nothing was measured", f"0 of {len(rows)}", "", "", ""
    measured = rows[rows[f"check_{layer}"] != ""]
    own = measured[measured[f"check_{layer}"] == checks[0]]
    return (
        said(checks[0]),
        f"{len(own)} of {len(rows)}",
        _left(own, layer),
        _shares(numbers(measured, f"share_{layer}")),
        _episodes(own, confidence),
    )


def _of_all(rows: pd.DataFrame, confidence: float) -> tuple[str, ...]:
    """The layer that is tightest to most candidates, and what is left of the limits of all."""
    named = rows[rows["margin_layer"] != ""]
    if len(named) == 0:
        return "nothing was measured", f"0 of {len(rows)}", "", "", ""
    pairs = named[["margin_layer", "margin_check"]].value_counts()
    layer, check = min(pairs.index, key=lambda pair: (-pairs[pair], pair))
    own = named[(named["margin_layer"] == layer) & (named["margin_check"] == check)]
    shares = np.concatenate(
        [numbers(part, f"share_{name}") for name, part in named.groupby("margin_layer")]
    )
    return (
        f"{layer}: {said(check)}",
        f"{len(own)} of {len(rows)}",
        _left(own, layer),
        _shares(shares),
        _episodes(own, confidence),
    )


def _left(rows: pd.DataFrame, layer: str) -> str:
    """What is left to the limit of one check, in the unit of a person.

    Raises:
        MissingEvidenceError: It is stated in several units, or in one that nobody knows.
    """
    units = sorted(set(rows[f"unit_{layer}"]))
    if len(units) > 1 or units[0] not in PERSONAL:
        check = rows[f"check_{layer}"].iloc[0]
        raise MissingEvidenceError(f"margins of {check} are in {' and '.join(units)}")
    left = _quantiles(numbers(rows, f"margin_{layer}"))
    return ", ".join(personal([value], units[0]) for value in left)


def _shares(values: Array) -> str:
    return ", ".join(percent(value) for value in _quantiles(values))


def _quantiles(values: Array) -> list[float]:
    found: list[float] = np.quantile(values, [CLOSE, MIDDLE], method="lower").tolist()
    return found


def _episodes(rows: pd.DataFrame, confidence: float) -> str:
    """How many independent units, and whether they bound the outer quantile at all."""
    count, needed = episodes_of(rows).nunique(), draws_for_quantile(1 - CLOSE, confidence)
    return f"{count}" + (f", fewer than the {needed} that bound a p5" if count < needed else "")


LISTINGS = (
    Listing(
        "How close what is admitted comes to the limits",
        "Admitted candidates of held-out observations. Each layer keeps the margin of the check "
        "that is closest to its limit, by the share of the limit that is left; named is the check "
        "that is so most often, to how many of all admitted candidates, and what is left to them "
        "in its own unit: p5, which one of twenty falls below, and median. Beside it the share of "
        "whichever check is closest, over all candidates to which the layer measures anything; "
        "contact measures nothing in free motion. Left out are checks that ask yes or no, and the "
        "two that answer in one of two units (projection, which has a criterion of its own, and "
        "reach). Clearances are lower bounds, 0 where only the exact test could tell. Candidates "
        "of an episode are no independent trials, so that n is its episodes. Nothing is judged "
        "by this.",
        CANDIDATES,
        _close,
        folded=(Folded("Every check that was the closest", _each),),
    ),
)
