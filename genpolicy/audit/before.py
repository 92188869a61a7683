"""What episodes that had a choice saw well before it, beside what they see now.

Situations show one observation, so an episode's past and present are said as its place among those
who saw the same: a rank. A median would not do. Of a lamp that shone green or red it is one of the
two, and which one changes from situation to situation.
"""

from dataclasses import dataclass

import numpy as np

from genpolicy.audit.choices import LEAST_SHARE, Choices
from genpolicy.audit.data import Array, AuditInput, Integers
from genpolicy.audit.history import centred_ranks, past_features, present_features, shortest_gap
from genpolicy.audit.modes import Clustering
from genpolicy.audit.neighbourhoods import Neighbourhood
from genpolicy.audit.persistence import MINIMUM_PER_MODE
from genpolicy.audit.resolution import courses_part, observed_gap
from genpolicy.audit.settings import AuditSettings

# Clusters that differ this much in what is observed have begun to move apart, in scales.
STILL_TOGETHER = 0.5


@dataclass(frozen=True)
class Before:
    """Episodes with a choice, and a past to look at where they had it.

    Attributes:
        choices: Their choices, with the share of each mode in the situation that is asked.
        past: Features of the past, as centred ranks between -0.5 and 0.5. Shape (n, P).
        present: The same of the present. Shape (n, F).
        reached: Episodes with a choice between the modes anywhere that long after their start,
            whether or not the clusters still stood together there. At the start nothing was seen
            before. A few that split later inside one mode (another way round, after an event)
            chose nothing that is asked about.
    """

    choices: Choices
    past: Array
    present: Array
    reached: int


def seen_before(
    data: AuditInput,
    settings: AuditSettings,
    items: list[tuple[Neighbourhood, Clustering]],
    choices: Choices,
) -> Before:
    """Past and present of each episode in one situation.

    Of its situations long enough after the start it is the one whose clusters differ least in what
    is observed now. Episodes that have none had nothing to see before, or moved apart at once;
    they are left out. So are rows that stand together and go apart: the more episodes there are,
    the nearer they stand, and where each came from then tells where it goes. How frequent a mode
    is, is read off that situation too: in an earlier one a cue may still be seen, its neighbours
    are those who saw the same cue, and what it tells would pass for what everybody can see.

    Args:
        data: Canonical audit input.
        settings: Horizons.
        items: Situations of one phase with several modes.
        choices: Who chose what in that phase.
    """
    gap = shortest_gap(settings)
    gaps = np.array([observed_gap(data, settings, *item) for item in items])
    n = len(choices.episode)
    past, present = np.zeros((n, 0)), np.zeros((n, 0))
    share = np.zeros_like(choices.share)
    place = {int(episode): number for number, episode in enumerate(choices.episode)}
    missing, reached = np.ones(n, dtype=bool), np.zeros(n, dtype=bool)
    for number in np.argsort(np.round(gaps, 6), kind="stable"):
        rows = items[int(number)][0].members
        rows = rows[[int(data.episode[row]) in place for row in rows]]
        rows = rows[rows - data.first_row[rows] >= gap]
        at = np.array([place[int(data.episode[row])] for row in rows], dtype=np.int64)
        reached[at] |= _several(choices.mode[at])
        new, together = missing[at], STILL_TOGETHER - gaps[int(number)] > 0
        if not together or not new.any() or not _undecided(data, settings, rows, choices.mode[at]):
            continue
        earlier = past_features(data, settings, rows)[0]
        now = present_features(data, settings, rows)
        one = np.zeros(len(rows), dtype=np.int64)
        if missing.all():
            past = np.full((n, earlier.shape[1]), np.nan)
            present = np.full((n, now.shape[1]), np.nan)
        past[at[new]] = centred_ranks(earlier, one)[new] / len(rows)
        present[at[new]] = centred_ranks(now, one)[new] / len(rows)
        share[at[new]] = np.bincount(choices.mode[at], minlength=share.shape[1]) / len(at)
        missing[at] = False
    # As in `choices`: so rare a mode is a slip of the linking, and would weigh as much as twenty.
    share[share < LEAST_SHARE] = 0.0
    chose = share[np.arange(n), choices.mode] > 0.0
    missing |= ~chose | (np.count_nonzero(share, axis=1) < 2)
    known = ~missing
    share = share[known] / share[known].sum(axis=1, keepdims=True)
    part = Choices(choices.episode[known], choices.mode[known], share)
    return Before(part, past[known], present[known], int(np.count_nonzero(reached)))


def _undecided(data: AuditInput, settings: AuditSettings, rows: Integers, modes: Integers) -> bool:
    """Whether rows of several modes, more than one of each, have not begun to go apart."""
    return _several(modes) and not courses_part(data, settings, rows, modes)


def _several(modes: Integers) -> bool:
    """Whether there are several modes, more than one of each."""
    return bool(np.count_nonzero(np.bincount(modes) >= MINIMUM_PER_MODE) > 1)
