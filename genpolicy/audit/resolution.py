"""Does the observation itself tell the clusters of a situation apart? Then they are no modes."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from genpolicy.audit.data import Array, AuditInput, Flags, Integers
from genpolicy.audit.middle import middle
from genpolicy.audit.modes import Clustering
from genpolicy.audit.neighbourhoods import Neighbourhood
from genpolicy.audit.settings import AuditSettings
from genpolicy.seeds import stream

AXES = (2, 3)
# Share of a scale by which what is no route must differ to be seen: a declared scale is several
# times the noise of its sensor.
ONSET = 0.25
JITTER = 0.01  # a tenth of a scale, squared: flat clouds stay solvable
# Of the usual step: a course that differs by less (about 15 degrees) is no other course.
COURSE = 0.25
# Family-wise chance, over all components, that one which says nothing is believed to tell.
LEVEL = 0.05
# Draws of clusters by which it is known what chance tells.
DRAWS = 4


@dataclass(frozen=True)
class Told:
    """What tells the clusters of one situation apart.

    Attributes:
        together: The place, the course or the speed does.
        columns: Observed components that do: their number, and that of their last step behind all
            of those.
        chance: Those that tell clusters of the same sizes, but drawn; once for each of `DRAWS`.
    """

    together: bool
    columns: frozenset[int]
    chance: tuple[frozenset[int], ...] = ()


def resolved_by_observation(
    data: AuditInput,
    settings: AuditSettings,
    situation: Neighbourhood,
    clustering: Clustering,
    *,
    route: bool = True,
) -> Told:
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
    together = not route and _told_by_speed(data, settings, situation, clustering)
    observed = _observed(data, settings, situation)
    steps = _steps(data, settings, situation.members)
    place, auc = _place(data), settings.resolved_auc
    if len(place):
        masks = _masks(clustering.labels, clustering.count)
        together = together or any(
            _parts(_along(values[:, place], inside), inside, least, auc)
            for values in observed
            for inside in masks
        )
        together = together or _told_by_course(steps, place, masks, auc)
    uuid = str(data.episodes.uuid[data.episode[situation.query]])
    rng = stream(0, "audit", "resolution", uuid, int(data.index[situation.query]))
    drawn = [rng.permutation(clustering.labels) for _ in range(DRAWS)]
    table = _table(observed, steps, least)
    real, *chance = (
        _columns(table, _masks(labels, clustering.count), auc)
        for labels in (clustering.labels, *drawn)
    )
    return Told(together, real, tuple(chance))


def credible(told: Sequence[tuple[int, Told]], columns: int) -> frozenset[int]:
    """Components that tell clusters apart in more episodes than chance gives any of so many.

    Of fifty components that say nothing one orders a few chunks by luck, another one in every
    situation; one that tells does so again and again. What chance gives is what components tell of
    clusters that are drawn: a component's own number, and at least that of the usual one.

    Args:
        told: Episode of the query, and what tells the clusters, of every situation with some.
        columns: How many components were looked at.
    """
    hits = _episodes((episode, item.columns) for episode, item in told)
    drawn: Counter[int] = Counter()
    for number in range(DRAWS):
        once = _episodes((episode, item.chance[number]) for episode, item in told)
        drawn.update({column: len(episodes) for column, episodes in once.items()})
    # One more than was seen: of no number of draws follows that chance gives nothing.
    usual = (sum(drawn.values()) + 1) / columns
    return frozenset(
        column
        for column, episodes in hits.items()
        if float(stats.poisson.sf(len(episodes) - 1, max(usual, drawn[column]) / DRAWS))
        <= LEVEL / columns
    )


def _episodes(told: Iterable[tuple[int, frozenset[int]]]) -> dict[int, set[int]]:
    """Episodes in which each component tells something."""
    found: dict[int, set[int]] = {}
    for episode, columns in told:
        for column in columns:
            found.setdefault(column, set()).add(episode)
    return found


def _table(
    observed: Sequence[Array], steps: tuple[Array, float], least: float
) -> tuple[Array, Array, Integers]:
    """All that is observed beside each other, by how much it must differ, and as which component.

    Returns:
        Values, shape (n, C); least differences, shape (C,); components, their last steps behind all
        of them, shape (C,).
    """
    last, step = steps
    count = last.shape[1]
    onset = COURSE * step if step > 0.0 else np.inf
    return (
        np.concatenate([*observed, last], axis=1),
        np.repeat([*[least] * len(observed), onset], count),
        np.concatenate([np.tile(np.arange(count), len(observed)), count + np.arange(count)]),
    )


def _columns(
    table: tuple[Array, Array, Integers], masks: Sequence[Flags], auc: float
) -> frozenset[int]:
    """Observed components, and behind them their last steps, that tell a cluster from the rest."""
    values, least, component = table
    found: set[int] = set()
    for inside in masks:
        gap = np.abs(middle(values[inside]) - middle(values[~inside]))
        told = (j for j in np.flatnonzero(gap >= least) if _auc(values[:, j], inside) >= auc)
        found.update(int(component[j]) for j in told)
    return frozenset(found)


def _masks(labels: Integers, count: int) -> list[Flags]:
    """Members of each cluster."""
    return [labels == mode for mode in range(count)]


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
    steps: tuple[Array, float], place: Integers, masks: Sequence[Flags], auc: float
) -> bool:
    """Whether the way across the course, in the plane or in space, orders the clusters.

    The members stand within several scales of each other, and a step is a fraction of one: places
    cannot show what their difference shows. It must differ by a quarter of the usual step.
    """
    last, step = steps
    return step > 0.0 and any(
        _parts(_across(last[:, place], inside), inside, COURSE * step, auc) for inside in masks
    )


def courses_part(
    data: AuditInput, settings: AuditSettings, rows: Integers, labels: Integers
) -> bool:
    """Whether rows that stand together go on by their modes, on courses that tell them apart.

    Args:
        data: Canonical audit input.
        settings: How well a course must tell.
        rows: Rows of one situation. Shape (n,).
        labels: Mode of each; one with a single row, or all others but one, has no course. Shape
            (n,).
    """
    place, masks = _place(data), [labels == mode for mode in np.unique(labels)]
    masks = [inside for inside in masks if 1 < np.count_nonzero(inside) < len(rows) - 1]
    return len(place) > 0 and _told_by_course(
        _steps(data, settings, rows), place, masks, settings.resolved_auc
    )


def _steps(data: AuditInput, settings: AuditSettings, rows: Integers) -> tuple[Array, float]:
    """Last observed step of each row, in scales, and the usual length; 0 without a history."""
    used = np.flatnonzero(np.isfinite(data.observation_scale))
    if settings.observation_horizon < 2:
        return np.zeros((len(rows), len(used))), 0.0
    before = np.maximum(rows - 1, data.first_row[rows])
    steps = data.observation[np.ix_(rows, used)] - data.observation[np.ix_(before, used)]
    steps = steps / data.observation_scale[used]
    return steps, float(np.median(np.linalg.norm(steps, axis=1)))


def _across(values: Array, inside: Flags) -> Array:
    """Coordinate along the line between the middles of the others, each left out. Shape (n,).

    Left out of the middles, no member draws the line to itself.
    """
    own = np.stack([inside, ~inside], axis=1)
    sums = own.T.astype(np.float64) @ values
    left = own.sum(axis=0) - own
    means = (sums - own[..., None] * values[:, None]) / left[..., None]
    line = means[:, 0] - means[:, 1]
    length = np.linalg.norm(line, axis=1)
    return np.asarray(np.sum(values * line, axis=1) / np.where(length > 0.0, length, 1.0))


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


def _parts(values: Array, inside: Flags, least: float, auc: float) -> bool:
    """Whether a coordinate differs by so much and orders a cluster and the rest."""
    apart = abs(float(middle(values[inside]) - middle(values[~inside])))
    return apart >= least and _auc(values, inside) >= auc


def observed_gap(
    data: AuditInput,
    settings: AuditSettings,
    situation: Neighbourhood,
    clustering: Clustering,
) -> float:
    """Largest difference of a component's median between a cluster and the rest, in scales."""
    return max(
        float(np.max(np.abs(middle(v[inside]) - middle(v[~inside]))))
        for v in _observed(data, settings, situation)
        for inside in _masks(clustering.labels, clustering.count)
    )


def _observed(data: AuditInput, settings: AuditSettings, situation: Neighbourhood) -> list[Array]:
    """Scaled observations of the members, one table per row of the history."""
    used = np.flatnonzero(np.isfinite(data.observation_scale))
    first = data.first_row[situation.members]
    rows = [np.maximum(situation.members - k, first) for k in range(settings.observation_horizon)]
    return [data.observation[np.ix_(part, used)] / data.observation_scale[used] for part in rows]


def _auc(values: Array, inside: Flags) -> float:
    """Share of pairs that the value orders one way, the better of the two ways."""
    pairs = values[inside][:, None] - values[~inside][None]
    share = float(np.mean((pairs > 0) + 0.5 * (pairs == 0)))
    return max(share, 1.0 - share)
