"""Every analysed situation: neighbours, clusters, whether they are modes, and what passes."""

from dataclasses import dataclass, replace

import numpy as np

from genpolicy.audit.component_rows import POSITION
from genpolicy.audit.components import TIMING, Component, series
from genpolicy.audit.data import Array, AuditInput, relative_paths
from genpolicy.audit.mean_versus_modes import Admissible, MeanVersusModes, compare
from genpolicy.audit.modes import ROUTE_CHUNKS, Clustering, cluster_chunks
from genpolicy.audit.neighbourhoods import Neighbourhood, Support, find
from genpolicy.audit.persistence import (
    kept_between,
    kept_identity,
    persistent,
    roughness,
    von_neumann,
)
from genpolicy.audit.progress import Progress, silent
from genpolicy.audit.resolution import Told, credible, resolved_by_observation
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
        noise_ratio: Von Neumann ratio of the spread along the chunk: 1 white, 0 smooth.
        noise_spread: RMS of that spread, unit of the position.
        component: Component of the action whose clusters these are.
        roughness: The same ratio of that component; None where it is that of the position.
        white_share: Share of white noise in all of the spread of the position.
    """

    phase: str
    neighbourhood: Neighbourhood
    clustering: Clustering
    two_mode: bool
    identity: tuple[float, Array] | None
    chunks: MeanVersusModes
    noise_ratio: float
    noise_spread: float
    component: str = POSITION
    roughness: float | None = None
    white_share: float = 0.0


@dataclass(frozen=True)
class Claim:
    """What speaks for the modes of one situation.

    Attributes:
        situation: Its position.
        phase: Task phase.
        measured: Whether it goes on long enough to see whether the modes persist.
        persists: Whether they do, beyond their null.
        noise_ratio: As of the situation, in the component of its clusters.
    """

    situation: int
    phase: str
    measured: bool
    persists: bool
    noise_ratio: float


def find_situations(
    data: AuditInput, settings: AuditSettings, root_seed: int, *, progress: Progress = silent
) -> tuple[list[Found], tuple[Support, ...]]:
    """Situations with their clusters, and the support, of every group of `data.grouping`."""
    found: list[Found] = []
    support: list[Support] = []
    for phase in np.unique(data.grouping):
        items, reach = find(data, settings, phase=str(phase), root_seed=root_seed)
        support.append(reach)
        offset = len(found)
        for item in items:
            paths = relative_paths(data, item.members, ROUTE_CHUNKS * settings.chunk_rows)
            found.append((str(phase), item, cluster_chunks(paths, settings)))
            progress(f"situations of {phase} clustered", len(found) - offset, len(items))
    return found, tuple(support)


def claimed(
    data: AuditInput, settings: AuditSettings, found: list[Found], *, component: str = POSITION
) -> set[int]:
    """Which entries of `found` have several modes under one observation.

    A phase in which too few held-out episodes show them is said to have one mode: a handful
    among many situations is what chance gives.
    """
    told: dict[str, list[tuple[int, int, Told]]] = {}
    analysed: dict[str, list[Neighbourhood]] = {}
    for number, (phase, item, split) in enumerate(found):
        analysed.setdefault(phase, []).append(item)
        if split.count > 1:
            seen = resolved_by_observation(data, settings, item, split, route=component == POSITION)
            told.setdefault(phase, []).append((number, int(data.episode[item.query]), seen))
    columns = 2 * int(np.count_nonzero(np.isfinite(data.observation_scale)))
    numbers: dict[str, list[int]] = {}
    for phase, entries in told.items():
        believed = credible([(episode, seen) for _, episode, seen in entries], columns)
        numbers[phase] = [
            number for number, _, seen in entries if not (seen.together or seen.columns & believed)
        ]
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
    component: Component,
    *,
    admissible: Admissible | None,
    seed: int | None,
) -> Situation:
    """Persistence, and mean against modes, of one situation; both only where it has modes.

    Args:
        data: Canonical audit input.
        settings: Lags and chunk length.
        entry: The situation with its clusters.
        component: What was clustered.
        admissible: Feasibility of a chunk, asked where there are modes.
        seed: Seed of the null of persistence; None where the clusters are not claimed as modes.
    """
    phase, item, clustering = entry
    identity, rough = None, None
    if seed is not None:
        name = str(data.episodes.uuid[data.episode[item.query]])
        rng = stream(seed, "audit", "persistence", phase, name, int(data.index[item.query]))
        if component.name == POSITION:
            identity = kept_identity(data, settings, item, clustering, rng=rng)
        else:
            identity = kept_between(data, settings, component, item, rng=rng)
            if component.name != TIMING:
                rough = roughness(series(data, settings, component, item.members))
    check = None if seed is None else admissible
    chunks = compare(data, settings, item, clustering, admissible=check)
    paths = relative_paths(data, item.members, settings.chunk_rows)
    ratio, spread = von_neumann(paths)
    return Situation(
        phase, item, clustering, seed is not None, identity, chunks, ratio, spread,
        component.name, rough, min(1.0, roughness(paths)),
    )  # fmt: skip


def coherent(
    settings: AuditSettings, situations: tuple[Situation, ...]
) -> tuple[tuple[Situation, ...], int]:
    """Take back modes of phases in which they do not persist, or are noise along the chunk.

    Where clusters are strategies, nearly all situations of a phase keep them, and their spread is
    smooth along the chunk; where chance made them of tremor, neither holds. Phases that end too
    soon to tell are kept only if no other phase has modes.

    Args:
        settings: Share of the measured situations that must persist, and how white is too white.
        situations: Every analysed situation.

    Returns:
        The situations, and how many lost their modes.
    """
    good = coherent_phases(settings, claims_of(situations), np.ones(len(situations)))
    kept = tuple(
        replace(item, two_mode=item.two_mode and item.phase in good) for item in situations
    )
    return kept, sum(a.two_mode and not b.two_mode for a, b in zip(situations, kept, strict=True))


def claims_of(situations: tuple[Situation, ...]) -> list[Claim]:
    """What speaks for the modes of each situation that has some, to be weighed again and again."""
    return [
        Claim(
            number,
            item.phase,
            item.identity is not None,
            persistent(item.identity),
            item.noise_ratio if item.roughness is None else item.roughness,
        )
        for number, item in enumerate(situations)
        if item.two_mode
    ]


def coherent_phases(settings: AuditSettings, claims: list[Claim], weights: Array) -> set[str]:
    """Phases whose modes persist and are smooth; situations counted `weights` times. Shape (n,)."""
    measured: dict[str, float] = {}
    persist: dict[str, float] = {}
    ratios: dict[str, list[float]] = {}
    for claim in claims:
        weight = float(weights[claim.situation])
        if weight > 0.0:
            phase, known = claim.phase, weight * claim.measured
            measured[phase] = measured.get(phase, 0.0) + known
            persist[phase] = persist.get(phase, 0.0) + known * claim.persists
            ratios.setdefault(phase, []).append(claim.noise_ratio)
    least, white = settings.minimum_two_mode_situations, settings.white_ratio
    good = {
        phase
        for phase, count in measured.items()
        if count >= least and persist[phase] - settings.minimum_persistent_share * count >= 0
    }
    good = good or {phase for phase, count in measured.items() if count < least}
    return good - {phase for phase, found in ratios.items() if np.median(found) >= white}


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
