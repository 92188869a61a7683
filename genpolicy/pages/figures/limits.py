"""The line that a limit draws into a figure."""

from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter

from genpolicy.pages.figures.drawing import INK


def limit_line(axes: Axes, limit: float, *, horizontal: bool = False, text: str = "limit") -> None:
    """Draw a limit as a labelled dotted line, in the unit of its axis, which grows to show it."""
    line = axes.axhline if horizontal else axes.axvline
    line(limit, color=INK, ls=":", lw=1.4)
    coordinates = ("axes fraction", "data") if horizontal else ("data", "axes fraction")
    low, high = axes.get_ylim() if horizontal else axes.get_xlim()
    if not low <= limit <= high:
        room = 0.05 * (max(high, limit) - min(low, limit))
        low, high = (min(low, limit - room), max(high, limit + room))
        (axes.set_ylim if horizontal else axes.set_xlim)(low, high)
    near_start = limit < low + 0.2 * (high - low)
    ticks = (axes.yaxis if horizontal else axes.xaxis).get_major_formatter()
    said = ticks(limit) if isinstance(ticks, FuncFormatter) else f"{limit:g}"
    axes.annotate(
        f"{text} {said}",
        xy=(0.01, limit) if horizontal else (limit, 1.0),
        xycoords=coordinates,
        xytext=(0, 3) if horizontal else (4 if near_start else -4, -2),
        textcoords="offset points",
        ha="left" if horizontal or near_start else "right",
        va="bottom" if horizontal else "top",
        fontsize=8,
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.8, "alpha": 0.85},
    )
