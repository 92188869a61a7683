"""What collecting an event of the journal costs, against appending the same to a list.

`python -m benchmarks.journal` prints events per second of both and their ratio; aim 100 000 events
a second, so that a session of 20 Hz never waits for its journal.
"""

import time
from collections.abc import Callable

from genpolicy.execution.journal import Journal

EVENTS = 30_000
REPEATS = 5


def per_second(collect: Callable[[int], object]) -> float:
    best_s = min(_once(collect) for _ in range(REPEATS))
    return EVENTS / best_s


def _once(collect: Callable[[int], object]) -> float:
    begin = time.perf_counter()
    for number in range(EVENTS):
        collect(number)
    return time.perf_counter() - begin


def main() -> None:
    journal, plain = Journal("benchmark"), []
    ours = per_second(lambda n: journal.add("hold", n, {"reason": "empty"}))
    reference = per_second(lambda n: plain.append(("hold", n, {"reason": "empty"})))
    print(f"journal {ours:,.0f} events/s, list {reference:,.0f}, ratio {reference / ours:.1f}")


if __name__ == "__main__":
    main()
