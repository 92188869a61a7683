"""A machine that was busy while it measured: what that can explain, and what it cannot.

Latency is compared between processes, and a process beside other programs waits for its turn. How
long it could have run and had no processor is recorded of every term. The same comparison without
that time says whether the waiting explains what was found. It can take a FAIL back to INCONCLUSIVE
and nothing else: what must hold is the time on the wall, and so is what passes.

A candidate that sleeps, waits for a disk or a lock, or runs longer by itself, does so in both
comparisons. Of a policy behind the wire, and where the kernel does not count, nothing is known
and nothing is explained.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from gates.evidence import Array, MissingEvidenceError
from gates.words import percent

CONTENDED_SHARE = 0.05
"""Share of its time that an invocation waits for a processor where the machine is contended. A
quiet one has less: the work of the kernel, and of whoever looks on."""
AGAIN = (
    "measure again on a quiet machine with `dvc repro --single-item --force latency` and then "
    "`dvc repro gate_b`"
)


@dataclass(frozen=True)
class Ends:
    """A ratio that is held against an upper limit: itself, and either end of its interval."""

    least: float
    point: float
    most: float


@dataclass(frozen=True)
class Weighed:
    """What a comparison says, once it is known what the machine did.

    Attributes:
        interval: Of the ratio; its lower end without the time waited, where that explains it.
        said: How much was waited, and what the ratio is without it.
        undecided: What decides, where waiting explains that the limit was not met; else empty.
    """

    interval: tuple[float, float]
    said: str
    undecided: str = ""


def running(rows: pd.DataFrame) -> pd.DataFrame | None:
    """Rows of `latency.parquet` without the time that was waited; None where some is not known.

    Raises:
        MissingEvidenceError: A term that took no number of seconds, waited as long as it took, or
            less than no time.
    """
    measured = (rows["source"] == "measured").to_numpy()
    waited = _waited(rows[measured])
    if waited is None:
        return None
    seconds = rows["seconds"].to_numpy(dtype=np.float64, na_value=np.nan, copy=True)
    if not np.isfinite(seconds[measured]).all():
        raise MissingEvidenceError("a term that was measured took no number of seconds")
    if not np.all((waited >= 0.0) & (waited < seconds[measured])):
        raise MissingEvidenceError("a term waited for a processor longer than it took")
    seconds[measured] -= waited
    return rows.assign(seconds=seconds)


def waited_share(wall: Array, ran: Array) -> float:
    """Share of its time that a process waited for a processor, in the one that waited most.

    Args:
        wall: What each process took, s. Shape (n,).
        ran: The same without the time that it waited, s. Shape (n,).

    Raises:
        MissingEvidenceError: One that ran longer than it took.
    """
    if not np.all((ran > 0.0) & (ran <= wall)):
        raise MissingEvidenceError("a process that ran longer than it took")
    return float(np.max(1.0 - ran / wall))


def _waited(rows: pd.DataFrame) -> Array | None:
    waited = rows["waited_s"].to_numpy(dtype=np.float64, na_value=np.nan)
    return None if np.isnan(waited).any() else waited


def weigh(wall: Ends, without: Ends | None, *, share: float | None, limit: float | None) -> Weighed:
    """The interval of a ratio, with what waiting explains of it.

    It explains a ratio that is no longer above the limit without it, itself and not only the lower
    end: a wait in one process alone makes the interval wide, and explains none of the ratio.

    Args:
        wall: The ratio of times on the wall: what must hold.
        without: The same without the time waited; None where that is not known.
        share: Share of the time that was waited, where it was most; None likewise.
        limit: What the ratio is held against; None where there is none.
    """
    plain = (wall.least, wall.most)
    if share is None or without is None:
        return Weighed(plain, "how long it waited for a processor is not known")
    said = f"at most {percent(share)} of it waiting for a processor"
    if not share >= CONTENDED_SHARE:
        return Weighed(plain, said)
    said += f" and without that {without.point:.3g} ({without.least:.3g} to {without.most:.3g})"
    broken = limit is not None and not wall.most <= limit
    if limit is None or not broken or not max(without.least, without.point) <= limit:
        return Weighed(plain, said)
    undecided = f"other programs had the processor and that may be all of it: {AGAIN}"
    return Weighed((min(wall.least, without.least), wall.most), said, undecided)
