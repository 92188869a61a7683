"""Which rollouts are worth a look: by a rule that needs no person, and one condition at a time.

A failure is kept whole; of the others only those that the rule names. A shard holds one condition
and cannot know the others, so the rule asks of none of them what only all together could say: the
median of a mode is that of the condition in which it succeeds most.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Protocol


class Ended(Protocol):
    """What the rule asks of a rollout; columns of `RolloutRow`."""

    @property
    def perturbation(self) -> str:
        """What was injected."""
        ...

    @property
    def outcome(self) -> str:
        """How it ended."""
        ...

    @property
    def success(self) -> bool:
        """Whether it succeeded."""
        ...

    @property
    def mode(self) -> str:
        """Mode of the path."""
        ...

    @property
    def duration_s(self) -> float:
        """Virtual time, s."""
        ...

    @property
    def force_peak_n(self) -> float:
        """Largest contact force, N."""
        ...


def worth_watching(rows: Sequence[Ended]) -> dict[int, list[str]]:
    """Places of the rollouts to watch, and why each is, in the order of the rule.

    The rule: the success of median duration of each mode, in the condition in which the mode
    succeeds most; the slowest success; the largest force; of each kind of failure that of median
    duration.

    Args:
        rows: Rollouts of one method, by condition and start.
    """
    found: dict[int, list[str]] = {}
    for place, why in _by_rule(rows):
        found.setdefault(place, []).append(why)
    return found


def kept_whole(rows: Sequence[Ended]) -> list[bool]:
    """Of each rollout of one method under one condition, whether everything is kept of it."""
    watched = worth_watching(rows)
    return [not row.success or place in watched for place, row in enumerate(rows)]


def _by_rule(rows: Sequence[Ended]) -> Iterator[tuple[int, str]]:
    won = [place for place, row in enumerate(rows) if row.success]
    for mode in sorted({rows[place].mode for place in won}):
        own = [place for place in won if rows[place].mode == mode]
        counts = Counter(rows[place].perturbation for place in own)
        most = min(counts, key=lambda name: (-counts[name], name))
        within = [place for place in own if rows[place].perturbation == most]
        yield _median(rows, within), f"median success of mode {mode}"
    if won:
        yield max(won, key=lambda place: rows[place].duration_s), "slowest success"
    if any(row.force_peak_n > 0 for row in rows):
        hardest = max(range(len(rows)), key=lambda place: rows[place].force_peak_n)
        yield hardest, "largest force"
    for outcome in sorted({row.outcome for row in rows if not row.success}):
        own = [n for n, row in enumerate(rows) if not row.success and row.outcome == outcome]
        yield _median(rows, own), f"{outcome}: median of {len(own)}".replace("_", " ")


def _median(rows: Sequence[Ended], places: Sequence[int]) -> int:
    """The one in the middle by duration; of an even number the shorter one."""
    order = sorted(places, key=lambda place: rows[place].duration_s)
    return order[(len(order) - 1) // 2]
