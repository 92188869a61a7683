"""Every analysed situation: neighbours, clusters, whether they are modes, and what passes."""

from dataclasses import dataclass

import numpy as np

from genpolicy.audit.data import Array, AuditInput, relative_paths
from genpolicy.audit.mean_versus_modes import Admissible, MeanVersusModes, compare
from genpolicy.audit.modes import Clustering, cluster_chunks
from genpolicy.audit.neighbourhoods import Neighbourhood, Support, find
from genpolicy.audit.persistence import kept_identity
from genpolicy.audit.resolution import resolved_by_observation
from genpolicy.audit.settings import AuditSettings
from genpolicy.seeds import stream

Found = tuple[str, Neighbourhood, Clustering]
Several = dict[str, list[tuple[Neighbourhood, Clustering]]]


@dataclass(frozen=True)
class Situation:
    """One analysed situation with all that was found about it.

    Attributes:
        phase: Task phase.
        neighbourhood: Query and neighbours.
        clustering: Modes of their chunks.
        two_mode: Several modes, and no observed component tells them apart.
        identity: Share of episodes that keep their mode, and its null; None if not measurable.
        chunks: Mean, median and modal chunks with their verdicts.
    """

    phase: str
    neighbourhood: Neighbourhood
    clustering: Clustering
    two_mode: bool
    identity: tuple[float, Array] | None
    chunks: MeanVersusModes


def find_situations(
    data: AuditInput, settings: AuditSettings, root_seed: int
) -> tuple[list[Found], tuple[Support, ...]]:
    """Situations with their clusters, and the support, of every group of `data.grouping`."""
    found, support = [], []
    for phase in np.unique(data.grouping):
        items, reach = find(data, settings, phase=str(phase), root_seed=root_seed)
        support.append(reach)
        for item in items:
            paths = relative_paths(data, item.members, settings.chunk_steps)
            found.append((str(phase), item, cluster_chunks(paths, settings)))
    return found, tuple(support)


def claimed(data: AuditInput, settings: AuditSettings, found: list[Found]) -> set[int]:
    """Which entries of `found` have several modes under one observation.

    A phase in which too few held-out episodes show them is said to have one mode: a handful
    among many situations is what chance gives.
    """
    numbers: dict[str, list[int]] = {}
    analysed: dict[str, list[Neighbourhood]] = {}
    for number, (phase, item, split) in enumerate(found):
        analysed.setdefault(phase, []).append(item)
        if split.count > 1 and not resolved_by_observation(data, settings, item, split):
            numbers.setdefault(phase, []).append(number)
    return {
        number
        for phase, chosen in numbers.items()
        if episodes_of(data, [found[k][1] for k in chosen])
        >= settings.least_two_mode_episodes(episodes_of(data, analysed[phase]))
        for number in chosen
    }


def examine(
    data: AuditInput,
    settings: AuditSettings,
    entry: Found,
    two_mode: bool,
    *,
    admissible: Admissible | None,
    seed: int,
) -> Situation:
    """Persistence, and mean against modes, of one situation; both only where it has modes."""
    phase, item, clustering = entry
    identity = None
    if two_mode:
        name = str(data.episodes.uuid[data.episode[item.query]])
        rng = stream(seed, "audit", "persistence", phase, name, int(data.index[item.query]))
        identity = kept_identity(data, settings, item, clustering, rng=rng)
    check = admissible if two_mode else None
    chunks = compare(data, settings, item, clustering, admissible=check)
    return Situation(phase, item, clustering, two_mode, identity, chunks)


def by_phase(situations: tuple[Situation, ...]) -> Several:
    """Situations with several modes, per phase."""
    result: Several = {}
    for item in situations:
        if item.two_mode:
            result.setdefault(item.phase, []).append((item.neighbourhood, item.clustering))
    return result


def primary_phase(several: Several) -> str:
    """The phase with most situations of several modes."""
    return max(sorted(several), key=lambda phase: len(several[phase]), default="")


def episodes_of(data: AuditInput, items: list[Neighbourhood]) -> int:
    """Distinct episodes of the queries."""
    return len({int(data.episode[item.query]) for item in items})
