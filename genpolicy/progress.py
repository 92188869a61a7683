"""How far the work is, on standard error: one rewritten line on a terminal, few in a log.

Nothing that is measured or written rests on it.
"""

import contextlib
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator

TERMINAL_EVERY_S = 0.1
LOG_EVERY_S = 10.0
STAGE = "GENPOLICY_STAGE"
"""Environment variable that names the stage, `[5/19] train_baselines`, to its processes too."""


class ProgressLine:
    """Prints `what: done of total` and the time left; a call is cheap: every item may report.

    Args:
        what: What is counted, for instance `episodes`.
        clock: Monotonic clock, s.
    """

    def __init__(self, what: str, clock: Callable[[], float] = time.monotonic) -> None:
        self._what = _of_stage(what)
        self._clock = clock
        self._terminal = sys.stderr.isatty()
        self._every_s = TERMINAL_EVERY_S if self._terminal else LOG_EVERY_S
        self._began_s = self._last_s = clock()
        self._open = False

    def __call__(self, done: int, total: int | None) -> None:
        """Report `done` of `total`."""
        now = self._clock()
        if now - self._last_s < self._every_s and done != total:
            return
        self._last_s = now
        text = f"{self._what}: {done}"
        if total is not None:
            left_s = (now - self._began_s) / max(done, 1) * (total - done)
            text += f" of {total}, about {duration(left_s)} left"
        if self._terminal:
            print(f"\r\x1b[K{text}", end="", file=sys.stderr, flush=True)
            self._open = True
        elif done != total:
            print(text, file=sys.stderr, flush=True)

    def close(self) -> None:
        """End the line."""
        if self._open:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)
        self._open = False


def counting(total: int, what: str, clock: Callable[[], float] = time.monotonic) -> Iterator[int]:
    """The numbers below `total`; each that is taken is reported, as `ProgressLine` does."""
    line = ProgressLine(what, clock)
    for done in range(total):
        line(done, total)
        yield done
    line.close()


def duration(seconds: float) -> str:
    """A time as a person says it: `40 s`, `3 min`, `1 h 5 min`."""
    if seconds < 90:
        return f"{max(seconds, 0.0):.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 90 else f"{minutes // 60} h {minutes % 60} min"


@contextlib.contextmanager
def still_at_it(
    usual_s: float | None,
    *,
    clock: Callable[[], float] = time.monotonic,
    every_s: float = LOG_EVERY_S,
) -> Iterator[None]:
    """Say every now and then for how long the work inside has been going on.

    Args:
        usual_s: How long it took last time, s; None where nobody knows.
        clock: Monotonic clock, s.
        every_s: How often, s.
    """
    ended, began = threading.Event(), clock()

    def speak() -> None:
        while not ended.wait(every_s):
            print(_of_stage(_so_far(clock() - began, usual_s)), file=sys.stderr, flush=True)

    speaker = threading.Thread(target=speak, name="progress", daemon=True)
    speaker.start()
    try:
        yield
    finally:
        ended.set()
        speaker.join()


def _so_far(passed_s: float, usual_s: float | None) -> str:
    text = f"for {duration(passed_s)}"
    if usual_s is None:
        return text
    if passed_s > usual_s:
        return f"{text}; it took {duration(usual_s)} last time"
    return f"{text}, about {duration(usual_s - passed_s)} left by the last run"


def _of_stage(text: str) -> str:
    stage = os.environ.get(STAGE, "")
    return f"{stage} · {text}" if stage else text
