"""Table of Gate D: deadlines that were missed because a policy's process failed, by kind."""

from gates.evidence import Evidence, numbers
from gates.pages.bound import require_bound
from gates.pages.figures import Folded, Listing, Table
from gates.report import GateReport
from gates.stress.rollouts import FAULTS
from genpolicy.evidence.rows.stress import FaultRow

NONE = "none"


def _failed(evidence: Evidence, report: GateReport) -> Table:
    return _counted(evidence, report, by=["method", "fault"])


def _conditions(evidence: Evidence, report: GateReport) -> Table:
    return _counted(evidence, report, by=["method", "perturbation", "fault"])


def _counted(evidence: Evidence, report: GateReport, *, by: list[str]) -> Table:
    """Counts by these columns; that nothing failed is said only where nothing did."""
    require_bound(evidence, report, FAULTS)
    frame = evidence.rows(FAULTS, FaultRow)
    counted = frame.assign(count=numbers(frame, "count"))
    of = [name for name in by if name != "fault"]
    whole = counted.groupby(of)["count"].transform("sum")
    counted = counted[(counted["fault"] != "") | (whole == 0)]
    counts = counted.groupby(by, sort=True)["count"].sum()
    index = counts.index.to_frame(index=False).astype(str)
    cells = [*(index[name] for name in by), (f"{count:g}" for count in counts)]
    lines = [tuple(cell or NONE for cell in line) for line in zip(*cells, strict=True)]
    return ((*by, "times"), *lines)


FAILED = Listing(
    "Answers that never came: the process of the policy failed",
    "Of policies in a process of their own. Whatever it does that is no answer (late, closed, "
    "refused, oversize, malformed, shape, unrequested, changed, nonfinite; gone once it is asked "
    "no more) costs it that invocation: its deadline is missed and counts among the misses. The "
    "journals say each of them beside the deadline.",
    FAULTS,
    _failed,
    folded=(Folded("Every condition", _conditions),),
    optional=True,
)
