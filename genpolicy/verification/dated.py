"""Time on record never goes back, and leaps only where a person says what time it is."""

from collections.abc import Iterator

from genpolicy.verification.journal_source import Message

NEVER_NS = -(1 << 62)
"""Before the first time that anybody read."""
LEAP_NS = 60_000_000_000
"""Beyond this no session is silent, so that a clock which says so is right only if a person is."""


def misdated(before_ns: int, kind: str, m: Message) -> Iterator[tuple[str, str]]:
    """What is wrong with the time of an event that follows one of this time."""
    after_ns = m["t"]
    if after_ns < before_ns:
        yield "journal.time", f"Time goes back from {before_ns} ns to {after_ns} ns."
    leaps = before_ns != NEVER_NS and after_ns - before_ns > LEAP_NS
    if leaps and (kind, m.get("event")) != ("supervisor", "human_reset"):
        yield "journal.leap", f"Time leaps from {before_ns} ns to {after_ns} ns, by nobody."
