"""Which candidates the layers refused, by the verdicts that journals state."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from genpolicy.verification.journal_source import Message

KEYS = ("method", "perturbation", "start", "chunk_id", "candidate")
"""Columns by which a row of `refused.parquet` is known."""
Rollout = tuple[str, str, int]


@dataclass
class RefusedCandidates:
    """Takes the events of journals in, and gives a row for every candidate that was refused."""

    _of: dict[str, Rollout] = field(default_factory=dict)
    _rows: list[dict[str, Any]] = field(default_factory=list)

    def read(self, kind: str, m: Message) -> None:
        """Take an event in.

        Raises:
            ValueError: A candidate that a layer refused has no reason, or one that passed has.
        """
        if kind == "session":
            labels = m["labels"]
            self._of[m["session"]] = (
                str(labels.get("method")), str(labels.get("perturbation")),
                int(labels.get("start", -1)),
            )  # fmt: skip
        elif kind == "candidate":
            refusing = [name for name, ok in m["layers"].items() if ok is not True]
            if bool(refusing) != bool(m["first_reason"]):
                raise ValueError(f"{m['chunk_id']!r}: layers and reason contradict each other")
            if not refusing:
                return
            method, perturbation, start = self._of[m["session"]]
            self._rows.append(
                {
                    "method": method, "perturbation": perturbation, "start": start,
                    "chunk_id": m["chunk_id"], "candidate": m["index"],
                    "layer": refusing[0],
                    "first_reason": m["first_reason"],
                    "raw_sha256": m["measures"]["raw_sha256"],
                    "projected_sha256": m["measures"]["projected_sha256"],
                }
            )  # fmt: skip

    def rows(self, kept: set[Rollout]) -> Iterator[dict[str, Any]]:
        """The rows of these rollouts, arrays by their hash."""
        for row in self._rows:
            if (row["method"], row["perturbation"], row["start"]) in kept:
                yield row
