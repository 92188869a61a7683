"""Whether a limit may be overridden by this person, today: asked of whoever acts on a report.

A report is a function of the evidence: neither the day nor the list of people changes a byte of it,
so that it is derived again anywhere and later. What they decide is whether anybody goes on with it:
a gate that is judged, a stage that is admitted, a card. The day is the one of the card's own
validity, UTC.
"""

import datetime
from collections.abc import Mapping, Sequence
from pathlib import Path

from gates.card.people import ALLOW_LIST, AUTHOR, SPOTTER, AllowList, load_allow_list
from gates.exceptions import require_day, require_unmatched, unmatched_written, utc_today
from gates.overrides import CORRECT, Override, placed, read_overrides
from gates.report import Gate, GateReport, Overridden, stage_of
from gates.reproducibility.settings import BROUGHT_FOLDER
from gates.settings import read_params
from genpolicy.errors import ConfigError
from genpolicy.evidence.documents.brought import BROUGHT


def require_written(root: Path, today: datetime.date | None = None) -> None:
    """Require of every exception that is written that it may be, and still holds.

    Args:
        root: Repository root.
        today: Day of the judgement; today (UTC) if not given.

    Raises:
        ConfigError: One is malformed, over, for too long, or by somebody who may not; or
            `params.yaml` or the allow-list cannot be read.
    """
    params = read_params(root)
    require_unmatched(unmatched_written(params), today or utc_today())
    _require(root, read_overrides(root, params), today)


def require_in_force(
    root: Path, reports: Mapping[Gate, GateReport], today: datetime.date | None = None
) -> None:
    """Require of every exception that reports stand on that it may be, and still holds.

    Args:
        root: Repository root.
        reports: Proved ones, by gate; the highest says what those below it stand on.
        today: Day on which somebody goes on; today (UTC) if not given.

    Raises:
        ConfigError: As `require_written`.
    """
    if "B" in reports:
        require_unmatched(
            unmatched_written({stage_of("B"): reports["B"].settings}), today or utc_today()
        )
    if reports:
        _require(root, reports[max(reports)].overrides, today)


def first_end(entries: Sequence[Overridden], candidate: str) -> str:
    """Day on which the first exception ends that a candidate stands on; empty without one."""
    own = [entry.expires for entry in entries if entry.candidate in (None, candidate)]
    return min(own, default="")


def _require(
    root: Path, entries: Sequence[Override | Overridden], today: datetime.date | None
) -> None:
    if not entries:
        return
    day = today or utc_today()
    allowed, authors = load_allow_list(root), _authors(root)
    brought = made_by(root)
    for entry in entries:
        require_day(placed(entry), entry.expires, day)
        if why := _unfit(entry, allowed, authors, brought):
            raise ConfigError(
                where=f"{placed(entry)}: by",
                found=why,
                expected=f"a reviewer or an owner on {ALLOW_LIST} who did not make the candidate",
                action=CORRECT,
            )


def _unfit(
    entry: Override | Overridden,
    allowed: AllowList,
    authors: Sequence[str],
    brought: Mapping[str, str],
) -> str:
    """Why somebody may not override a limit; empty if they may."""
    person = allowed.find(entry.by)
    if person is None:
        return f"{entry.by!r:.60}, who is not on {ALLOW_LIST}"
    if person.id in authors or person.role == AUTHOR:
        return f"{person.id}, an author"
    if person.role == SPOTTER:
        return f"{person.id}, a spotter"
    made = sorted(
        name
        for name, mail in brought.items()
        if mail in person.mails and entry.candidate in (None, name)
    )
    return f"{person.id}, who made {made[0]}" if made else ""


def _authors(root: Path) -> tuple[str, ...]:
    """Who made the candidate, as its card will name them."""
    card = read_params(root).get("card")
    named = card.get("authors") if isinstance(card, Mapping) else None
    return tuple(map(str, named)) if isinstance(named, list) else ()


def made_by(root: Path) -> dict[str, str]:
    """Address of whoever made each candidate that was brought."""
    folder = root / BROUGHT_FOLDER
    found = BROUGHT.read(folder) if (folder / BROUGHT.file).is_file() else {}
    return {name: entry.author.casefold() for name, entry in found.items()}
