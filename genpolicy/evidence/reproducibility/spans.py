"""Spans of one invocation by its terms, and what of them was waited for a processor."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from genpolicy.contract.latency import Term
from genpolicy.evidence.reproducibility.processor import RunQueue, waited_s


@dataclass(frozen=True)
class Span:
    """What a term took, and how much of that it waited for a processor, s; None if unknown."""

    seconds: float
    waited_s: float | None


class SpanClock:
    """Spans of one invocation; of a run queue, where it is given, what was waited in it.

    A span of a term that has one already adds to it: a server behind the wire may select, too.
    """

    def __init__(self, queue: RunQueue | None = None) -> None:
        self._queue = queue or RunQueue(None)
        self.spans: dict[str, Span] = {}

    @contextmanager
    def timed(self, term: Term) -> Iterator[None]:
        """Time the block as a term. The queue is read inside the span: no wait outside counts."""
        start = time.perf_counter()
        before = self._queue.now()
        yield
        after = self._queue.now()
        seconds = time.perf_counter() - start
        waited = waited_s(before, after, wall_s=seconds)
        earlier = self.spans.get(str(term), Span(0.0, 0.0))
        if waited is not None:
            waited = None if earlier.waited_s is None else earlier.waited_s + waited
        self.spans[str(term)] = Span(earlier.seconds + seconds, waited)
