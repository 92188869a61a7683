"""The line that a criterion draws into a figure."""

from matplotlib.axes import Axes

from gates.report import GateReport
from genpolicy.pages.figures.limits import limit_line


def limit_of(report: GateReport, name: str) -> float | None:
    """Limit of a criterion, if the report has one."""
    return next((c.threshold for c in report.criteria if c.id == name), None)


def draw_limit(axes: Axes, report: GateReport, name: str, *, horizontal: bool = False) -> None:
    """Draw the limit of a criterion as a labelled dotted line; the axis grows to show it."""
    limit = limit_of(report, name)
    if limit is not None:
        limit_line(axes, limit, horizontal=horizontal)
