"""Table of Gate D: what monitors would have said of probes, beside a clock and a spread."""

import math

import pandas as pd

from gates.evidence import Evidence, MissingEvidenceError, flags
from gates.pages.bound import require_bound
from gates.pages.figures import Folded, Listing, Table, in_order
from gates.report import GateReport, parse_section, report_path
from gates.stress.monitors import (
    ALARMS,
    MONITORS,
    THRESHOLDS,
    UNWATCHED,
    by_rollout,
    felt,
    share,
    unwatched,
    watched_of,
)
from gates.stress.rollouts import StressSettings
from gates.words import percent, share_between
from genpolicy.evidence.rows.monitors import MonitorAlarmRow, MonitorUnavailableRow

UNAVAILABLE = f"{MONITORS}/unavailable.parquet"
HEADS = (
    "method", "monitor", "failures seen", "coverage", "false alarms", "worst phase",
    "allowed there", "delay, s", "mean cost",
)  # fmt: skip


def _listed(evidence: Evidence, report: GateReport) -> Table:
    settings = _settings(evidence, report)
    if unwatched(evidence):
        return (HEADS, *((name, UNWATCHED, *[""] * 7) for name in report.candidates))
    lines: list[tuple[str, ...]] = []
    for candidate in report.candidates:
        try:
            found = watched_of(evidence, settings, candidate)
        except MissingEvidenceError as error:
            lines.append((candidate, f"not looked at: {error}", *[""] * 7))
            continue
        for one in found.watched:
            phase, interval = one.worst_phase
            silent = f"; no threshold in {', '.join(one.silent)}" if one.silent else ""
            lines.append(
                (
                    candidate, f"{one.monitor}{' (control)' if one.is_control else ''}",
                    f"{one.failures}", _interval(one.coverage), _interval(one.false_alarms),
                    f"{phase}: {_interval(interval)}" if phase else "no success",
                    f"{percent(one.allowed)}{silent}", _number(one.delay_s), _number(one.cost),
                )
            )  # fmt: skip
        for name, cost in (("never", found.quiet_cost), ("always", found.loud_cost)):
            lines.append((candidate, f"{name} an alarm", *[""] * 6, _number(cost)))
    return (HEADS, *lines)


def _graded(evidence: Evidence, report: GateReport) -> Table:
    settings = _settings(evidence, report)
    heads = ("method", "probe", "severity", "monitor", "rollouts", "detected", "failures alarmed")
    alarms = _alarms(evidence, report)
    if alarms is None:
        return (heads,)
    rows = by_rollout(alarms)
    lines: list[tuple[str, ...]] = []
    key = ["method", "family", "severity", "monitor"]
    for (method, family, severity, monitor), own in felt(rows).groupby(key, sort=False):
        failed = own[~flags(own, "success")]
        found = share(own, settings.confidence)
        early = int(flags(failed, "alarm").sum()) if len(failed) else 0
        lines.append(
            (
                f"{method}", f"{family}", f"{severity:g}", f"{monitor}", f"{len(own)}",
                _interval(found), f"{early} of {len(failed)}",
            )
        )  # fmt: skip
    return (heads, *lines)


def _joint(evidence: Evidence, report: GateReport) -> Table:
    heads = ("method", "monitor", "first alarm in", "no recovery, success", "no recovery, failure",
             "recovery succeeded", "recovery failed")  # fmt: skip
    alarms = _alarms(evidence, report)
    if alarms is None:
        return (heads,)
    rows = by_rollout(alarms)
    tried, saved = flags(rows, "recovery_attempted"), flags(rows, "recovered")
    good = flags(rows, "success")
    cells = pd.DataFrame(
        {
            "method": rows["method"], "monitor": rows["monitor"],
            "alarm": rows["phase"].where(rows["phase"] != "", "none"),
            "untried and well": ~tried & good, "untried and failed": ~tried & ~good,
            "recovered": tried & saved, "not recovered": tried & ~saved,
        }
    )  # fmt: skip
    key = ["method", "monitor", "alarm"]
    counted = cells.groupby(key, sort=False).sum().reset_index()
    lines = [tuple(f"{cell}" for cell in line) for line in counted.itertuples(index=False)]
    return (heads, *lines)


def _absent(evidence: Evidence, report: GateReport) -> Table:
    require_bound(evidence, report, UNAVAILABLE)
    rows = evidence.records(UNAVAILABLE, MonitorUnavailableRow)
    lines = [(row.method, row.monitor, row.why) for row in rows]
    return (("method", "monitor", "unavailable because"), *(lines or [("all", "none", "")]))


def _costs(evidence: Evidence, report: GateReport) -> Table:
    settings = _settings(evidence, report)
    lines = [
        (name, f"{cost:g}", owner, reason)
        for owner, cells in settings.monitor_costs.items()
        for name, (cost, reason) in cells.items()
    ]
    return (("what", "cost", "owner", "why"), *lines)


def _alarms(evidence: Evidence, report: GateReport) -> pd.DataFrame | None:
    """Rows of all methods in their order; None where no probe was run."""
    require_bound(evidence, report, ALARMS)
    if unwatched(evidence):
        return None
    rows = evidence.rows(ALARMS, MonitorAlarmRow)
    order = {name: place for place, name in enumerate(in_order(rows["method"]))}
    return rows.sort_values("method", key=lambda names: names.map(order), kind="stable")


def _settings(evidence: Evidence, report: GateReport) -> StressSettings:
    require_bound(evidence, report, ALARMS)
    require_bound(evidence, report, THRESHOLDS)
    where = f"{report_path(report.gate)}: settings"
    return parse_section(StressSettings, report.settings, where=where)


def _interval(found: tuple[float, float, float]) -> str:
    share_, low, high = found
    return "no case" if math.isnan(share_) else share_between(share_, low, high)


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.2g}"


WATCHED = Listing(
    "What would a monitor have said?",
    "Nothing here is judged and no monitor has authority: scores are computed from journals after "
    "a rollout is over. Thresholds are exact conformal ranks over successful nominal episodes, per "
    "phase, fixed before the starts that judge them are drawn; other nominal successes give the "
    "false alarms, so that a share above what is allowed in a phase is chance or drift, and over "
    "all phases they add up. Coverage is the share of failures under probes with an alarm, once "
    "the probe can be felt, before the end. A clock and the spread of the draws stand beside: a "
    "monitor that covers no more than they do has learned that failures are long. Intervals are "
    "over starts.",
    ALARMS,
    _listed,
    folded=(
        Folded("By probe and severity", _graded),
        Folded("Alarm, recovery and phase together", _joint),
        Folded("The cost matrix", _costs),
        Folded("Monitors that cannot watch a method", _absent),
    ),
    also=(THRESHOLDS, UNAVAILABLE),
    optional=True,
)
