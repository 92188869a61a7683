"""What a journal says of each rollout: the rows of the comparison, derived again from raw events.

Shares no code with the rollout that wrote them, so that a row and its journal are two witnesses.
"""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from genpolicy.verification.journal_source import Message, read_messages
from genpolicy.verification.recoveries import Recoveries

ASKED, ABORTED = "ask_human", "abort"
"""What calls a person: recovery asks one, or gives up by itself."""
SUCCESS = "success"
NEVER_ANSWERED = ("deadline", "overrun")
"""How an invocation ends that missed its deadline: that of the whole, or that of a term."""


def derived_with_recoveries(path: Path) -> tuple[dict[str, dict[str, Any]], list[dict[str, Any]]]:
    """Columns of each rollout of a journal file by session, and rows of `recoveries.parquet`.

    Neither names a training seed. Times in s, force in N.

    Raises:
        IntegrityError: No regular file.
        BadInputError: Not a whole journal, or an event that cannot be read.
    """
    sessions: dict[str, _Session] = {}
    for kind, message in read_messages(path):
        sessions.setdefault(str(message.get("session")), _Session()).read(kind, message)
    rollouts = {name: session.columns() for name, session in sessions.items()}
    return rollouts, [row for session in sessions.values() for row in session.recovered()]


def differences(row: dict[str, Any], derived: dict[str, Any]) -> list[str]:
    """Columns of a row that are not what the journal says."""
    return sorted(name for name, value in derived.items() if row.get(name) != value)


@dataclass
class _Session:
    """Counts of one rollout while its events go by."""

    labels: dict[str, str] = field(default_factory=dict)
    period_ns: int = 0
    end_ns: int = 0
    outcome: str = ""
    mode: str = ""
    peak_n: float = 0.0
    counts: Counter[str] = field(default_factory=Counter)
    rejected_by: Counter[str] = field(default_factory=Counter)
    answers: dict[str, str] = field(default_factory=dict)
    open_rejections: set[str] = field(default_factory=set)
    ages_ns: list[int] = field(default_factory=list)
    latencies_s: dict[str, float] = field(default_factory=dict)
    recoveries: Recoveries = field(default_factory=Recoveries)

    def read(self, kind: str, m: Message) -> None:
        """Take an event in."""
        self.recoveries.read(kind, m)
        if kind == "session":
            self.labels, self.period_ns = m["labels"], m["period_ns"]
        elif kind == "invocation":
            self._invocation(m)
        elif kind == "joined":
            self.answers[m["chunk_id"]] = m["invocation"]
        elif kind == "candidate":
            self._candidate(m)
        elif kind in ("accept", "fallback"):
            self.counts[kind] += 1
            if kind == "accept":
                self.ages_ns.append(m["age_ns"])
        elif kind in ("discard", "finish"):
            self.counts["discards"] += m["ended"] == "discarded"
        elif kind == "recovery":
            # Who was called and did not come, or gave up, was called once.
            self.counts["calls"] += m["new"] == ASKED or (
                m["new"] == ABORTED and m["old"] not in (ASKED, "person")
            )
        elif kind == "person":
            self.counts["person_ns"] += -m["t"] if m["stage"] == "took_over" else m["t"]
        elif kind == "force":
            self.peak_n = max(self.peak_n, m["force_n"])
        elif kind == "outcome":
            self.outcome, self.mode = m["outcome"], m["mode"]
        elif kind == "end":
            self.end_ns = m["t"]

    def _invocation(self, m: Message) -> None:
        if m["stage"] == "begin":
            self.counts["invocations"] += 1
            self.latencies_s[m["id"]] = float(m["detail"])
        elif m["stage"] == "check":
            self.latencies_s[m["id"]] += float(m["detail"])
        self.counts["misses"] += m["stage"] == "end" and m["detail"] in NEVER_ANSWERED

    def _candidate(self, m: Message) -> None:
        """An invocation counts as rejected until one of its candidates passes every layer."""
        invocation = self.answers.get(str(m["chunk_id"]), str(m["chunk_id"]))
        if all(passed is True for passed in m["layers"].values()):
            self.open_rejections.discard(invocation)
        else:
            self.open_rejections.add(invocation)
            self.rejected_by[str(m["first_reason"])] += 1

    def named(self) -> dict[str, Any]:
        """Which rollout it is."""
        return {
            "method": self.labels.get("method"),
            "perturbation": self.labels.get("perturbation"),
            "start": int(self.labels.get("start", -1)),
        }

    def recovered(self) -> list[dict[str, Any]]:
        """A row for each entry into recovery."""
        rows = self.recoveries.rows(succeeded=self.outcome == SUCCESS)
        return [{**self.named(), **row} for row in rows]

    def columns(self) -> dict[str, Any]:
        """The columns at the end."""
        ages = [age / 1e9 for age in self.ages_ns]
        recoveries = self.recovered()
        ticks = round(self.end_ns / self.period_ns) if self.period_ns else 0
        return {
            **self.named(),
            "start_sha256": self.labels.get("start_sha256"),
            "outcome": self.outcome,
            "success": self.outcome == SUCCESS,
            "duration_s": ticks * (self.period_ns / 1e9),
            "ticks": ticks,
            "action_ticks": self.counts["accept"],
            "fallback_ticks": self.counts["fallback"],
            "hold_ticks": ticks - self.counts["accept"] - self.counts["fallback"],
            "invocations": self.counts["invocations"],
            "deadline_misses": self.counts["misses"],
            "discards": self.counts["discards"],
            "rejections": len(self.open_rejections),
            "rejected_by": max(
                sorted(self.rejected_by), key=lambda name: self.rejected_by[name], default=""
            ),
            "recovery_attempted": bool(recoveries),
            "recovered": bool(recoveries) and recoveries[-1]["recovered"],
            "interventions": self.counts["calls"],
            "person_s": self.counts["person_ns"] / 1e9,
            "action_age_p50_s": order_statistic(ages, 0.5),
            "action_age_p95_s": order_statistic(ages, 0.95),
            "action_age_max_s": order_statistic(ages, 1.0),
            "latency_p95_s": order_statistic(list(self.latencies_s.values()), 0.95),
            "force_peak_n": self.peak_n,
            "mode": self.mode,
        }


def order_statistic(values: Sequence[float], level: float) -> float | None:
    """The smallest value that at least this share does not exceed; None without any."""
    if not values:
        return None
    return sorted(values)[math.ceil((len(values) - 1) * level)]
