"""What it costs, on the desk: simple methods and candidates by what each one asks of a cell.

All planned conditions and training seeds of a method together, on the starts that all share. What
is judged is stricter: each limit holds in the worst condition, at the worse end of an interval.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd

from gates.evidence import Evidence, MissingEvidenceError, counts, flags, numbers
from gates.pages.bound import require_bound
from gates.pages.figures import in_order
from gates.report import Gate, GateReport
from gates.stress.cost import STOPS
from gates.stress.rollouts import DRILL, ROLLOUTS
from gates.words import number, percent, three
from genpolicy.evidence.rows.stress import RolloutRow

HEADS = (
    "Succeeds", "A person steps in", "Stops, to be reset", "Time it waits", "Time of the fallback",
    "Deadlines missed", "Force, 95 % of rollouts", "Recovers",
)  # fmt: skip


@dataclass(frozen=True)
class Cell:
    """One cost of one method.

    Attributes:
        value: As a person reads it.
        of: What it rests on.
    """

    value: str
    of: str


@dataclass(frozen=True)
class Method:
    """One method with its costs.

    Attributes:
        name: Of the method.
        kind: `simple` or `candidate`.
        promoted: Whether Gate D promotes it.
        cells: In the order of `HEADS`.
    """

    name: str
    kind: str
    promoted: bool
    cells: tuple[Cell, ...]


@dataclass(frozen=True)
class Costs:
    """The table, or why there is none.

    Attributes:
        methods: Simple ones first.
        starts: Identical starts that each method had.
        conditions: Planned conditions that each start was met in.
        missing: Why it is not shown; empty if it is.
    """

    methods: tuple[Method, ...] = ()
    starts: int = 0
    conditions: int = 0
    missing: str = ""


def costs_of(reports: Mapping[Gate, GateReport], evidence: Evidence) -> Costs:
    """Costs of every method that Gate D compared, from the rollouts that it judged."""
    report = reports.get("D")
    if report is None:
        return Costs(missing="gate D was not judged, so no method has rolled out")
    try:
        require_bound(evidence, report, ROLLOUTS)
        rows = evidence.rows(ROLLOUTS, RolloutRow)
        planned = list(report.settings["perturbations"])
        rows = rows[rows["perturbation"].isin(planned)]
        simple, known = report.settings["baselines"], in_order(rows["method"])
        return Costs(
            methods=tuple(
                Method(
                    name=name,
                    kind="simple" if name in simple else "candidate",
                    promoted=name == report.promoted,
                    cells=_cells(rows[rows["method"] == name]),
                )
                for name in sorted(known, key=lambda name: name not in simple)
            ),
            starts=rows["start"].nunique(),
            conditions=len(planned),
        )
    except MissingEvidenceError as error:
        return Costs(missing=str(error))


def share(hits: float, of: float) -> Cell:
    """A share as a reader takes it in: `96 %` of `288 of 300`, `none` of `1,080`."""
    if of == 0:
        return Cell("never tried", "")
    if hits == 0:
        return Cell("none", f"of {number(of)}")
    return Cell(percent(hits / of), f"{number(hits)} of {number(of)}")


def _cells(rows: pd.DataFrame) -> tuple[Cell, ...]:
    called = rows[rows["perturbation"] != DRILL]
    began = rows[flags(rows, "recovery_attempted")]
    return (
        share(flags(rows, "success").sum(), len(rows)),
        share((counts(rows, "interventions") > 0).sum(), len(rows)),
        share(rows["outcome"].isin(STOPS).sum(), len(rows)),
        _part(rows, "hold_ticks", "ticks"),
        _part(called, "fallback_ticks", "ticks"),
        _part(rows, "deadline_misses", "invocations"),
        _force(rows),
        share(flags(began, "recovered").sum(), len(began)),
    )


def _part(rows: pd.DataFrame, part: str, whole: str) -> Cell:
    return share(counts(rows, part).sum(), counts(rows, whole).sum())


def _force(rows: pd.DataFrame) -> Cell:
    force = numbers(rows, "force_peak_n")
    touched = int((force > 0).sum())
    if touched == 0:
        return Cell("no contact", f"in {len(force):,} rollouts")
    high = float(np.quantile(force, 0.95, method="higher"))
    return Cell(f"{three(high)} N", f"touched in {touched:,} of {len(force):,}")
