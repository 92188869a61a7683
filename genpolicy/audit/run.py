"""The whole audit: from rows to a cause, every number on the way kept as evidence."""

from dataclasses import dataclass

import numpy as np

from genpolicy.audit.data import Array, AuditInput, Integers, canonical, relative_paths
from genpolicy.audit.labels import (
    ModeOutcome,
    Replay,
    Replayed,
    mode_outcomes,
    replay_sample,
)
from genpolicy.audit.mean_versus_modes import Admissible, MeanVersusModes, compare
from genpolicy.audit.modes import Clustering, cluster_chunks, link
from genpolicy.audit.neighbourhoods import Neighbourhood, Support, find
from genpolicy.audit.persistence import Persistence, kept_identity, persistent, summarise
from genpolicy.audit.recovery import RecoveryOutcome, recovery_outcomes
from genpolicy.audit.semantics import Semantics, measure, realigned
from genpolicy.audit.settings import AuditSettings
from genpolicy.audit.strata import Stratum, examine_strata, resolved_by_observation
from genpolicy.audit.verdict import AuditVerdict, Counts, decide
from genpolicy.seeds import stream

Found = tuple[str, Neighbourhood, Clustering]


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


@dataclass(frozen=True)
class AuditResult:
    """All evidence of one audit.

    Attributes:
        data: The input in canonical order.
        semantics: Clocks, calibration, drift.
        support: Queries and analysed situations per phase.
        situations: Every analysed situation, by phase and query row.
        persistence: Identity over time.
        modes: Outcome of each mode of each phase.
        strata: Tests of recorded variables.
        replayed: Labels against replay.
        recovery: The disturbed episodes.
        counts: Numbers for the summary.
        modes_after_realignment: Held-out episodes with two modes on realigned data.
        verdict: The cause.
    """

    data: AuditInput
    semantics: Semantics
    support: tuple[Support, ...]
    situations: tuple[Situation, ...]
    persistence: Persistence
    modes: tuple[ModeOutcome, ...]
    strata: tuple[Stratum, ...]
    replayed: tuple[Replayed, ...]
    recovery: tuple[RecoveryOutcome, ...]
    counts: Counts
    modes_after_realignment: int
    verdict: AuditVerdict


def audit(
    data: AuditInput,
    settings: AuditSettings,
    *,
    admissible: Admissible | None,
    replay: Replay | None,
    root_seed: int,
) -> AuditResult:
    """Audit a dataset.

    Args:
        data: Rows and episodes, in any order.
        settings: What counts as near, as two modes, as red.
        admissible: Feasibility of a chunk, `(actions (K, D_a), observation (D_o,)) -> (bool,
            reason)`; None leaves the columns empty.
        replay: Outcome of a replayed episode, by identifier; None leaves labels unproven.
        root_seed: Seed of all draws.

    Returns:
        The evidence and the cause; the same for every order of episodes.
    """
    data = canonical(data)
    semantics = measure(data, settings)
    found, support = _situations(data, settings, root_seed)
    claimed = _claimed(data, settings, found)
    situations = tuple(
        _examine(data, settings, entry, number in claimed, admissible=admissible, seed=root_seed)
        for number, entry in enumerate(found)
    )
    several = _by_phase(situations)
    persistence = summarise([item.identity for item in situations if item.two_mode])
    replayed = replay_sample(data, settings, replay=replay, root_seed=root_seed)
    modes, links = _modes(data, settings, situations, replayed)
    strata = examine_strata(data, settings, several, root_seed=root_seed)
    counts = _counts(data, settings, situations, support)
    primary = _primary(several)
    return AuditResult(
        data=data,
        semantics=semantics,
        support=support,
        situations=situations,
        persistence=persistence,
        modes=modes,
        strata=strata,
        replayed=replayed,
        recovery=recovery_outcomes(data, settings, several.get(primary, []), links.get(primary)),
        counts=counts,
        modes_after_realignment=_after_realignment(
            data, settings, semantics, counts.two_mode_episodes, root_seed
        ),
        verdict=decide(
            settings,
            semantics=semantics,
            replayed=replayed,
            counts=counts,
            persistence=persistence,
            strata=strata,
            modes=tuple(mode for mode in modes if mode.phase == primary),
        ),
    )


def _after_realignment(
    data: AuditInput, settings: AuditSettings, semantics: Semantics, before: int, root_seed: int
) -> int:
    """Held-out episodes with several modes once every epoch is shifted by its measured offset."""
    shifted, moved = realigned(data, semantics.clocks)
    if not moved:
        return before
    found, _ = _situations(shifted, settings, root_seed)
    kept = _claimed(shifted, settings, found)
    return _episodes(shifted, [found[number][1] for number in kept])


def _situations(
    data: AuditInput, settings: AuditSettings, root_seed: int
) -> tuple[list[Found], tuple[Support, ...]]:
    found, support = [], []
    for phase in np.unique(data.grouping):
        items, reach = find(data, settings, phase=str(phase), root_seed=root_seed)
        support.append(reach)
        for item in items:
            paths = relative_paths(data, item.members, settings.chunk_steps)
            found.append((str(phase), item, cluster_chunks(paths, settings)))
    return found, tuple(support)


