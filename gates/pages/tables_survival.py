"""Tables of Gate C: what is admitted of each mode, and what became of every action."""

import pandas as pd

from gates.bounds import interval_of, share_interval
from gates.evidence import Evidence, MissingEvidenceError, counts
from gates.feasibility.candidates import admissible, episodes_of
from gates.feasibility.settings import CANDIDATES, HELD_OUT, INTACT, SHADOW
from gates.pages.bound import require_bound
from gates.pages.figures import Listing, Table, in_order
from gates.pages.reasons import said
from gates.report import GateReport
from gates.words import share_between
from genpolicy.evidence.rows.shadow import CandidateRow, ShadowCountRow

COUNTS = f"{SHADOW}/counts.parquet"
EXECUTED, QUEUED = "executed", "still queued"
WAYS = "_on_the_way"
"""Ends the names of incidents; whatever else is not held out is corrupted."""


def _survival(evidence: Evidence, report: GateReport) -> Table:
    """Of each method, fixture and mode the share that all six layers pass.

    Of fewer episodes than the gate compares modes with, the share is said to be of too few.
    """
    frame, lines = evidence.rows(CANDIDATES, CandidateRow), []
    enough = int(report.settings["mode_observations"])
    confidence = float(report.settings["confidence"])
    for method in in_order(frame["method"]):
        for fixture in INTACT:
            own = frame[(frame["method"] == method) & (frame["fixture"] == fixture)]
            for mode, rows in own.groupby("mode"):
                passed, episodes = admissible(rows), episodes_of(rows)
                share, *interval = share_interval(
                    passed, episodes.to_numpy(), confidence=confidence, favourable=True
                )
                few = f", fewer than the {enough} needed" if episodes.nunique() < enough else ""
                lines.append(
                    (method, said(fixture), said(str(mode)) or "unassigned",
                     f"{passed.sum():g} of {len(rows)}", share_between(share, *interval),
                     f"{episodes.nunique()}{few}")
                )  # fmt: skip
    return ("method", "observations", "mode", "admitted", "share, interval", "episodes"), *lines


def _became(evidence: Evidence, report: GateReport) -> Table:
    """Of each method: actions executed, queued, and discarded by reason, by where it was played."""
    require_bound(evidence, report, COUNTS)
    frame = evidence.rows(COUNTS, ShadowCountRow)
    frame = frame.assign(
        count=counts(frame, "count"), where=[_where(str(name)) for name in frame["fixture"]]
    )
    candidates = evidence.rows(CANDIDATES, CandidateRow)
    lines = []
    for method in in_order(frame["method"]):
        own = frame[frame["method"] == method]
        held = candidates[(candidates["method"] == method) & (candidates["fixture"] == HELD_OUT)]
        sums = {place: _sums(own[own["where"] == place]) for place in ("held", "broken", "way")}
        generated = {place: sum(found.values()) for place, found in sums.items()}
        for end in sorted({*sums["held"], *sums["broken"], *sums["way"]}, key=_order):
            told = [f"{found.get(end, 0):g}" for found in sums.values()]
            share = _share(sums["held"].get(end, 0.0), generated["held"], held, report)
            lines.append((method, said(end), told[0], share, told[1], told[2]))
        told = [f"{total:g}" for total in generated.values()]
        lines.append((method, "all that was generated", told[0], "", told[1], told[2]))
    heads = ("method", "became of it", "held out", "share, interval", "corrupted", "on the way")
    return heads, *lines


def _share(count: float, generated: float, held: pd.DataFrame, report: GateReport) -> str:
    """Share of the actions of held-out observations; an episode is one trial, as elsewhere."""
    episodes = int(episodes_of(held).nunique()) if len(held) else 0
    if generated <= 0 or episodes == 0:
        return "none was generated"
    confidence = float(report.settings["confidence"])
    share = count / generated
    interval = interval_of(share, episodes, confidence=confidence, favourable=False)
    return share_between(share, *interval)


def _where(fixture: str) -> str:
    if fixture == HELD_OUT:
        return "held"
    return "way" if fixture.endswith(WAYS) or fixture.startswith("in_flight") else "broken"


def _sums(rows: pd.DataFrame) -> dict[str, float]:
    """Actions by what became of them; totals stand in every row of a fixture, once counted."""
    totals = rows[["fixture", "generated", "executed", "queued"]].drop_duplicates()
    if totals["fixture"].duplicated().any():
        raise MissingEvidenceError("a fixture states several totals")
    found = {EXECUTED: float(totals["executed"].sum()), QUEUED: float(totals["queued"].sum())}
    for reason, count in rows.groupby("reason")["count"].sum().items():
        if str(reason):
            found[str(reason)] = float(count)
    return found


def _order(end: str) -> tuple[int, str]:
    return (EXECUTED, QUEUED, end).index(end), end


LISTINGS = (
    Listing(
        "What passes, by mode",
        "Share of each mode's candidates that pass all six layers, on held-out observations and "
        "where the audit found two modes. The interval is exact over episodes: candidates of one "
        "episode are no independent trials. The gate compares modes in `mode_admissible_gap`.",
        CANDIDATES,
        _survival,
    ),
    Listing(
        "What became of every action",
        "Actions generated, and where they went: executed, still queued, or discarded by its "
        "reason. Interval: of the share on held-out observations, exact over as many trials as "
        "there are episodes. A chunk of corrupted fixtures or of an incident on its way is meant "
        "to be discarded, by a reason of its own, so that its counts have no interval.",
        COUNTS,
        _became,
        also=(CANDIDATES,),
    ),
)
