"""The supervisor's process on a clock that breaks after two seconds."""

import sys
import time

from genpolicy.wall_clock.process import main

BREAKS_AFTER_S = 2.0


class BrokenClock:
    def __init__(self, fault: str) -> None:
        self.begin_s, self.fault = None, fault

    def __call__(self) -> float:
        now_s = time.monotonic()
        self.begin_s = now_s if self.begin_s is None else self.begin_s
        if now_s - self.begin_s >= BREAKS_AFTER_S:
            broken = {"stands": self.begin_s + BREAKS_AFTER_S, "back": now_s - 3600.0,
                      "ahead": now_s + 3600.0, "nan": float("nan")}  # fmt: skip
            return broken[self.fault]
        return now_s


if __name__ == "__main__":
    fault = sys.argv.pop(1)
    sys.exit(main(clock=BrokenClock(fault)))
