"""Tables of Gate D: entries into recovery by phase and cause, and who recovers what another does.

Of each phase and cause: how often recovery began, what became of it, how long it took, how hard it
touched, what it cost a person. And from perturbed states, paired by start, what each candidate
recovers beyond each simpler method.
"""

from collections.abc import Iterable

import numpy as np
import pandas as pd

from gates.evidence import Evidence, MissingEvidenceError, counts, flags, numbers
from gates.pages.bound import require_bound
from gates.pages.figures import Folded, Listing, Table, in_order
from gates.report import GateReport, parse_section, report_path
from gates.stress.recoveries import (
    PERTURBED,
    RECOVERIES,
    coverage,
    recovered_share,
    recoveries,
)
from gates.stress.rollouts import ROLLOUTS, StressSettings
from gates.words import percent, points, three
from genpolicy.evidence.rows.stress import RolloutRow

HEADS = (
    "entered", "starts", "recovered", "interval", "handed back", "of these by samples alone",
    "time, s", "force, N", "a person called", "stops to reset", "how else it ended",
)  # fmt: skip
TOLD = ("handed_back", "person", "stopped")
"""Ends that have a column of their own."""


def _settings(report: GateReport) -> StressSettings:
    where = f"{report_path(report.gate)}: settings"
    return parse_section(StressSettings, report.settings, where=where)


def _of_each(evidence: Evidence, report: GateReport) -> Iterable[tuple[str, pd.DataFrame]]:
    """Every compared method that ever entered recovery, with its entries."""
    require_bound(evidence, report, RECOVERIES)
    settings = _settings(report)
    for method in in_order(evidence.rows(ROLLOUTS, RolloutRow)["method"]):
        rows = recoveries(evidence, settings, method)
        if len(rows):
            yield method, rows


def _typical(rows: pd.DataFrame, column: str) -> str:
    """Median and 95th percentile."""
    middle, high = np.quantile(numbers(rows, column), [0.5, 0.95], method="higher")
    return f"{middle:.3g}, p95 {high:.3g}"


def _line(rows: pd.DataFrame, confidence: float) -> tuple[str, ...]:
    share, lower, upper = recovered_share(rows, confidence=confidence)
    ended = rows["ended"].value_counts()
    others = [f"{name} {ended[name]}" for name in sorted(set(ended.index) - set(TOLD))]
    return (
        f"{len(rows)}",
        f"{rows['start'].nunique()}",
        f"{flags(rows, 'recovered').sum():g}, {percent(share)}",
        f"{three(100 * lower)} to {percent(upper)}",
        f"{ended.get('handed_back', 0)}",
        f"{flags(rows, 'resampled_only').sum():g}",
        _typical(rows, "duration_s"),
        _typical(rows, "force_peak_n"),
        f"{ended.get('person', 0)}",
        f"{counts(rows, 'resets').sum():g}",
        ", ".join(others) or "no other way",
    )


def _listed(evidence: Evidence, report: GateReport) -> Table:
    return _grouped(evidence, report, ["phase", "cause"])


def _conditions(evidence: Evidence, report: GateReport) -> Table:
    return _grouped(evidence, report, ["perturbation", "phase", "cause"])


def _grouped(evidence: Evidence, report: GateReport, by: list[str]) -> Table:
    confidence = _settings(report).confidence
    lines = [
        (method, *(str(part) for part in key), *_line(rows, confidence))
        for method, entries in _of_each(evidence, report)
        for key, rows in entries.groupby(by, sort=True)
    ]
    return (("method", *("condition" if n == "perturbation" else n for n in by), *HEADS), *lines)


def _covered(evidence: Evidence, report: GateReport) -> Table:
    require_bound(evidence, report, RECOVERIES)
    require_bound(evidence, report, ROLLOUTS)
    settings = _settings(report)
    heads = (
        "candidate", "simpler method", "condition", "starts", "covered", "by the other",
        "difference", "interval", "both recovered on, starts", "difference there",
    )  # fmt: skip
    lines = []
    for condition in (name for name in PERTURBED if name in settings.perturbations):
        for candidate in settings.candidates:
            for baseline in settings.baselines:
                try:
                    found = coverage(evidence, settings, candidate, baseline, condition)
                except MissingEvidenceError as missing:
                    none = ("",) * (len(heads) - 4)
                    lines.append((candidate, baseline, condition, str(missing), *none))
                    continue
                low, high = found.interval
                both = "" if found.gain_of_both is None else points(found.gain_of_both)
                lines.append((
                    candidate, baseline, condition, f"{found.starts}", percent(found.own),
                    percent(found.other), points(found.gain), f"{points(low)} to {points(high)}",
                    f"{found.both}", both or "never both",
                ))  # fmt: skip
    return (heads, *lines)


LISTINGS = (
    Listing(
        "Recovery by phase and cause",
        "Entries into recovery, by the task phase in which they began and by what began them, over "
        "all planned conditions. An entry is recovered where its own primitive commanded the "
        "arm to its goal, the policy took over and the rollout succeeded, and no later recovery of "
        "it began in the same phase. One that handed back and had commanded nothing but the pose "
        "that was held left all help to new samples: it counts as not recovered. The interval is "
        "exact, over starts. Time and force: median, and p95, the 95th percentile, from "
        "the begin of the entry to its end. Derived again from the journals by genpolicy verify "
        "report.",
        RECOVERIES,
        _listed,
        folded=(Folded("Every condition", _conditions),),
        also=(ROLLOUTS,),
    ),
    Listing(
        "What a candidate recovers beyond a simpler method",
        "From the same perturbed states, paired by start: conditions that call for recovery, or "
        "push the arm, on every start. A start is covered where the rollout succeeded and its "
        "recovery, if it needed one, was one by the rule above. The interval holds the differences "
        "that the pairs do not speak against, at the confidence of this gate. Behind it the starts "
        "on which both entered recovery, and the difference on these alone: who needs it more "
        "seldom has harder ones left. A pair of which one did not run says so. Nothing here is "
        "judged by itself.",
        RECOVERIES,
        _covered,
        also=(ROLLOUTS,),
    ),
)
