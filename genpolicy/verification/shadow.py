"""What a shadow journal says of Gate C's tables, derived again from raw events.

Candidates with their verdicts, what reached the controller stub, the balance of chunks, and what
stood still. Shares no code with what wrote the tables, so that a row and its journal are two
witnesses.
"""

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from genpolicy.verification.journal_source import Message, read_messages
from genpolicy.verification.tables import Condition

REPLAYED = "phase_change_in_flight"
"""Sessions with candidates that were judged before, in the session of their observation."""
KEYS: dict[str, tuple[str, ...]] = {
    "candidates": ("method", "fixture", "observation", "candidate"),
    "stub": ("method", "fixture"),
    "counts": ("method", "fixture", "reason"),
    "holds": ("method", "fixture", "phase", "event", "reason"),
}
"""Tables that are derived here, and the columns by which a row is known."""
DOUBTS = ("no_time", "clock_backwards", "clock_ahead")
"""Reasons of a hold, and of the watchdog, that speak of the clock."""
STOPS = ("protective_stop", "emergency_stop")


@dataclass
class Stillness:
    """What stood still, while events go by."""

    phases: dict[str, str] = field(default_factory=dict)
    seen: Counter[tuple[str, ...]] = field(default_factory=Counter)

    def read(self, kind: str, m: Message, key: tuple[str, str]) -> None:
        """Take an event of a session of this method and fixture in."""
        session = str(m["session"])
        if kind == "phase":
            self.phases[session] = m["new"]
            return
        if kind == "hold":
            found = ("doubt" if m["reason"] in DOUBTS else "hold", m["reason"])
        elif kind != "supervisor":
            return
        elif m["event"] == "watchdog":
            found = ("watchdog", m["detail"] if m["detail"] in DOUBTS else "silence")
        elif m["state"] in STOPS and m["event"] != "reset_refused":
            found = ("stop", m["event"])
        else:
            return
        self.seen[(*key, self.phases.get(session, ""), *found)] += 1

    def rows(self) -> list[dict[str, Any]]:
        """Rows of `holds`."""
        return [
            {**dict(zip(KEYS["holds"], key, strict=True)), "count": count}
            for key, count in sorted(self.seen.items())
        ]


def derived_shadow(path: Path) -> dict[str, list[dict[str, Any]]]:
    """Rows of the tables of `KEYS` that follow from a journal file.

    Returns:
        By table: its columns but the training seed; of a candidate's actions the SHA-256
        (`raw_sha256`, `projected_sha256`).

    Raises:
        IntegrityError: No regular file.
        BadInputError: Not a whole journal, or an event that cannot be read.
    """
    conditions: dict[tuple[str, str], Condition] = {}
    sessions: dict[str, dict[str, Any]] = {}
    phases: dict[str, str] = {}
    asked: set[tuple[str, str]] = set()
    still = Stillness()
    candidates = []
    for kind, message in read_messages(path):
        name = str(message.get("session"))
        if kind == "session":
            sessions[name] = message["labels"]
            continue
        labels = sessions.get(name, {})
        key = (str(labels.get("method")), str(labels.get("fixture")))
        still.read(kind, message, key)
        if kind == "observation":
            phases.setdefault(name, str(message["phase"]))
        elif kind == "invocation":
            asked.add(key)
            continue
        elif kind == "candidate" and key[1] != REPLAYED:
            candidates.append(_candidate(message, key, labels, phases.get(name, "")))
        conditions.setdefault(key, Condition()).read(kind, message, 0)
    played = {key: conditions[key] for key in sorted(asked)}
    return {
        "candidates": candidates,
        "stub": [
            {**_named(key), "delivered": found.enqueued, **found.rows()["stub"][0]}
            for key, found in played.items()
        ],
        "counts": [row for key, found in played.items() for row in _counts(key, found)],
        "holds": still.rows(),
    }


def _named(key: tuple[str, str]) -> dict[str, Any]:
    return {"method": key[0], "fixture": key[1]}


def _candidate(
    m: Message, key: tuple[str, str], labels: dict[str, Any], phase: str
) -> dict[str, Any]:
    return {
        **_named(key),
        "situation": labels.get("situation"),
        "phase": phase,
        "observation": int(labels.get("observation", -1)),
        "candidate": m["index"],
        **m["layers"],
        "first_reason": m["first_reason"] or "",
        **m["measures"],
    }


def _counts(key: tuple[str, str], found: Condition) -> list[dict[str, Any]]:
    rows = found.rows()
    balance = {name: rows["conservation"][0][name] for name in ("generated", "executed", "queued")}
    return [{**_named(key), **balance, **row} for row in rows["counts"]]
