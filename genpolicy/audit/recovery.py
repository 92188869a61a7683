"""Which mode did each episode follow, and did the disturbed ones succeed?"""

import numpy as np
from scipy.spatial import cKDTree

from genpolicy.audit.components import Component, vectors
from genpolicy.audit.data import AuditInput, Integers, observation_history
from genpolicy.audit.labels import SUCCESS
from genpolicy.audit.modes import Clustering
from genpolicy.audit.neighbourhoods import Neighbourhood
from genpolicy.audit.rows import RecoveryOutcome
from genpolicy.audit.settings import AuditSettings

UNASSIGNED = "unassigned"


def assign(
    data: AuditInput,
    settings: AuditSettings,
    situations: list[tuple[Neighbourhood, Clustering]],
    episode_modes: Integers,
    episodes: Integers,
    *,
    component: Component,
) -> Integers:
    """Mode of episodes that were in no situation, by their nearest chunks.

    Args:
        data: Canonical audit input.
        settings: Radius, representation.
        situations: Situations with several modes.
        episode_modes: Mode of each episode, -1 for none. Shape (E,).
        episodes: Which episodes to assign. Shape (n,).
        component: Component of the action whose modes they are.

    Returns:
        Mode of each, by majority over its situations; -1 where none is near. Shape (n,).
    """
    result = np.full(len(episodes), -1, dtype=np.int64)
    if not situations:
        return result
    starts = np.searchsorted(data.episode, np.arange(len(data.episodes) + 1))
    queries = np.array([item[0].query for item in situations], dtype=np.int64)
    places = observation_history(data, queries, settings.observation_horizon)
    for number, episode in enumerate(episodes):
        rows = np.arange(starts[episode], starts[episode + 1])
        votes = np.zeros(int(episode_modes.max(initial=-1)) + 2, dtype=np.int64)
        history = observation_history(data, rows, settings.observation_horizon)
        found = cKDTree(history).query(places, distance_upper_bound=settings.radius)
        gaps, near = np.asarray(found[0]), np.asarray(found[1])
        for place in np.flatnonzero(np.isfinite(gaps)):
            situation, _ = situations[int(place)]
            chunks = np.append(situation.members, rows[near[place]])
            near_by = vectors(data, settings, component, chunks)
            nearest = int(np.argmin(np.linalg.norm(near_by[:-1] - near_by[-1], axis=1)))
            votes[episode_modes[data.episode[situation.members[nearest]]]] += 1
        if votes[:-1].any():
            result[number] = int(np.argmax(votes[:-1]))
    return result


def demonstrated(
    data: AuditInput,
    settings: AuditSettings,
    situations: list[tuple[Neighbourhood, Clustering]],
    episode_modes: Integers | None,
    *,
    component: Component,
) -> Integers:
    """The mode that every episode followed, as it was clustered, else by its nearest chunks.

    Args:
        data: Canonical audit input.
        settings: Radius, representation.
        situations: Situations with several modes, of one phase.
        episode_modes: Mode of each episode in that phase, -1 for none. Shape (E,).
        component: Component of the action whose modes they are.

    Returns:
        -1 where no situation is near. Shape (E,).
    """
    if episode_modes is None:
        return np.full(len(data.episodes), -1, dtype=np.int64)
    result = episode_modes.copy()
    open_ones = np.flatnonzero(result < 0)
    result[open_ones] = assign(
        data, settings, situations, episode_modes, open_ones, component=component
    )
    return result


def recovery_outcomes(
    data: AuditInput,
    settings: AuditSettings,
    situations: list[tuple[Neighbourhood, Clustering]],
    episode_modes: Integers | None,
    *,
    component: Component,
) -> tuple[RecoveryOutcome, ...]:
    """Disturbed episodes per split and mode; episodes near no situation are `unassigned`."""
    disturbed = np.flatnonzero(data.episodes.is_recovery)
    if episode_modes is None:
        episode_modes = np.full(len(data.episodes), -1, dtype=np.int64)
    modes = assign(data, settings, situations, episode_modes, disturbed, component=component)
    rows = []
    for split in np.unique(data.episodes.split[disturbed]):
        for mode in np.unique(modes):
            member = disturbed[(modes == mode) & (data.episodes.split[disturbed] == split)]
            if len(member):
                rows.append(
                    RecoveryOutcome(
                        split=str(split),
                        mode=f"m{mode}" if mode >= 0 else UNASSIGNED,
                        episodes=len(member),
                        successes=int(np.sum(data.episodes.outcome[member] == SUCCESS)),
                    )
                )
    return tuple(rows)
