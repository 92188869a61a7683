"""What the policy of a rollout drew, and from what: enough to draw it again.

An invocation states the observations that it saw and the names of its noise; each candidate that
was judged, the hash of what was drawn; each chunk that was admitted, the numbers. Here they are
brought together, and held to the names that the plan gives an invocation: who may choose the noise
may choose the answer.

Where chunks join by another rule than replacing, a candidate names its invocation and its sample,
and what earlier chunks had a say is derived again (`rejoined`). A blend is no sample: its numbers
stand beside the hash of what was drawn for it.
"""

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from genpolicy.verification.joined import BLENDS
from genpolicy.verification.journal_source import Message, read_messages
from genpolicy.verification.pose import ACTION_DIM
from genpolicy.verification.rejoined import Made, Rejoined

Array = NDArray[np.float64]
Key = tuple[str | int, ...]

FIRST_NAME = "stress"
"""What the noise of a rollout is named by first."""


@dataclass(frozen=True)
class Source:
    """What an invocation draws from.

    Attributes:
        key: Names of the noise.
        history: What the policy saw, oldest first. Shape (H_o, D_o).
    """

    key: Key
    history: Array


@dataclass(frozen=True)
class Drawn:
    """One candidate that was judged.

    Attributes:
        method: Method of its session.
        chunk_id: The invocation.
        index: Number of the candidate.
        source: What its invocation drew from.
        seen: The scene at that time: x, y, z, m, and w, x, y, z by body, in hex.
        sha256: Of what was drawn, as stated when it was judged.
        actions: What was drawn, where it was admitted and enqueued. Shape (K, 10).
        made: What it was made of; None where chunks replace each other.
        earlier: What the invocations drew from that had a say in it.
        blended: What was enqueued of it, where earlier predictions were mixed in. Shape (K, 10).
    """

    method: str
    chunk_id: str
    index: int
    source: Source
    seen: dict[str, str]
    sha256: str
    actions: Array | None
    made: Made | None = None
    earlier: dict[str, Source] = field(default_factory=dict)
    blended: Array | None = None