def _claimed(data: AuditInput, settings: AuditSettings, found: list[Found]) -> set[int]:
    """Which entries of `found` have several modes under one observation.

    A phase in which too few held-out episodes show them is said to have one mode: a handful
    among many situations is what chance gives.
    """
    numbers: dict[str, list[int]] = {}
    for number, (phase, item, split) in enumerate(found):
        if split.count > 1 and not resolved_by_observation(data, settings, item, split):
            numbers.setdefault(phase, []).append(number)
    return {
        number
        for chosen in numbers.values()
        if _episodes(data, [found[k][1] for k in chosen]) >= settings.minimum_two_mode_situations
        for number in chosen
    }


def _examine(
    data: AuditInput,
    settings: AuditSettings,
    entry: Found,
    two_mode: bool,
    *,
    admissible: Admissible | None,
    seed: int,
) -> Situation:
    phase, item, clustering = entry
    identity = None
    if two_mode:
        name = str(data.episodes.uuid[data.episode[item.query]])
        rng = stream(seed, "audit", "persistence", phase, name, int(data.index[item.query]))
        identity = kept_identity(data, settings, item, clustering, rng=rng)
    check = admissible if two_mode else None
    chunks = compare(data, settings, item, clustering, admissible=check)
    return Situation(phase, item, clustering, two_mode, identity, chunks)


def _by_phase(
    situations: tuple[Situation, ...],
) -> dict[str, list[tuple[Neighbourhood, Clustering]]]:
    result: dict[str, list[tuple[Neighbourhood, Clustering]]] = {}
    for item in situations:
        if item.two_mode:
            result.setdefault(item.phase, []).append((item.neighbourhood, item.clustering))
    return result


def _primary(several: dict[str, list[tuple[Neighbourhood, Clustering]]]) -> str:
    """The phase with most situations of several modes."""
    return max(sorted(several), key=lambda phase: len(several[phase]), default="")


def _modes(
    data: AuditInput,
    settings: AuditSettings,
    situations: tuple[Situation, ...],
    replayed: tuple[Replayed, ...],
) -> tuple[tuple[ModeOutcome, ...], dict[str, Integers]]:
    """Modes followed over situations, and the mode of each episode, per phase."""
    outcomes: list[ModeOutcome] = []
    links: dict[str, Integers] = {}
    for phase, items in sorted(_by_phase(situations).items()):
        memberships = [(data.episode[item.members], split.labels) for item, split in items]
        links[phase] = link(memberships, len(data.episodes), settings.minimum_neighbours // 2)
        chosen = [item for item in situations if item.two_mode and item.phase == phase]
        checks = _checks(data, chosen, links[phase])
        outcomes += mode_outcomes(data, phase, links[phase], replayed, checks)
    return tuple(outcomes), links


def _checks(
    data: AuditInput, situations: list[Situation], modes: Integers
) -> dict[int, tuple[int, int]]:
    """Admissible and checked modal chunks of each mode; a local mode counts for its majority."""
    result: dict[int, tuple[int, int]] = {}
    for item in situations:
        global_modes = modes[data.episode[item.neighbourhood.members]]
        for local, passed in enumerate(item.chunks.mode_admissible):
            members = global_modes[item.clustering.labels == local]
            members = members[members >= 0]
            if len(members):
                mode = int(np.argmax(np.bincount(members)))
                good, checked = result.get(mode, (0, 0))
                result[mode] = (good + int(passed), checked + 1)
    return result


def _counts(
    data: AuditInput,
    settings: AuditSettings,
    situations: tuple[Situation, ...],
    support: tuple[Support, ...],
) -> Counts:
    several = [item for item in situations if item.two_mode]
    ratios, spreads = [], []
    for item in situations:
        paths = relative_paths(data, item.neighbourhood.members, settings.chunk_steps)
        ratio, spread = _noise(paths)
        ratios.append(ratio)
        spreads.append(spread)
    return Counts(
        queries=sum(item.queries for item in support),
        analysed=len(situations),
        analysed_episodes=_episodes(data, [item.neighbourhood for item in situations]),
        two_mode=len(several),
        two_mode_episodes=_episodes(data, [item.neighbourhood for item in several]),
        resolved=sum(item.clustering.count > 1 and not item.two_mode for item in situations),
        persistent=sum(persistent(item.identity) for item in several),
        noise_ratio=float(np.median(ratios)) if ratios else 0.0,
        noise_spread=float(np.median(spreads)) if spreads else 0.0,
    )


def _noise(paths: Array) -> tuple[float, float]:
    """Von Neumann ratio of the residual along the chunk (1 white, 0 smooth), and its RMS."""
    residual = paths - paths.mean(axis=0)
    residual = residual - residual.mean(axis=1, keepdims=True)
    power = float(np.mean(residual**2))
    if power <= 0.0:
        return 0.0, 0.0
    steps = float(np.mean(np.diff(residual, axis=1) ** 2))
    return steps / (2.0 * power), float(np.sqrt(power * paths.shape[2]))


def _episodes(data: AuditInput, items: list[Neighbourhood]) -> int:
    return len({int(data.episode[item.query]) for item in items})
