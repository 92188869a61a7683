"""Modes of episodes over all situations, from who was clustered with whom.

Up to some thousand episodes every pair is held against every other (average linkage). Beyond, the
quadratic table would not fit: modes are then carried from situation to situation through the
episodes that they share, and voted on until nothing changes.
"""

import heapq
from collections import Counter
from itertools import combinations

import numpy as np
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import squareform

from genpolicy.audit.data import Array, Integers
from genpolicy.audit.modes import by_size

UNKNOWN_PAIR = 0.5
MAXIMUM_PAIRED = 2000
SWEEPS = 10

Memberships = list[tuple[Integers, Integers]]


def link(memberships: Memberships, episodes: int, minimum: int) -> Integers:
    """Mode of each episode.

    Args:
        memberships: Per situation the episodes and their local modes. Shapes (n,) and (n,).
        episodes: Number of episodes.
        minimum: Smallest number of episodes of a mode.

    Returns:
        0 the largest; -1 where the episode was never in a situation with several modes, or its
        group is smaller than `minimum`. Shape (episodes,).
    """
    result = np.full(episodes, -1, dtype=np.int64)
    if not memberships:
        return result
    seen = np.unique(np.concatenate([members for members, _ in memberships]))
    if len(seen) < 2:
        return result
    place = np.full(episodes, -1, dtype=np.int64)
    place[seen] = np.arange(len(seen))
    local = [(place[members], labels) for members, labels in memberships]
    few = len(seen) <= MAXIMUM_PAIRED
    groups = by_size(paired(local, len(seen)) if few else carried(local, len(seen)))
    large = np.bincount(groups)[groups] >= minimum
    result[seen] = np.where(large, groups, -1)
    return result


def alternatives(memberships: Memberships, modes: Integers) -> dict[tuple[int, int], int]:
    """In how many situations two modes stand beside each other.

    Args:
        memberships: Per situation the episodes and their local modes. Shapes (n,) and (n,).
        modes: What `link` says of the episodes. Shape (episodes,).

    Returns:
        By pair of modes, the smaller first. A local mode stands for that of most of its episodes.
    """
    found: Counter[tuple[int, int]] = Counter()
    for members, labels in memberships:
        inside = modes[members]
        stands = {
            int(np.argmax(np.bincount(inside[mine])))
            for local in np.unique(labels)
            if (mine := (labels == local) & (inside >= 0)).any()
        }
        found.update(combinations(sorted(stands), 2))
    return dict(found)


def paired(memberships: Memberships, count: int) -> Integers:
    """Groups by average linkage of how often two episodes fell apart. Shape (count,)."""
    together, apart = np.zeros((count, count)), np.zeros((count, count))
    for members, labels in memberships:
        same = labels[:, None] == labels[None, :]
        block = np.ix_(members, members)
        together[block] += same
        apart[block] += ~same
    known = together + apart
    distance = np.divide(apart, known, out=np.full(known.shape, UNKNOWN_PAIR), where=known > 0)
    np.fill_diagonal(distance, 0.0)
    tree = linkage(squareform(distance, checks=False), method="average")
    return fcluster(tree, UNKNOWN_PAIR - 1e-9, criterion="distance").astype(np.int64)


def carried(memberships: Memberships, count: int) -> Integers:
    """Groups by carrying modes through shared episodes, then voting. Shape (count,).

    Every episode must be in a situation. Situations without a path of shared episodes to one
    another keep modes of their own.
    """
    kinds = 1 + max(int(labels.max()) for _, labels in memberships)
    order, region = _order(memberships, count)
    votes = np.zeros((count, kinds))
    for number in order:
        _cast(votes, *memberships[number], votes)
    groups = np.argmax(votes, axis=1)
    for _ in range(SWEEPS):
        again = np.zeros_like(votes)
        for members, labels in memberships:
            _cast(again, members, labels, votes)
        moved = np.argmax(again, axis=1)
        done = bool(np.array_equal(moved, groups))
        votes, groups = again, moved
        if done:
            break
    return np.asarray(region * kinds + groups, dtype=np.int64)


def _order(memberships: Memberships, count: int) -> tuple[list[int], Integers]:
    """Situations, always the one next that shares most with those before; region of each episode.

    A region begins where nothing is shared, with the situation of most modes.
    """
    where: list[list[int]] = [[] for _ in range(count)]
    for number, (members, _) in enumerate(memberships):
        for member in members.tolist():
            where[member].append(number)
    region = np.full(count, -1, dtype=np.int64)
    shared = [0] * len(memberships)
    starts = sorted(
        range(len(memberships)), key=lambda number: (-int(memberships[number][1].max()), number)
    )
    done: set[int] = set()
    order: list[int] = []
    for name, start in enumerate(starts):
        queue = [(0, start)]
        while queue:
            least, number = heapq.heappop(queue)
            if number in done or -least != shared[number]:
                continue
            done.add(number)
            order.append(number)
            for member in memberships[number][0].tolist():
                if region[member] >= 0:
                    continue
                region[member] = name
                for other in where[member]:
                    shared[other] += 1
                    heapq.heappush(queue, (-shared[other], other))
    return order, region


def _cast(into: Array, members: Integers, labels: Integers, votes: Array) -> None:
    """Add one vote of each member for the mode that its local one stands for."""
    kinds = int(labels.max()) + 1
    one = (labels[:, None] == np.arange(kinds)[None]).astype(np.float64)
    rows, columns = linear_sum_assignment(-(one.T @ votes[members]))
    stands = np.zeros(kinds, dtype=np.int64)
    stands[rows] = columns
    into[members, stands[labels]] += 1.0
