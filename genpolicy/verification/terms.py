"""What an invocation says that its latency is made of: eleven terms that sum to it.

An invocation states how long it takes, and beside that what each term of it takes. Here the terms
have to sum to the whole, and those of the sensors to the time that the observation was on its way.
That each is what was drawn from the measured times is asked of `owed`.
"""

import math
from collections.abc import Iterator, Mapping

from genpolicy.verification.journal_source import Message

Finding = tuple[str, str]
SENSED = ("exposure_s", "capture_s", "decode_s", "transfer_s")
"""The terms that pass before an observation is there."""
TERMS = (
    *SENSED, "preprocess_s", "encode_s", "sample_s", "select_s", "project_s", "network_s",
    "queue_s",
)  # fmt: skip
ROUNDING_S = 1e-9
ROUNDING_NS = 2.0


class Terms:
    """Follows what the invocations of one session say that their latencies are made of."""

    def __init__(self) -> None:
        self._begun_s: dict[str, float] = {}
        self._of: dict[str, Mapping[str, float]] = {}
        self._there_ns: dict[int, int] = {}

    def follow(self, kind: str, m: Message) -> Iterator[Finding]:
        """Take an event in; yields terms that are missing, or not those of the latency."""
        if kind == "arrived":
            self._there_ns[m["exposed_ns"]] = m["t"]
        elif kind == "invocation" and m["stage"] == "begin":
            self._begun_s[m["id"]] = float(m["detail"])
        elif kind == "latency":
            yield from self._stated(m)
        elif kind == "conditioning":
            yield from self._on_its_way(m)
        elif kind == "end":
            for name in sorted(self._begun_s.keys() - self._of.keys()):
                yield "clock.terms", f"Invocation {name!r} never says what it takes its time for."

    def _stated(self, m: Message) -> Iterator[Finding]:
        which, terms = f"Invocation {m['id']!r}", {name: float(m[name]) for name in TERMS}
        if m["id"] not in self._begun_s or m["id"] in self._of:
            yield "clock.terms", f"{which} states terms, and does not begin there."
            return
        self._of[m["id"]] = terms
        wrong = [name for name, value_s in terms.items() if not 0.0 <= value_s < math.inf]
        if wrong:
            yield "clock.terms", f"{which} states no time for {', '.join(wrong)}."
        total_s, own_s = sum(terms.values()), self._begun_s[m["id"]]
        if not abs(total_s - own_s) <= ROUNDING_S:
            yield "clock.terms", f"{which} takes {own_s:.9g} s, and its terms {total_s:.9g} s."

    def _on_its_way(self, m: Message) -> Iterator[Finding]:
        terms, there_ns = self._of.get(m["id"]), self._there_ns.get(m["exposed_ns"])
        if terms is None:
            yield "clock.terms", f"Invocation {m['id']!r} does not say what it takes its time for."
        elif there_ns is not None:
            sensed_ns = 1e9 * sum(terms[name] for name in SENSED)
            if not abs(there_ns - m["exposed_ns"] - sensed_ns) <= ROUNDING_NS:
                yield (
                    "clock.terms",
                    f"What {m['id']!r} saw was {there_ns - m['exposed_ns']} ns on its way, and its "
                    f"sensor terms are {sensed_ns:.0f} ns.",
                )