@dataclass
class _Session:
    """One rollout while its events go by."""

    method: str
    condition: str
    start: int
    rejoined: Rejoined
    scene: dict[str, str] = field(default_factory=dict)
    begun: list[str] = field(default_factory=list)
    conditions: dict[str, tuple[Message, dict[str, str]]] = field(default_factory=dict)
    joined: dict[str, Message] = field(default_factory=dict)
    judged: list[tuple[Message, Message | None]] = field(default_factory=list)
    passed: dict[str, Message] = field(default_factory=dict)
    enqueued: dict[str, Message] = field(default_factory=dict)

    def read(self, kind: str, m: Message) -> Iterator[str]:
        """Take an event in; yields what is not stated, or not as planned."""
        if kind == "scene":
            self.scene = m["bodies"]
        elif kind == "invocation" and m["stage"] == "begin":
            self.begun.append(m["id"])
        elif kind == "conditioning":
            yield from self._conditioning(m)
        elif kind == "joined":
            self.joined[m["chunk_id"]] = m
            yield from self.rejoined.join(m)
        elif kind == "candidate":
            origin = self.joined.get(m["chunk_id"])
            if origin is not None:
                yield from self.rejoined.judge(m)
            if _invocation(m, origin) not in self.conditions:
                yield f"{m['chunk_id']!r} is judged, and nobody says what it was drawn from"
            self.judged.append((m, origin))
            if all(passed is True for passed in m["layers"].values()):
                self.passed[m["chunk_id"]] = m
        elif kind == "enqueue" and m["source"] == "policy":
            yield from self._enqueue(m)

    def _conditioning(self, m: Message) -> Iterator[str]:
        name = m["id"]
        if not self.begun or name != self.begun[-1] or name in self.conditions:
            yield f"what {name!r} saw is stated, and it does not begin there"
        planned = [FIRST_NAME, self.condition, self.start, len(self.begun)]
        if m["key"] != planned:
            yield f"the noise of {name!r} is named {m['key']}, {planned} by the plan"
        self.conditions[name] = m, self.scene
        self.rejoined.begin(m)

    def _enqueue(self, m: Message) -> Iterator[str]:
        name = m["chunk_id"]
        if name not in self.passed or name in self.enqueued:
            yield f"{name!r} is enqueued, and no candidate of it passed for that"
            return
        self.enqueued[name] = m
        if name in self.joined:
            yield from self.rejoined.enter(m)
        if _blended(self.joined.get(name)):
            return
        if hashlib.sha256(_raw(m)).hexdigest() != self.passed[name]["measures"]["drawn_sha256"]:
            yield f"{name!r} is enqueued, and what was judged is not what it was projected from"

    def finish(self) -> Iterator[str]:
        """After the last event."""
        for name in self.begun:
            if name not in self.conditions:
                yield f"{name!r} begins, and nobody says what it was drawn from"

    def drawn(self) -> Iterator[Drawn]:
        """Every judged candidate."""
        for m, origin in self.judged:
            name = m["chunk_id"]
            own = _invocation(m, origin)
            chunk = self.enqueued.get(name) if self.passed.get(name) is m else None
            raw = None if chunk is None else _floats(_raw(chunk)).reshape(-1, ACTION_DIM)
            made = None if origin is None else self.rejoined.made(m, origin)
            mixed = made is not None and made.blended
            yield Drawn(
                method=self.method,
                chunk_id=name,
                index=int(m["index"] if made is None else made.draw),
                source=self._source(own),
                seen=self.conditions[own][1],
                sha256=str(m["measures"]["drawn_sha256"]),
                actions=None if mixed else raw,
                made=made,
                earlier={one.invocation: self._source(one.invocation) for one in made.said}
                if made
                else {},
                blended=raw if mixed else None,
            )

    def _source(self, invocation: str) -> Source:
        told, _ = self.conditions[invocation]
        history = _floats(bytes.fromhex(told["history"])).reshape(int(told["rows"]), -1)
        return Source(tuple(told["key"]), history)


def drawn_chunks(path: Path) -> tuple[list[Drawn], str]:
    """Every candidate that a journal of rollouts says was judged, in its order.

    Returns:
        The candidates; and, in words, the first thing that is not stated or not as planned (then
        there are no candidates). Empty where all is.

    Raises:
        IntegrityError: No regular file.
        BadInputError: Not a whole journal.
        KeyError, TypeError, ValueError: An event that cannot be read.
    """
    sessions: dict[str, _Session] = {}
    for kind, m in read_messages(path):
        name = str(m.get("session"))
        if kind == "session":
            labels = m["labels"]
            own = (str(labels["method"]), str(labels["perturbation"]), int(labels["start"]))
            sessions[name] = _Session(*own, Rejoined(m))
            continue
        for finding in sessions[name].read(kind, m):
            return [], finding
    for session in sessions.values():
        for finding in session.finish():
            return [], finding
    return [item for session in sessions.values() for item in session.drawn()], ""


def _invocation(candidate: Message, origin: Message | None) -> str:
    """Id of the invocation that a candidate is of; its own where nothing was joined."""
    return str(candidate["chunk_id"] if origin is None else origin["invocation"])


def _blended(origin: Message | None) -> bool:
    """Whether earlier predictions were mixed into a candidate's numbers."""
    return origin is not None and origin["rule"] in BLENDS and bool(origin["parents"])


def _raw(chunk: Message) -> bytes:
    """Bytes of the actions as drawn; stated apart only where projection changed them."""
    return bytes.fromhex(chunk["raw"] or chunk["actions"])


def _floats(data: bytes) -> Array:
    return np.frombuffer(data, dtype="<f8").astype(np.float64)
