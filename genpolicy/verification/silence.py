"""A supervisor that stops after a silence has stopped whenever one was that long.

The journal says when an action was accepted and when the controller held. Between an action and
whatever is commanded later than the limit a stop must lie, and a person who cleared it; so must
behind a hold for a clock that is far ahead, since that long nobody commanded. The limit is the
caller's to know: no journal declares it.
"""

from collections.abc import Iterator

from genpolicy.verification.journal_source import Message

RULE = "P7.silence"
STOPS = ("protective_stop", "emergency_stop")
DOUBTS = ("no_time", "clock_backwards")
"""Holds at a time that nobody believed, so that nobody measured a silence."""


class Silence:
    """Follows one session.

    Args:
        limit_s: Silence after which the supervisor stops, s; None: it holds, however long.
    """

    def __init__(self, limit_s: float | None) -> None:
        self._limit_ns = None if limit_s is None else round(limit_s * 1e9)
        self._accepted_ns: int | None = None
        self._stopped = False

    def follow(self, kind: str, m: Message) -> Iterator[tuple[str, str]]:
        """Take an event in; yields a silence behind which nothing stopped."""
        if kind == "supervisor":
            if self._stopped:  # that only a person ends it is another rule (P7.sticky)
                self._accepted_ns = None
            self._stopped = m["state"] in STOPS
        elif kind in ("accept", "fallback"):
            yield from self._longer(m["t"], "an action")
            self._accepted_ns = m["t"]
        elif kind == "hold" and m["reason"] not in DOUBTS:
            yield from self._longer(m["t"], "a hold", ahead=m["reason"] == "clock_ahead")

    def _longer(self, now_ns: int, what: str, *, ahead: bool = False) -> Iterator[tuple[str, str]]:
        if self._limit_ns is None or self._accepted_ns is None or self._stopped:
            return  # an action while it is stopped is a violation of its own (P7.stop)
        silence_ns = now_ns - self._accepted_ns
        if ahead or not silence_ns <= self._limit_ns:
            clock = ", on a clock far ahead," if ahead else ""
            yield RULE, f"After a silence of {silence_ns} ns{clock} comes {what}, and no stop."
