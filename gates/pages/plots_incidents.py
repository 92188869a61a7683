"""Table of Gate C: what happened to good chunks on their way, expected and seen."""

from matplotlib.figure import Figure

from gates.evidence import Evidence
from gates.feasibility.incidents import COUNTS, STUB, Counted, counted
from gates.pages.figures import Plot, Table, in_order
from gates.report import GateReport
from genpolicy.evidence.rows.shadow import ShadowCountRow
from genpolicy.pages.figures.drawing import GREY, new_figure

ROW_IN = 0.22
WRONG, RIGHT = "#b3261e", "#1b5e20"


def _by_method(evidence: Evidence) -> dict[str, list[Counted]]:
    methods = in_order(evidence.rows(COUNTS, ShadowCountRow)["method"])
    return {method: counted(evidence, method) for method in methods}


def _cell(item: Counted) -> str:
    through = f", {item.through:g} at the stub" if item.through else ""
    return f"{item.counted:g} of {item.injected:g}{through}"


def _incidents(evidence: Evidence, report: GateReport) -> Figure:
    found = _by_method(evidence)
    first = next(iter(found.values()))
    figure, (axes,) = new_figure(height=0.9 + ROW_IN * len(first))
    axes.set_axis_off()
    axes.set_xlim(0, 1)
    axes.set_ylim(len(first), -1)
    places = [0.58 + 0.42 * (k + 0.5) / len(found) for k in range(len(found))]
    axes.text(0.0, -0.5, "what happened", weight="bold", va="center")
    axes.text(0.28, -0.5, "must be counted as", weight="bold", va="center")
    for place, method in zip(places, found, strict=True):
        axes.text(place, -0.5, method, weight="bold", va="center", ha="center")
    for row, item in enumerate(first):
        axes.axhline(row, color=GREY, lw=0.3)
        axes.text(0.0, row + 0.5, _name(item), va="center")
        axes.text(0.28, row + 0.5, item.reason.replace("_", " "), va="center")
        for place, items in zip(places, found.values(), strict=True):
            own = items[row]
            colour, weight = (WRONG, "bold") if own.wrong else (RIGHT, "normal")
            axes.text(place, row + 0.5, _cell(own), color=colour, weight=weight, va="center",
                      ha="center")  # fmt: skip
    return figure


def _name(item: Counted) -> str:
    return item.name.removesuffix("_on_the_way").replace("_", " ")


def _table(evidence: Evidence, report: GateReport) -> Table:
    rows = [
        (method, _name(item), item.reason, f"{item.injected:g}", f"{item.counted:g}",
         f"{item.through:g}")
        for method, items in _by_method(evidence).items()
        for item in items
    ]  # fmt: skip
    heads = ("method", "what happened", "must be counted as", "chunks", "counted so", "at the stub")
    return (heads, *rows)


PLOTS = (
    Plot(
        "What happens on the way",
        "Good chunks that were admitted, and something happened between their observation and "
        "their arrival. Each must be discarded and counted by its one reason, and nothing of it "
        "may reach the controller stub. Of a chunk that comes twice the second is discarded, of "
        "two in the wrong order the older, and the answer of a policy that hangs is given up; "
        "there the other one of the two is executed. "
        "Derived again from the journal by genpolicy verify report.",
        COUNTS,
        _incidents,
        also=(STUB,),
        read=_table,
    ),
)
