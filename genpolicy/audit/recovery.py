"""Which mode did each episode follow, and did the disturbed ones succeed?"""

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from genpolicy.audit.components import Component, vectors
from genpolicy.audit.data import AuditInput, Integers, observation_history
from genpolicy.audit.labels import SUCCESS
from genpolicy.audit.modes import Clustering
from genpolicy.audit.neighbourhoods import Neighbourhood
from genpolicy.audit.rows import RecoveryOutcome
from genpolicy.audit.settings import AuditSettings

UNASSIGNED = "unassigned"
# Situations that vote, evenly over all of them: an episode passes many of one held-out episode, and
# they say the same. As many others are asked where none of these is near.
VOTERS = 600


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
    if episode_modes.max(initial=-1) < 0:
        return result
    step = max(1, -(-len(situations) // VOTERS))
    for part in range(step):
        open_ones = np.flatnonzero(result < 0)
        some = situations[part::step]
        votes = _votes(
            data, settings, some, episode_modes, episodes[open_ones], component=component
        )
        voted = votes.any(axis=1)
        result[open_ones[voted]] = np.argmax(votes[voted], axis=1)
    return result


def _votes(
    data: AuditInput,
    settings: AuditSettings,
    situations: list[tuple[Neighbourhood, Clustering]],
    episode_modes: Integers,
    episodes: Integers,
    *,
    component: Component,
) -> Integers:
    """How many situations say that an episode goes as those of a mode. Shape (n, modes)."""
    votes = np.zeros((len(episodes), int(episode_modes.max()) + 1), dtype=np.int64)
    if not situations or not len(episodes):
        return votes
    starts = np.searchsorted(data.episode, np.arange(len(data.episodes) + 1))
    queries = np.array([item[0].query for item in situations], dtype=np.int64)
    places = observation_history(data, queries, settings.observation_horizon)
    near = np.full((len(episodes), len(queries)), -1, dtype=np.int64)
    for number, episode in enumerate(episodes):
        rows = np.arange(starts[episode], starts[episode + 1])
        history = observation_history(data, rows, settings.observation_horizon)
        found = cKDTree(history).query(places, distance_upper_bound=settings.radius)
        inside = np.isfinite(found[0])
        near[number, inside] = rows[np.asarray(found[1])[inside]]
    for number, (situation, _) in enumerate(situations):
        who = np.flatnonzero(near[:, number] >= 0)
        if not len(who):
            continue
        members = situation.members
        known = vectors(data, settings, component, members)
        asked = vectors(data, settings, component, near[who, number], like=members)
        modes = episode_modes[data.episode[members[np.argmin(cdist(asked, known), axis=1)]]]
        votes[who[modes >= 0], modes[modes >= 0]] += 1
    return votes


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
