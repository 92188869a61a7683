"""What a policy may have seen: nothing that had not arrived, and the newest that had.

A rollout on the virtual clock states the hash of what it exposes when it does, and when each of
these arrives. An invocation states what it was conditioned on. Here both are held against each
other: an observation that is used before it is there would make a late camera harmless, and an
older one than had to be used would age actions that need not be. Each tick exposes one, as it
observes: a second one would undo the loss of the first. That they arrive when the plan says is
asked of `owed`.
"""

import hashlib
from collections.abc import Iterator

from genpolicy.verification.journal_source import Message

Finding = tuple[str, str]
TIMED = "start_sha256"
"""The label of a session that runs on the virtual clock."""


class Arrived:
    """Follows the observations of one session."""

    def __init__(self) -> None:
        self._timed = False
        self._exposed: dict[int, str] = {}
        self._unobserved: int | None = None
        self._there: set[int] = set()
        self._seen: dict[str, int] = {}

    def follow(self, kind: str, m: Message) -> Iterator[Finding]:
        """Take an event in; yields what could not have been seen, or should have been."""
        if kind == "session":
            self._timed = TIMED in m["labels"]
        elif not self._timed:
            return
        elif kind == "exposure":
            if self._unobserved is not None or not m["t"] > max(self._exposed, default=-1):
                yield "sensor.exposed", f"At {m['t']} ns more is exposed than once a tick."
            self._exposed[m["t"]], self._unobserved = m["sha256"], m["t"]
        elif kind == "observation":
            if m.get("event_time_ns", m["t"]) != m["t"]:
                yield "sensor.exposed", f"At {m['t']} ns {m['event_time_ns']} ns are observed."
            if self._unobserved != m["t"]:
                yield "sensor.exposed", f"The tick at {m['t']} ns exposes nothing."
            self._unobserved = None
        elif kind == "arrived":
            yield from self._arrive(m["exposed_ns"], m["t"])
        elif kind == "conditioning":
            yield from self._condition(m)
        elif kind == "joined":
            if m["invocation"] in self._seen:
                self._seen[m["chunk_id"]] = self._seen[m["invocation"]]
        elif kind == "enqueue" and m["source"] == "policy":
            yield from self._rests(m)

    def _arrive(self, exposed_ns: int, now_ns: int) -> Iterator[Finding]:
        if exposed_ns not in self._exposed:
            yield "sensor.unknown", f"What arrives was exposed at {exposed_ns} ns, and was not."
        if exposed_ns in self._there:
            yield "sensor.again", f"What was exposed at {exposed_ns} ns arrives again."
        if not now_ns > exposed_ns:
            yield "sensor.early", f"What is exposed at {exposed_ns} ns arrives at {now_ns} ns."
        self._there.add(exposed_ns)

    def _condition(self, m: Message) -> Iterator[Finding]:
        which, saw_ns = f"Invocation {m['id']!r}", m["exposed_ns"]
        self._seen[m["id"]] = saw_ns
        if saw_ns not in self._there:
            yield "sensor.not_there", f"{which} saw {saw_ns} ns, which had not arrived."
            return
        newest_ns = max(self._there)
        if saw_ns != newest_ns:
            yield "sensor.older", f"{which} saw {saw_ns} ns, and {newest_ns} ns had arrived."
        rows = int(m["rows"])
        data = bytes.fromhex(m["history"])
        width = len(data) // max(rows, 1)
        told = [hashlib.sha256(data[k * width : (k + 1) * width]).hexdigest() for k in range(rows)]
        due = [self._exposed.get(t, "") for t in sorted(self._there)[-rows:]]
        if told != [due[0]] * (rows - len(due)) + due:
            yield "sensor.other", f"{which} states another history than what had arrived."

    def _rests(self, m: Message) -> Iterator[Finding]:
        saw_ns = self._seen.get(m["chunk_id"])
        for name in ("condition_ns", "start_ns"):
            if m[name] != saw_ns:
                yield "sensor.claims", f"{m['chunk_id']!r} has {name} {m[name]}, and saw {saw_ns}."
