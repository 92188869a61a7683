"""Table of what else ran while latency was measured (Gate B)."""

from collections.abc import Sequence

import numpy as np

from gates.evidence import Evidence, numbers
from gates.pages.bound import require_bound
from gates.pages.figures import Listing, Table
from gates.report import GateReport
from genpolicy.evidence.rows.reproducibility import MachineRow

FILE = "artifacts/latency/machine.parquet"
HEADS = (
    "method", "run", "processors of others, most", "stolen, most", "turns taken", "turns given",
)  # fmt: skip


def _beside(evidence: Evidence, report: GateReport) -> Table:
    """Of each method and run the process beside which most ran."""
    require_bound(evidence, report, FILE)
    frame = evidence.rows(FILE, MachineRow)
    seconds = numbers(frame, "seconds")
    rates = frame.assign(others=frame["others_s"] / seconds, stolen=frame["stolen_s"] / seconds)
    lines = []
    for (method, run), part in rates.groupby(["method", "run"], sort=True):
        cpus = int(part["cpus"].max())
        others, stolen = (_most(part[name].tolist(), cpus) for name in ("others", "stolen"))
        turns = [f"{numbers(part, name).sum():g}" for name in ("involuntary", "voluntary")]
        lines.append((str(method), str(run), others, stolen, *turns))
    return (HEADS, *lines)


def _most(rates: Sequence[float], cpus: int) -> str:
    """The most of several processors, of all; unknown where one of them is."""
    most = float(np.max(np.asarray(rates, dtype=np.float64)))
    return f"{most:.2g} of {cpus}" if np.isfinite(most) else "unknown"


BESIDE = Listing(
    "What else ran while latency was measured?",
    "Processors that other programs had (the server of a policy behind the wire is one), and what "
    "the host of the machine gave to others, beside the busiest process of each run. Turns are how "
    "often its processor was taken away, and how often it gave it away for a sleep, a lock or a "
    "disk. Nothing is judged by this table: what an invocation waited for a processor is told with "
    "each ratio, and takes a FAIL back only where it explains it.",
    FILE,
    _beside,
)
