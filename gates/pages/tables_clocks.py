"""Table of Gate D: the virtual clock and the wall clock on the same recorded windows."""

from gates.evidence import Evidence, numbers
from gates.pages.bound import require_bound
from gates.pages.figures import Folded, Listing, Table, in_order
from gates.report import GateReport, parse_section, report_path
from gates.stress.clocks import AGES, INVOCATIONS, SHOWN, WALL_CLOCK, Difference, compared
from gates.stress.rollouts import StressSettings
from gates.words import percent, points, three
from genpolicy.evidence.rows.clocks import ClockTickRow

TICKS = f"{WALL_CLOCK}/ticks.parquet"
MILLI = 1e3


def _listed(evidence: Evidence, report: GateReport) -> Table:
    require_bound(evidence, report, INVOCATIONS)
    require_bound(evidence, report, AGES)
    settings = parse_section(
        StressSettings, report.settings, where=f"{report_path(report.gate)}: settings"
    )
    lines: list[tuple[str, ...]] = []
    for candidate in report.candidates:
        found = compared(evidence, settings, candidate)
        lines.append(
            (candidate, "all of these", "", "", "", "", f"{found.answer}", f"{found.episodes}")
        )
        lines += [(candidate, *_line(item), f"{found.episodes}") for item in found.differences]
    heads = ("method", "what", "wall clock", "virtual clock", "difference", "tolerance", "answer",
             "episodes")  # fmt: skip
    return (heads, *lines)


def _line(item: Difference) -> tuple[str, ...]:
    kind, _, reason = item.name.partition(":")
    low, high = item.interval
    # Ages are compared by the distance of their distributions, which is no share.
    told = three if item.wall is None else points
    shares = tuple("" if value is None else percent(value) for value in (item.wall, item.virtual))
    answer = "within" if item.within else "outside" if item.outside else "astride"
    return (
        SHOWN[kind] + (f": {reason}" if reason else ""), *shares, f"{told(low)} to {told(high)}",
        "none" if item.tolerance is None else told(item.tolerance), answer,
    )  # fmt: skip


def _ticks(evidence: Evidence, report: GateReport) -> Table:
    require_bound(evidence, report, TICKS)
    rows = evidence.rows(TICKS, ClockTickRow)
    rows = rows[rows["clock"] == "wall"]
    lines = []
    for method in in_order(rows["method"]):
        own = rows[rows["method"] == method]
        late = [MILLI * numbers(own, name).max() for name in ("late_p95_s", "late_max_s")]
        lines.append((method, f"{int(numbers(own, 'ticks').sum())}", *(f"{v:.3g}" for v in late)))
    return (("method", "ticks", "worst window's p95 beside its time, ms", "most, ms"), *lines)


CLOCKS = Listing(
    "Does the virtual clock tell the truth?",
    "Windows of held-out episodes, once by the wall clock in processes of their own (the policy "
    "infers while the supervisor ticks) and once by the virtual clock of this gate, with the same "
    "executor, queue, stub, supervisor and six layers. Terms that no machine here has are the same "
    "draws for both: delays of a line there, numbers here. Ages are compared in whole periods, by "
    "the distance of their distributions; all else as shares of the warm invocations. The interval "
    "is over episodes. Nothing here is judged: a busy machine is late by the wall clock.",
    INVOCATIONS,
    _listed,
    folded=(Folded("How the wall clock ticked", _ticks),),
)
