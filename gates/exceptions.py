"""How long a written exception may hold: asked of whoever acts on it, never of a report.

A report is derived again anywhere and later; the day on which somebody judges, trains or goes on is
theirs. UTC, as of the card.
"""

import datetime
from collections.abc import Collection, Mapping
from typing import Any

from gates.floors import LONGEST_DAYS
from gates.report import parse_section, stage_of
from gates.reproducibility.settings import Unmatched, of_nobody
from gates.settings import PARAMS_FILE
from genpolicy.errors import ConfigError

OVER = "Remove the entry, and the limit counts again; or have it renewed, with a reason."


def utc_today() -> datetime.date:
    """Today, UTC."""
    return datetime.datetime.now(datetime.UTC).date()


def require_day(where: str, expires: str, day: datetime.date, *, over: str = OVER) -> None:
    """Require of the last day of an exception that it is not past, and not too far.

    Args:
        where: The exception, for a person.
        expires: Its last day, YYYY-MM-DD.
        day: Today.
        over: What to do about one that is over.

    Raises:
        ConfigError: It is.
    """
    left = (datetime.date.fromisoformat(expires) - day).days
    if left > LONGEST_DAYS:
        raise ConfigError(
            where=where,
            found=f"until {expires}, {left} days from now",
            expected=f"a last day at most {LONGEST_DAYS} days from {day} (UTC)",
            action="An exception is for a while: write a nearer day, or change the limit.",
        )
    if left < 0:
        raise ConfigError(
            where=where,
            found=f"over since {expires}",
            expected=f"a last day that is not before {day} (UTC)",
            action=over,
        )


def unmatched_written(params: Mapping[str, Any]) -> dict[str, Unmatched]:
    """Exceptions of candidates that were brought, as `gate_b.unmatched` names them.

    Raises:
        ConfigError: One is malformed.
    """
    gate = params.get(stage_of("B"))
    entries = gate.get("unmatched") if isinstance(gate, dict) else None
    if not isinstance(entries, dict):
        return {}
    return {
        str(name): parse_section(Unmatched, entry, where=_place(name))
        for name, entry in entries.items()
    }


def require_unmatched(
    entries: Mapping[str, Unmatched], day: datetime.date, *, brought: Collection[str] | None = None
) -> None:
    """Require of each that it holds today, and is of somebody who was brought.

    Args:
        entries: By candidate.
        day: Today.
        brought: Names of the candidates that were brought; None where that was asked already.

    Raises:
        ConfigError: It does not, or is not.
    """
    if brought is not None and (others := of_nobody(entries, brought)):
        raise ConfigError(
            where=_place(others[0]),
            found="an exception of nobody who was brought",
            expected=f"one of {', '.join(sorted(brought)) or 'none: candidates is empty'}",
            action="What is trained here is matched: remove it, or correct the name.",
        )
    for name, entry in sorted(entries.items()):
        renew = "Write a new last day and why it still stands, or leave the candidate out."
        require_day(_place(name), entry.expires, day, over=renew)


def _place(name: object) -> str:
    return f"{PARAMS_FILE}: {stage_of('B')}.unmatched.{name}"
