"""How far an evidence reaches along the route: what it could look at in every fifth of it.

Situations crowd where episodes do: at a common start, and where all arrive. There the choice is
not yet made, or over. So to deny modes it takes support in every fifth of the way, and a verdict
says in which of them nothing could be looked at.

Whoever goes round something chooses when he leaves, and a few rows later his place and speed show
which way. Those later rows are most of the first fifth. Where hardly any of the departures could be
looked at, they stand for it alone.
"""

from collections.abc import Sequence

import numpy as np

from genpolicy.audit.data import AuditInput, Flags, Integers
from genpolicy.audit.reach_rows import Reach
from genpolicy.audit.rests import leaving, rank_of
from genpolicy.audit.settings import AuditSettings

FIFTHS = 5
# Rows of a departure, a share of a chunk; so many must have been asked, and of less than this share
# of what else is said of the first fifth, for them to stand for it.
DEPARTURE, DEPARTURES, BLIND = 4, 20, 0.5


def fifth_of(data: AuditInput, settings: AuditSettings, rows: Integers) -> Integers:
    """Fifth of its episode's way in which each row lies, 0 to 4.

    The way is what the observed position travels until the last row of which a situation is
    looked for, so that waiting makes none of it; where nothing travels, rows are counted.

    Args:
        data: Canonical audit input.
        settings: Chunk length: situations are looked for while half a chunk is left.
        rows: Shape (n,).

    Returns:
        Shape (n,).
    """
    moved = data.position if data.position.shape[1] else np.zeros((len(data.episode), 1))
    steps = np.zeros(len(data.episode))
    steps[1:] = np.linalg.norm(np.diff(moved, axis=0), axis=1)
    steps[data.first_row[data.first_row]] = 0.0
    travelled = np.cumsum(steps)
    first = data.first_row[rows]
    last = np.maximum(data.last_row[rows] - settings.chunk_rows // 2, first)
    whole = travelled[last] - travelled[first]
    by_rows = (rows - first) / np.maximum(last - first, 1)
    along = np.where(whole > 0.0, (travelled[rows] - travelled[first]) / _positive(whole), by_rows)
    return np.asarray(np.clip(along * FIFTHS, 0, FIFTHS - 1), dtype=np.int64)


def departures(data: AuditInput, settings: AuditSettings, rows: Integers) -> Flags:
    """Rows in which an episode leaves its start, after a rest there. Shape (n,)."""
    rank = rank_of(data, leaving(data))
    return np.asarray(rank[rows] < max(1, settings.chunk_rows // DEPARTURE))


def with_departures(fifths: Integers, departs: Flags, spoke: Flags) -> Integers:
    """Fifths of which the first holds departures alone, where hardly any could be looked at.

    Args:
        fifths: Fifth of each query, 0 to 4. Shape (n,).
        departs: Whether an episode leaves its start there. Shape (n,).
        spoke: Whether the evidence could speak of it. Shape (n,).

    Returns:
        Fifths; `FIFTHS` for what is counted in none. Shape (n,).
    """
    first = fifths == 0
    leaves = first & departs
    if np.count_nonzero(leaves) < DEPARTURES:
        return fifths
    blind = np.mean(spoke[leaves]) < BLIND * np.mean(spoke[first])
    return np.where(first & ~departs, FIFTHS, fifths) if blind else fifths


def reaches(kind: str, fifths: Integers, spoke: Sequence[bool] | np.ndarray) -> tuple[Reach, ...]:
    """Queries and those that could be answered, in each fifth.

    Args:
        kind: `local` or `learned`.
        fifths: Fifth of each query; `FIFTHS` for what is counted in none. Shape (n,).
        spoke: Whether the evidence could speak of it. Shape (n,).
    """
    answered = np.asarray(spoke, dtype=bool)
    return tuple(
        Reach(
            kind,
            number + 1,
            int(np.count_nonzero(fifths == number)),
            int(np.count_nonzero(answered[fifths == number])),
        )
        for number in range(FIFTHS)
    )


def _positive(values: np.ndarray) -> np.ndarray:
    return np.where(values > 0.0, values, 1.0)
