"""Does the observation itself tell the clusters of a situation apart? Then they are no modes."""

from collections.abc import Iterator

import numpy as np

from genpolicy.audit.data import Array, AuditInput, Flags
from genpolicy.audit.modes import Clustering
from genpolicy.audit.neighbourhoods import Neighbourhood
from genpolicy.audit.settings import AuditSettings


def resolved_by_observation(
    data: AuditInput,
    settings: AuditSettings,
    situation: Neighbourhood,
    clustering: Clustering,
) -> bool:
    """Whether one observed component already tells the clusters apart.

    Then the members do not share one observation, and a deterministic policy can follow both.
    It must order them (nearly) perfectly and differ by at least its own scale.
    """
    for values, inside in _observed(data, settings, situation, clustering):
        gap = np.abs(np.median(values[inside], axis=0) - np.median(values[~inside], axis=0))
        far = np.flatnonzero(gap >= 1.0)
        if any(_auc(values[:, j], inside) >= settings.resolved_auc for j in far):
            return True
    return False


def observed_gap(
    data: AuditInput,
    settings: AuditSettings,
    situation: Neighbourhood,
    clustering: Clustering,
) -> float:
    """Largest difference of a component's median between a cluster and the rest, in scales."""
    return max(
        float(np.max(np.abs(np.median(v[inside], axis=0) - np.median(v[~inside], axis=0))))
        for v, inside in _observed(data, settings, situation, clustering)
    )


def _observed(
    data: AuditInput,
    settings: AuditSettings,
    situation: Neighbourhood,
    clustering: Clustering,
) -> Iterator[tuple[Array, Flags]]:
    """Scaled observations of the members, per row of the history, and each cluster against all."""
    used = np.flatnonzero(np.isfinite(data.observation_scale))
    first = data.first_row[situation.members]
    for back in range(settings.observation_horizon):
        rows = np.maximum(situation.members - back, first)
        values = data.observation[np.ix_(rows, used)] / data.observation_scale[used]
        for mode in range(clustering.count):
            yield values, clustering.labels == mode


def _auc(values: Array, inside: Flags) -> float:
    """Share of pairs that the value orders one way, the better of the two ways."""
    pairs = values[inside][:, None] - values[~inside][None]
    share = float(np.mean((pairs > 0) + 0.5 * (pairs == 0)))
    return max(share, 1.0 - share)
