"""Table of fixtures that were asked for in another way (Gate B)."""

from gates.evidence import Evidence
from gates.pages.bound import require_bound
from gates.pages.figures import Listing, Table
from gates.report import GateReport
from gates.reproducibility.variations import VARIED
from genpolicy.contract.action import ACTION_COMPONENTS, GRIPPER, POSITION, ROTATION
from genpolicy.evidence.rows.reproducibility import VariationRow

HEADS = (
    "candidate", "way", "chunks", "not bit-equal", "position, m", "rotation columns",
    "gripper, m",
)  # fmt: skip
GROUPS = (
    ACTION_COMPONENTS[POSITION], ACTION_COMPONENTS[ROTATION], (ACTION_COMPONENTS[GRIPPER],),
)  # fmt: skip


def _varied(evidence: Evidence, report: GateReport) -> Table:
    """Of each candidate and way, the largest difference over its training seeds."""
    require_bound(evidence, report, VARIED)
    rows = evidence.rows(VARIED, VariationRow)
    lines: list[tuple[str, ...]] = []
    for (method, way), part in rows.groupby(["method", "variation"], sort=False):
        if why := next(filter(None, part["unknown"]), ""):
            lines.append((str(method), str(way), "unknown", why, "", "", ""))
            continue
        chunks = part.groupby("component")[["chunks", "unequal"]].sum().max()
        apart = [
            part.loc[part["component"].isin(group), "max_abs_difference"].max() for group in GROUPS
        ]
        said = [f"{float(value):.2g}" for value in apart]
        lines.append((str(method), str(way), f"{chunks['chunks']:g}", f"{chunks['unequal']:g}",
                      *said))  # fmt: skip
    return (HEADS, *lines)


LISTING = Listing(
    "Is it the same in other company?",
    "Fixtures asked for in ways that change one thing each: `threads`, a process with two threads; "
    "`alone`, one observation and one candidate a call; `together`, twice as many candidates at "
    "once; `order`, the observations in another order. Largest differences, in the unit of the "
    "component. What is trained here takes one thread whatever its process has; a program that was "
    "brought obeys, and anybody else is told and may not: unknown, where nothing differs.",
    VARIED,
    _varied,
)
