"""Trainings in two processes of their own, as stages spread them over `compute.workers`."""

import io
import time
from contextlib import redirect_stderr
from multiprocessing.connection import Connection
from types import TracebackType

from benchmarks.training.steps import Ours, Size, Start, windows
from benchmarks.training.turns import Spent, with_threads
from genpolicy.compute import forked

FIRST, SECOND = (0, 2), (1,)
"""Seeds of the one process and of the other."""


def train_on_call(call: Connection, method: str, seeds: tuple[int, ...], size: Size) -> None:
    """Some updates of each seed whenever a number comes; answers with processor seconds."""
    data = windows()
    own = [Ours(Start(method, data, seed=seed, size=size)) for seed in seeds]
    with with_threads(1, fixed=True), redirect_stderr(io.StringIO()):
        call.send(0.0)
        while updates := call.recv():
            began = time.process_time()
            for training in own:
                for _ in range(updates):
                    training()
            call.send(time.process_time() - began)


class TwoProcesses:
    """Three seeds in two processes: two in the one, one in the other.

    Args:
        method: Whose.
        size: Of network and batch.
    """

    def __init__(self, method: str, size: Size) -> None:
        context = forked()
        self.calls, self.processes = [], []
        for seeds in (FIRST, SECOND):
            here, there = context.Pipe()
            process = context.Process(
                target=train_on_call, args=(there, method, seeds, size), daemon=True
            )
            process.start()
            there.close()
            self.calls.append(here)
            self.processes.append(process)
        for call in self.calls:
            call.recv()

    def __enter__(self) -> "TwoProcesses":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:  # fmt: skip
        for call, process in zip(self.calls, self.processes, strict=True):
            call.send(0)
            process.join()

    def turn(self, updates: int) -> Spent:
        """Until both are done: processor time is that of the process that took longer."""
        self._both(1)
        began = time.perf_counter()
        spent = self._both(updates)
        wall = time.perf_counter() - began
        return Spent(1e3 * max(spent) / updates, 1e3 * wall / updates)

    def _both(self, updates: int) -> list[float]:
        for call in self.calls:
            call.send(updates)
        return [call.recv() for call in self.calls]
