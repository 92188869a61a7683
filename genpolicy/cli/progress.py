"""How far a command is, on standard error: one rewritten line on a terminal, few in a log."""

import sys
import time
from collections.abc import Callable

TERMINAL_EVERY_S = 0.1
LOG_EVERY_S = 10.0


class ProgressLine:
    """Prints `what: done of total`; a call is cheap, so that every item may report.

    Args:
        what: What is counted, for instance `episodes`.
        clock: Monotonic clock, s.
    """

    def __init__(self, what: str, clock: Callable[[], float] = time.monotonic) -> None:
        self._what = what
        self._clock = clock
        self._terminal = sys.stderr.isatty()
        self._every_s = TERMINAL_EVERY_S if self._terminal else LOG_EVERY_S
        self._last_s = clock()
        self._open = False

    def __call__(self, done: int, total: int | None) -> None:
        """Report `done` of `total`."""
        now = self._clock()
        if now - self._last_s < self._every_s and done != total:
            return
        self._last_s = now
        text = f"{self._what}: {done}" + (f" of {total}" if total is not None else "")
        if self._terminal:
            print(f"\r\x1b[K{text}", end="", file=sys.stderr, flush=True)
            self._open = True
        elif done != total:
            print(text, file=sys.stderr, flush=True)

    def close(self) -> None:
        """End the line."""
        if self._open:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)
