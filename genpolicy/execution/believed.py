"""The time of a session: which readings of a clock are believed, and what a person may say of it.

A stop must not depend on a valid argument, and one wrong reading must not end a session. What is no
time, lies before an earlier one or far ahead of it is counted and not believed, so that time on
record never goes back. The price: a reading far ahead that was believed, as the first one is, since
there is nothing to hold it against, cannot be taken back; all that was seen, voided, stopped and
commanded lies before it. Such a session holds, says why and for how long yet, and is ended by a
person who begins another one. How far ahead a reading may lie and be believed is how long it holds.
"""

from genpolicy.execution.nanoseconds import NEVER_NS, NS_PER_S, ns_or_none

NO_TIME, CLOCK_BACKWARDS, CLOCK_AHEAD = "no_time", "clock_backwards", "clock_ahead"
LONGEST_JUMP_NS = 60 * NS_PER_S
"""No component of a session is silent for longer; a clock that is further ahead is doubted.

It bounds what one wrong reading costs: behind it a session holds for at most so long, unless its
first reading was the wrong one, or a person read it twice.
"""


class BelievedClock:
    """One clock, read by every component of a session.

    Attributes:
        latest_ns: The newest time that was believed.
        doubt: Why the time given last is not believed: `no_time`, `clock_backwards`,
            `clock_ahead`; empty where it is.
        doubts: How many were not.
    """

    def __init__(self) -> None:
        self.latest_ns = NEVER_NS
        self.doubt = ""
        self.doubts = 0
        self._ahead_ns: int | None = None

    def clock(self, now_s: float) -> int:
        """Now in ns, for every component of the session; whatever is given, it never raises.

        The answer to a reading that is not believed is the newest time that was.
        """
        now_ns = ns_or_none(now_s)
        self.doubt = self._doubt(now_ns)
        if now_ns is None or self.doubt:
            self.doubts += 1
            self._ahead_ns = now_ns if self.doubt == CLOCK_AHEAD else self._ahead_ns
        else:
            self.latest_ns, self._ahead_ns = now_ns, None
        return self.latest_ns

    def believe(self, now_s: float) -> int:
        """The same, where a person says what time it is: a clock that stays far ahead is right.

        It stays there if the reading before this one that was not believed for it said nearly the
        same, and none was believed since. What a person reads once may be the glitch.
        """
        now_ns, before_ns = ns_or_none(now_s), self._ahead_ns
        if now_ns is None or before_ns is None:
            return self.clock(now_s)
        if abs(now_ns - before_ns) <= LONGEST_JUMP_NS:
            self.latest_ns = max(self.latest_ns, now_ns)
        return self.clock(now_s)

    def beside(self, now_s: float) -> str:
        """In words, how far a reading lies from the newest time that is believed.

        Of one behind it also how long to wait until such a clock is believed again.
        """
        now_ns = ns_or_none(now_s)
        if now_ns is None:
            return "no time"
        beside_s = (now_ns - self.latest_ns) / NS_PER_S
        if beside_s >= 0:
            return f"{beside_s:.3f} s ahead"
        return f"{-beside_s:.3f} s behind (believed again in {-beside_s:.3f} s, not before)"

    def is_lost(self, now_s: float) -> bool:
        """Whether a clock that says this is further back than anybody would wait for."""
        now_ns = ns_or_none(now_s)
        return now_ns is not None and self.latest_ns - now_ns > LONGEST_JUMP_NS

    def _doubt(self, now_ns: int | None) -> str:
        if now_ns is None:
            return NO_TIME
        if now_ns < self.latest_ns:
            return CLOCK_BACKWARDS
        begun = self.latest_ns != NEVER_NS
        return CLOCK_AHEAD if begun and now_ns - self.latest_ns > LONGEST_JUMP_NS else ""
