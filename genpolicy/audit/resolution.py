"""Does the observation itself tell the clusters of a situation apart? Then they are no modes."""

from collections.abc import Iterator

import numpy as np

from genpolicy.audit.data import Array, AuditInput, Flags, Integers
from genpolicy.audit.modes import Clustering
from genpolicy.audit.neighbourhoods import Neighbourhood
from genpolicy.audit.settings import AuditSettings

AXES = (2, 3)
# Share of a scale by which what is no route must differ to be seen: a declared scale is several
# times the noise of its sensor.
ONSET = 0.25
JITTER = 0.01  # a tenth of a scale, squared: flat clouds stay solvable
# Of the usual step: a course that differs by less (about 15 degrees) is no other course.
COURSE = 0.25


def resolved_by_observation(
    data: AuditInput,
    settings: AuditSettings,
    situation: Neighbourhood,
    clustering: Clustering,
    *,
    route: bool = True,
) -> bool:
    """Whether one observed component, or the place, already tells the clusters apart.

    Then the members do not share one observation, and a deterministic policy can follow both.
    It must order them (nearly) perfectly and differ by at least its own scale. The place (up to
    three components) is also looked at along Fisher's line from one cluster to the other, which
    need not lie along an axis; more components would always have such a line among so few members.
    Routes part little by little, so less than a scale is no sign of them. Where something else
    than the route differs, a hand that has begun to close or turn shows it at once, and a history
    shows how fast the arm goes: there a fraction of a scale is enough. It also shows where all
    that is observed goes: who passes one place on two courses does not choose there.
    """
    least = 1.0 if route else ONSET
    if not route and _told_by_speed(data, settings, situation, clustering):
        return True
    if _told_by_course(data, settings, situation, clustering):
        return True
    place = _place(data)
    for values, inside in _observed(data, settings, situation, clustering):
        if len(place):
            line = _along(values[:, place], inside)
            if _apart(line, inside) >= least and _auc(line, inside) >= settings.resolved_auc:
                return True
        gap = np.abs(np.median(values[inside], axis=0) - np.median(values[~inside], axis=0))
        far = np.flatnonzero(gap >= least)
        if any(_auc(values[:, j], inside) >= settings.resolved_auc for j in far):
            return True
    return False


def _told_by_speed(
    data: AuditInput, settings: AuditSettings, situation: Neighbourhood, clustering: Clustering
) -> bool:
    """Whether the speed over the observed history orders the clusters (nearly) perfectly."""
    if settings.observation_horizon < 2 or data.position.shape[1] == 0:
        return False
    rows = situation.members
    before = np.maximum(rows - settings.observation_horizon + 1, data.first_row[rows])
    speeds = np.linalg.norm(data.position[rows] - data.position[before], axis=1)[:, None]
    return any(
        _auc(speeds[:, 0], clustering.labels == mode) >= settings.resolved_auc
        for mode in range(clustering.count)
    )


def _told_by_course(
    data: AuditInput, settings: AuditSettings, situation: Neighbourhood, clustering: Clustering
) -> bool:
    """Whether the last observed step orders the clusters (nearly) perfectly.

    The members stand within several scales of each other, and a step is a fraction of one: places
    cannot show what their difference shows. A component of the step, or the way across the course
    in the plane or in space, must differ by a quarter of the usual step.
    """
    if settings.observation_horizon < 2:
        return False
    rows = situation.members
    before = np.maximum(rows - 1, data.first_row[rows])
    used = np.flatnonzero(np.isfinite(data.observation_scale))
    steps = data.observation[np.ix_(rows, used)] - data.observation[np.ix_(before, used)]
    steps = steps / data.observation_scale[used]
    least = COURSE * float(np.median(np.linalg.norm(steps, axis=1)))
    if least <= 0.0:
        return False
    place = _place(data)
    for mode in range(clustering.count):
        inside = clustering.labels == mode
        gap = np.abs(np.median(steps[inside], axis=0) - np.median(steps[~inside], axis=0))
        far = np.flatnonzero(gap >= least)
        if any(_auc(steps[:, j], inside) >= settings.resolved_auc for j in far):
            return True
        if len(place):
            line = _across(steps[:, place], inside)
            if _apart(line, inside) >= least and _auc(line, inside) >= settings.resolved_auc:
                return True
    return False


def _across(values: Array, inside: Flags) -> Array:
    """Coordinate along the line between the middles of the others, each left out. Shape (n,).

    Left out of the middles, no member draws the line to itself.
    """
    result = np.empty(len(values))
    for number in range(len(values)):
        rest = np.arange(len(values)) != number
        line = values[rest & inside].mean(axis=0) - values[rest & ~inside].mean(axis=0)
        length = float(np.linalg.norm(line))
        result[number] = float(values[number] @ line) / (length if length > 0.0 else 1.0)
    return result


def _place(data: AuditInput) -> Integers:
    """Columns of the position among those used, where there are two or three of them."""
    used = np.isfinite(data.observation_scale)
    columns = np.arange(len(used))[data.observation_position]
    if len(columns) not in AXES or not used[columns].all():
        return np.zeros(0, dtype=np.int64)
    return np.asarray(np.cumsum(used)[columns] - 1, dtype=np.int64)


def _along(values: Array, inside: Flags) -> Array:
    """Coordinate along Fisher's line from a cluster to the rest, in scales. Shape (n,)."""
    parts = (values[inside], values[~inside])
    within = sum(np.cov(part, rowvar=False) * len(part) for part in parts) / len(values)
    line = np.linalg.solve(
        within + JITTER * np.eye(values.shape[1]), parts[0].mean(axis=0) - parts[1].mean(axis=0)
    )
    length = float(np.linalg.norm(line))
    return np.asarray(values @ (line / length if length > 0.0 else line))


def _apart(values: Array, inside: Flags) -> float:
    return abs(float(np.median(values[inside]) - np.median(values[~inside])))


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
