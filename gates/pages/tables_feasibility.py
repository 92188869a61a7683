"""Tables of Gate C: what was rejected, by layer, reason, method, phase and mode."""

from collections.abc import Iterable

import pandas as pd

from gates.asked_for import CHECKS_ASKED_FOR, REFUSED_FOR
from gates.bounds import share_interval
from gates.evidence import Evidence
from gates.feasibility.candidates import episodes_of
from gates.feasibility.settings import (
    CANDIDATES,
    HELD_OUT,
    INTACT,
    PASSED,
    REASONS,
    UNKNOWN,
)
from gates.pages.figures import Folded, Listing, Table, in_order
from gates.pages.reasons import REASON_WORDS, said
from gates.report import GateReport
from gates.words import share_between
from genpolicy.evidence.rows.shadow import CandidateRow

LAYER_OF = {name: layer for layer, _, name in (row.partition(".") for row in CHECKS_ASKED_FOR)}
NOTHING = "nothing"


def _rejections(evidence: Evidence, report: GateReport) -> Table:
    """Reasons in the order of the checks, with a line for each method."""
    held, confidence = _held_out(evidence), float(report.settings["confidence"])
    lines, told = [], set[str]()
    for reason, method, own, rows in _groups(held):
        because = "as above" if reason in told else REASON_WORDS.get(reason, "")
        told.add(reason)
        lines.append(
            (f"{_layer(reason)}: {said(reason)}", method, _of(rows, own, confidence),
             _where(rows, own, "phase"), _where(rows, own, "mode"), because)
        )  # fmt: skip
    heads = ("layer: reason", "method", "rejected", "by phase", "by mode", "because")
    return (heads, *(lines or [(NOTHING, "all", f"0 of {len(held)}", "", "", "")]))


def _held_out(evidence: Evidence) -> pd.DataFrame:
    frame = evidence.rows(CANDIDATES, CandidateRow)
    return frame[(frame["fixture"] == HELD_OUT).to_numpy()]


def _groups(held: pd.DataFrame) -> Iterable[tuple[str, str, pd.DataFrame, pd.DataFrame]]:
    """Reason, method, what was rejected for it, and all candidates of the method."""
    order = {name: place for place, name in enumerate(REASONS)}
    for reason in sorted(set(held["first_reason"]), key=lambda r: (order.get(r, len(order)), r)):
        for method in in_order(held["method"]):
            rows = held[held["method"] == method]
            own = rows[(rows["first_reason"] == reason) & (rows["outcome"] != PASSED)]
            if len(own):
                yield reason, method, own, rows


def _layer(reason: str) -> str:
    return LAYER_OF.get(reason, "no layer")


def _of(rows: pd.DataFrame, own: pd.DataFrame, confidence: float) -> str:
    """How many of how many, the interval over episodes, and those that could not be judged."""
    unknown = int((own["outcome"] == UNKNOWN).sum())
    share, low, high = share_interval(
        rows.index.isin(own.index), episodes_of(rows).to_numpy(), confidence=confidence,
        favourable=False,
    )  # fmt: skip
    text = f"{len(own)} of {len(rows)}: {share_between(share, low, high)}"
    return text + (f", {unknown} of them unknown" if unknown else "")


def _where(rows: pd.DataFrame, own: pd.DataFrame, column: str) -> str:
    """How many of how many, for each value of a column that occurs among them; most first."""
    counts = own[column].value_counts()
    names = sorted(counts.index, key=lambda name: (-counts[name], str(name)))
    return ", ".join(f"{name} {counts[name]} of {(rows[column] == name).sum()}" for name in names)


def _each(evidence: Evidence, report: GateReport) -> Table:
    """One line for each layer, reason, method, phase and mode that occurred."""
    held = _held_out(evidence)
    lines = []
    for reason, method, own, rows in _groups(held):
        for (phase, mode), part in own.groupby(["phase", "mode"]):
            alike = rows[(rows["phase"] == phase) & (rows["mode"] == mode)]
            unknown = int((part["outcome"] == UNKNOWN).sum())
            lines.append(
                (_layer(reason), said(reason), method, str(phase), str(mode), str(len(part)),
                 str(unknown), str(len(alike)))
            )  # fmt: skip
    return (
        ("layer", "reason", "method", "phase", "mode", "rejected", "of them unknown", "of"),
        *lines,
    )


def _quiet(evidence: Evidence, report: GateReport) -> Table:
    """Reasons for which no held-out candidate was rejected."""
    held = _held_out(evidence)
    heard = set(held["first_reason"])
    return (
        ("layer", "reason", "would be rejected because"),
        *((_layer(r), said(r), REASON_WORDS[r]) for r in REASONS if r not in heard),
    )


def _corrupted(evidence: Evidence, report: GateReport) -> Table:
    """For which reason each corrupted fixture was to be refused, and for which it was."""
    frame = evidence.rows(CANDIDATES, CandidateRow)
    frame = frame[~frame["fixture"].isin(INTACT).to_numpy()]
    lines = []
    for fixture, rows in frame.groupby("fixture"):
        refused = rows[rows["outcome"] != PASSED]
        expected = REFUSED_FOR.get(str(fixture), "")
        counts = refused["first_reason"].value_counts()
        names = sorted(set(counts.index) - {expected}, key=lambda name: (-counts[name], str(name)))
        others = ", ".join(f"{said(str(name)) or 'no reason'} {counts[name]}" for name in names)
        lines.append(
            (said(str(fixture)), said(expected) or "nobody knows", str(counts.get(expected, 0)),
             others or "none", f"{len(refused)} of {len(rows)}")
        )  # fmt: skip
    return ("corrupted fixture", "expected", "refused for that", "for another", "refused"), *lines


LISTINGS = (
    Listing(
        "What was rejected, and why",
        "Candidates on held-out observations, by the first check that did not hold: layer and "
        "reason, then of each method how many, in which phases and in which modes of how many "
        "there. In brackets the exact interval of the share, over episodes. A mode that loses far "
        "more than the other is removed by the checks. Unknown is what could not be evaluated; it "
        "does not pass.",
        CANDIDATES,
        _rejections,
        folded=(
            Folded("Every phase with every mode", _each),
            Folded("Reasons that rejected nothing", _quiet),
            Folded("What corrupted fixtures were to be refused for, and were", _corrupted),
        ),
    ),
)
