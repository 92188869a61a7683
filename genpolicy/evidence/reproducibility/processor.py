"""What kept a call from running: time in the run queue beside wall time, and what else ran.

The kernel counts for every thread how long it could have run and had no processor (`schedstat` of
the kernel's scheduler, its second number). That is the machine's doing. A thread that sleeps, waits
for a lock, a disk or another process stands in no queue, so that such time stays the candidate's.
Where the kernel says nothing, nothing is known, which is None and never zero.
"""

import os
import resource
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

SCHEDSTAT = Path("/proc/thread-self/schedstat")
"""Of the calling thread: time on a processor, time in the run queue, ns, and turns."""
STAT = Path("/proc/stat")
"""Time of all processors by what they did, in ticks."""
BYTES = 128
NS = 1e-9
BUSY = (0, 1, 2, 5, 6)
"""Columns of `cpu` in `/proc/stat` that are work: user, nice, system, irq, softirq."""
STOLEN = 7
"""The column of time that the host of this machine gave to somebody else."""


@dataclass(frozen=True)
class Moment:
    """What a thread has used up to now, s.

    Attributes:
        thread_s: Time on a processor of this thread.
        process_s: Of all threads of its process.
        queued_s: Time in which this thread could have run and did not; None where nobody counts.
    """

    thread_s: float
    process_s: float
    queued_s: float | None


class RunQueue:
    """The kernel's account of the thread that opens it."""

    def __init__(self, descriptor: int | None) -> None:
        self._descriptor = descriptor

    def now(self) -> Moment:
        """What this thread has used up to now."""
        return Moment(time.thread_time(), time.process_time(), self._queued_s())

    def _queued_s(self) -> float | None:
        if self._descriptor is None:
            return None
        fields = os.pread(self._descriptor, BYTES, 0).split()
        # A kernel that counts nothing says that the thread never ran.
        return int(fields[1]) * NS if len(fields) > 1 and int(fields[0]) > 0 else None


@contextmanager
def run_queue(path: Path = SCHEDSTAT) -> Iterator[RunQueue]:
    """The account of the calling thread, to be read inside the block; of no other thread."""
    try:
        descriptor = os.open(path, os.O_RDONLY)
    except OSError:
        yield RunQueue(None)
        return
    try:
        yield RunQueue(descriptor)
    finally:
        os.close(descriptor)


def waited_s(before: Moment, after: Moment, *, wall_s: float) -> float | None:
    """How much of a span the thread waited for a processor that others than its process had, s.

    Never more than the truth, as far as the kernel counts: other threads of the process may be what
    it waited for, so that their time is taken off, and what it ran it did not wait.

    Args:
        before: At the beginning of the span, or behind it.
        after: At the end of the span, or before it.
        wall_s: Length of the span, s.

    Returns:
        At most `wall_s` without the time that the thread ran; None where nobody counts.
    """
    if before.queued_s is None or after.queued_s is None:
        return None
    ran_s = after.thread_s - before.thread_s
    beside_s = max(0.0, after.process_s - before.process_s - ran_s)
    queued_s = after.queued_s - before.queued_s - beside_s
    return max(0.0, min(queued_s, wall_s - ran_s))


@dataclass(frozen=True)
class MachineMoment:
    """What a process and all processors have done up to now.

    Attributes:
        clock_s: Monotonic clock, s.
        cpu_s: Time on a processor of this process, s.
        voluntary: How often it gave its processor away.
        involuntary: How often it was taken away.
        busy_s: Work of all processors, s; None where nobody counts.
        stolen_s: Time that the host gave to others, s; None where nobody counts.
    """

    clock_s: float
    cpu_s: float
    voluntary: int
    involuntary: int
    busy_s: float | None
    stolen_s: float | None


@dataclass(frozen=True)
class Machine:
    """What ran on the machine while a process measured.

    Attributes:
        seconds: How long, s.
        cpu_s: Time on a processor of the process itself, s.
        voluntary: How often it gave its processor away: it slept, or waited for something.
        involuntary: How often its processor was taken away.
        others_s: Work of all other processes, of all processors, s; None where nobody counts.
        stolen_s: Time of all processors that the host gave to others, s; None likewise.
        cpus: Processors.
    """

    seconds: float
    cpu_s: float
    voluntary: int
    involuntary: int
    others_s: float | None
    stolen_s: float | None
    cpus: int


def machine_now(path: Path = STAT) -> MachineMoment:
    """What this process and all processors have done up to now."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    busy_s, stolen_s = _of_all(path)
    return MachineMoment(
        time.perf_counter(), used.ru_utime + used.ru_stime, used.ru_nvcsw, used.ru_nivcsw,
        busy_s, stolen_s,
    )  # fmt: skip


def machine_between(before: MachineMoment, after: MachineMoment) -> Machine:
    """What ran between two moments of this process."""
    cpu_s = after.cpu_s - before.cpu_s
    busy_s = _less(after.busy_s, before.busy_s)
    return Machine(
        after.clock_s - before.clock_s,
        cpu_s,
        after.voluntary - before.voluntary,
        after.involuntary - before.involuntary,
        None if busy_s is None else max(0.0, busy_s - cpu_s),  # ticks are coarse
        _less(after.stolen_s, before.stolen_s),
        os.cpu_count() or 1,
    )


def _less(after: float | None, before: float | None) -> float | None:
    return None if after is None or before is None else max(0.0, after - before)


def _of_all(path: Path) -> tuple[float | None, float | None]:
    """Work of all processors and what was stolen of them, s."""
    try:
        fields = path.read_text(encoding="ascii").split("\n", 1)[0].split()
    except OSError:
        return None, None
    if len(fields) < 2 + STOLEN or fields[0] != "cpu":
        return None, None
    ticks = [int(field) for field in fields[1:]]
    second = os.sysconf("SC_CLK_TCK")
    return sum(ticks[column] for column in BUSY) / second, ticks[STOLEN] / second
