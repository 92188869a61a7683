"""The line that a criterion draws into a figure."""

from matplotlib.axes import Axes

from gates.models import GateReport
from gates.render.figures import INK


def limit_of(report: GateReport, name: str) -> float | None:
    """Limit of a criterion, if the report has one."""
    return next((c.threshold for c in report.criteria if c.id == name), None)


def draw_limit(axes: Axes, report: GateReport, name: str, *, horizontal: bool = False) -> None:
    """Draw the limit of a criterion as a labelled dotted line."""
    limit = limit_of(report, name)
    if limit is None:
        return
    line = axes.axhline if horizontal else axes.axvline
    line(limit, color=INK, ls=":", lw=1.4, label=f"limit {limit:g}")
    axes.legend(loc="best")
