"""What journals say of the comparison's other tables, derived again from raw events.

Invocations, the balance of chunks, what reached the controller stub and how old actions were.
Shares no code with what wrote the tables, so that a row and its journal are two witnesses.
"""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from genpolicy.verification.journal_source import Message, read_messages
from genpolicy.verification.refused import RefusedCandidates
from genpolicy.verification.rollouts import order_statistic
from genpolicy.verification.spliced import Spliced

AGE_LEVELS = (0.0, 0.05, 0.25, 0.5, 0.75, 0.9, 0.95, 0.99, 1.0)
NOT_THE_ADMITTED = "infeasible"
"""Why the stub refuses an action that is not a row of a chunk that passed; else it was stale."""
KEYS: dict[str, tuple[str, ...]] = {
    "invocations": ("method", "perturbation", "start", "invocation"),
    "counts": ("method", "perturbation", "reason"),
    "conservation": ("method", "perturbation"),
    "stub": ("method", "perturbation"),
    "overruns": ("method", "perturbation", "term", "action"),
    "faults": ("method", "perturbation", "fault"),
    "ages": ("method", "perturbation", "level"),
}
"""Tables that are derived here, and the columns by which a row is known."""


@dataclass
class Condition:
    """Counts of one method under one perturbation or fixture while events go by."""

    latencies_s: dict[int, dict[str, float]] = field(default_factory=dict)
    generated: int = 0
    enqueued: int = 0
    executed: int = 0
    discarded: Counter[str] = field(default_factory=Counter)
    ages_ns: list[int] = field(default_factory=list)
    arrivals: int = 0
    refused: Counter[str] = field(default_factory=Counter)
    overruns: Counter[tuple[str, str]] = field(default_factory=Counter)
    faults: Counter[str] = field(default_factory=Counter)

    def read(self, kind: str, m: Message, start: int) -> None:
        """Take an event of the rollout from this start in."""
        if kind == "invocation" and m["stage"] in ("begin", "check"):
            own = self.latencies_s.setdefault(start, {})
            own[m["id"]] = own.get(m["id"], 0.0) + float(m["detail"])
        elif kind == "invocation" and m["stage"] == "overrun":
            term, action = m["detail"].split()
            self.overruns[term, action] += 1
        elif kind == "invocation" and m["stage"] == "fault":
            self.faults[m["detail"]] += 1
        elif kind == "enqueue":
            self.generated += 1
            self.enqueued += 1
        elif kind in ("discard", "finish"):
            self.generated += m.get("at") == "arrival"
            self.executed += m["ended"] == "executed"
            if m["ended"] == "discarded":
                self.discarded[str(m.get("reason"))] += 1
        elif kind in ("accept", "fallback", "refuse"):
            self.arrivals += 1
            if kind == "accept":
                self.ages_ns.append(m["age_ns"])
            elif kind == "refuse":
                self.refused["invalid" if m["reason"] == NOT_THE_ADMITTED else "stale"] += 1

    def rows(self) -> dict[str, list[dict[str, Any]]]:
        """Rows by table, without method and perturbation."""
        ages_s = [age / 1e9 for age in self.ages_ns]
        lost = sum(self.discarded.values())
        return {
            "invocations": [
                {"start": start, "invocation": number, "latency_s": latency_s}
                for start, latencies in sorted(self.latencies_s.items())
                for number, latency_s in enumerate(latencies.values())
            ],
            "counts": [
                {"reason": reason, "count": count}
                for reason, count in sorted(self.discarded.items()) or [("", 0)]
            ],
            "conservation": [
                {
                    "generated": self.generated,
                    "executed": self.executed,
                    "queued": self.generated - self.executed - lost,
                    "discarded": lost,
                }
            ],
            "stub": [
                {
                    "arrivals": self.arrivals,
                    "stale": self.refused["stale"],
                    "invalid": self.refused["invalid"],
                }
            ],
            "overruns": [
                {"term": term, "action": action, "count": count}
                for (term, action), count in sorted(self.overruns.items()) or [(("", ""), 0)]
            ],
            "faults": [
                {"fault": fault, "count": count}
                for fault, count in sorted(self.faults.items()) or [("", 0)]
            ],
            "ages": [
                {
                    "level": level,
                    "action_age_s": order_statistic(ages_s, level),
                    "actions": len(ages_s),
                }
                for level in (AGE_LEVELS if ages_s else ())
            ],
        }


def derived_tables(
    journals: Iterable[Path],
    spliced: Spliced | None = None,
    refused: RefusedCandidates | None = None,
) -> dict[str, list[dict[str, Any]]]:
    """Rows of the tables of `KEYS` that follow from journal files.

    Args:
        journals: The files.
        spliced: What takes the same events in beside, so that a journal is read once.
        refused: Likewise.

    Returns:
        By table: its columns but the training seed. Times in s.

    Raises:
        IntegrityError: No regular file.
        BadInputError: Not a whole journal, or an event that cannot be read.
    """
    conditions: dict[tuple[str, str], Condition] = {}
    for path in journals:
        sessions: dict[str, tuple[Condition, int]] = {}
        if spliced is not None:
            spliced.forget()
        for kind, message in read_messages(path):
            if spliced is not None:
                spliced.read(kind, message)
            if refused is not None:
                refused.read(kind, message)
            name = str(message.get("session"))
            if kind == "session":
                labels = message["labels"]
                key = (str(labels.get("method")), str(labels.get("perturbation")))
                condition = conditions.setdefault(key, Condition())
                sessions[name] = (condition, int(labels.get("start", -1)))
            elif name in sessions:
                condition, start = sessions[name]
                condition.read(kind, message, start)
    found: dict[str, list[dict[str, Any]]] = {name: [] for name in KEYS}
    for (method, perturbation), condition in sorted(conditions.items()):
        for table, rows in condition.rows().items():
            found[table] += [
                {"method": method, "perturbation": perturbation, **row} for row in rows
            ]
    return found
