"""The choices that episodes made: which mode, between which, and what each counts.

An episode chose where its situations hold several modes. How likely each of them is there is read
off the situations themselves, so where the observation makes a mode frequent, guessing it is no
skill: each episode counts the inverse of how frequent its mode is among those who saw the same.
"""

from dataclasses import dataclass

import numpy as np

from genpolicy.audit.data import Array, AuditInput, Flags, Integers
from genpolicy.audit.modes import Clustering
from genpolicy.audit.neighbourhoods import Neighbourhood

# A mode that fewer than one in twenty chose in the same place is a slip of the linking.
LEAST_SHARE = 0.05


@dataclass(frozen=True)
class Choices:
    """Episodes that had a choice in one phase.

    Attributes:
        episode: Positions of the episodes. Shape (n,).
        mode: What each chose. Shape (n,).
        share: Share of each mode among those who saw the same, 0 where there is none of it.
            Shape (n, K).
    """

    episode: Integers
    mode: Integers
    share: Array

    @property
    def allowed(self) -> Flags:
        """Modes that each could choose. Shape (n, K)."""
        return np.asarray(self.share > 0.0)

    @property
    def weight(self) -> Array:
        """Inverse of the share of the chosen mode. Shape (n,)."""
        return np.asarray(1.0 / self.share[np.arange(len(self.mode)), self.mode])

    @property
    def chance(self) -> float:
        """Weighted share of right guesses that no knowledge gives."""
        total = float(self.weight.sum())
        return len(self.mode) / total if total > 0.0 else 1.0


def choices(
    data: AuditInput, items: list[tuple[Neighbourhood, Clustering]], links: Integers
) -> Choices:
    """Who chose what between which modes.

    Args:
        data: Canonical audit input.
        items: Situations of one phase with several modes.
        links: Mode of each episode, -1 for none. Shape (E,).
    """
    kinds = int(links.max(initial=-1)) + 1
    total, times = np.zeros((len(links), kinds)), np.zeros(len(links))
    for situation, _ in items:
        members = data.episode[situation.members]
        members = members[links[members] >= 0]
        if len(members):
            seen = np.bincount(links[members], minlength=kinds) / len(members)
            total[members] += seen
            times[members] += 1.0
    share = total / np.maximum(times, 1.0)[:, None]
    share[share < LEAST_SHARE] = 0.0
    chose = np.flatnonzero((links >= 0) & (np.count_nonzero(share, axis=1) > 1))
    chose = chose[share[chose, links[chose]] > 0.0]
    share = share[chose] / share[chose].sum(axis=1, keepdims=True)
    return Choices(chose, links[chose], share)
