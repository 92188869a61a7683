"""Components of an action in which modes are looked for, each with a scale of its own.

The route alone does not say what an action does: one route can be gone with two yaws, with a hand
that closes early or late, or fast and slow. So each component is clustered by itself: a free yaw
must not drown two routes in its spread, and neither must a wide route two yaws.

How far apart two modes must lie is a floor that matters (declared for lengths and angles; a share
of the stroke elsewhere), and never less than what the data themselves scatter: three times the
usual distance of a chunk to its nearest other one inside a situation, over all situations. A
component in which no situation spreads that far hardly varies, and says so.
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from genpolicy.audit.component_rows import OTHER, POSITION
from genpolicy.audit.data import Array, AuditInput, Integers, chunk_rows, relative_paths
from genpolicy.audit.forms import before
from genpolicy.audit.modes import ROUTE_CHUNKS, SMOOTHING_SHARE, distances, features, progress
from genpolicy.audit.settings import AuditSettings
from genpolicy.contract.rotation import rotation_from_6d

ROTATION, GRIPPER, TIMING = "rotation", "gripper", "timing"
NAMES = (POSITION, ROTATION, GRIPPER, OTHER, TIMING)
State = Literal["varies", "hardly_varies", "in_position", "absent", "unreadable"]
# Scales that two modes lie apart at least: as the routes' 3 cm are three times their 1 cm.
APART = 3.0
# Of the whole stroke, on average over a chunk: a gripper that closes a quarter of it later.
STROKE_SHARE = 0.2
# A stroke below this many deviations of white noise is no stroke.
STROKE_NOISE = 8.0
# Situations whose scatter gives the scale.
MEASURED = 150
# Difference of third order and its noise gain, as for the progress along a path.
THIRD, THIRD_POWER = 3, 20.0


@dataclass(frozen=True)
class Component:
    """One component of the action.

    Attributes:
        name: One of `NAMES`.
        state: `varies`; `hardly_varies`: no situation spreads far enough for two modes;
            `in_position`: what is compared as position holds it; `absent`: the action has no such
            numbers; `unreadable`: it has, but they could not be read, so
            nothing is known of their modes.
        unit: Unit of the lengths below; empty for that of the position.
        separation: Modes nearer than this (RMS over a chunk) are one.
        scale: Usual distance of a chunk to its nearest other one in a situation; NaN if unknown.
        spread: Median RMS spread inside situations; NaN if unknown.
        signal: Values whose Euclidean distance is in that unit, row by row; None for the
            position and its timing, which are taken from the path. Shape (N, d).
        begin: Where the values stand before the command of a row; 0 but for what is added up.
            None for 0. Shape (N, d).
    """

    name: str
    state: State
    unit: str
    separation: float
    scale: float = float("nan")
    spread: float = float("nan")
    signal: Array | None = None
    begin: Array | None = None

    @property
    def looked_at(self) -> bool:
        """Whether there is anything to cluster."""
        return self.state == "varies"


def components_of(
    data: AuditInput, settings: AuditSettings, situations: list[Integers]
) -> tuple[Component, ...]:
    """All components, in the order of `NAMES`, with their scales.

    Args:
        data: Canonical audit input.
        settings: Declared scales.
        situations: Rows of the members of each situation.
    """
    floor = settings.minimum_separation_m
    # Compared position by position, the routes hold their timing.
    timing: State = "varies" if settings.representation == "path" else "in_position"
    found = (
        Component(POSITION, "varies", "", floor),
        _rotation(data, settings),
        _stroke(data, GRIPPER, data.action_gripper),
        _stroke(data, OTHER, _leftover(data)),
        Component(TIMING, timing, "", floor),
    )
    return tuple(
        _scaled(data, settings, item, situations) if item.state == "varies" else item
        for item in found
    )


def stricter(settings: AuditSettings) -> AuditSettings:
    """The same for components beside the route: as likely to see modes by chance as one alone."""
    gain = settings.minimum_gain + 2.0 * float(np.log(len(NAMES)))
    return settings.model_copy(update={"minimum_gain": gain})


def vectors(
    data: AuditInput,
    settings: AuditSettings,
    component: Component,
    rows: Integers,
    like: Integers | None = None,
) -> Array:
    """Vectors of the chunks at `rows` whose distance is the RMS distance in this component.

    Args:
        data: Canonical audit input.
        settings: Chunk length and representation.
        component: What is compared.
        rows: Rows of the chunks. Shape (n,).
        like: Rows of the situation against which they are held, whose common length and tremor are
            taken; those of `rows` where None.

    Returns:
        Shape (n, d).
    """
    if component.name == POSITION:
        paths = _routes(data, settings, rows)
        return features(paths, settings, None if like is None else _routes(data, settings, like))
    return joined(component, series(data, settings, component, rows, like))


def series(
    data: AuditInput,
    settings: AuditSettings,
    component: Component,
    rows: Integers,
    like: Integers | None = None,
) -> Array:
    """Values of the component at each step of the chunks: of timing, how far each step goes.

    Returns:
        Shape (n, K, d).
    """
    steps = settings.chunk_rows
    if component.name == POSITION:
        return relative_paths(data, rows, steps)
    if component.name == TIMING:
        paths = _routes(data, settings, rows)
        others = None if like is None else _routes(data, settings, like)
        along = progress(paths, max(1, steps // SMOOTHING_SHARE), others)[:, :steps]
        return np.asarray(np.diff(along, axis=1, prepend=0.0)[..., None] * steps)
    if component.signal is None:
        return np.zeros((len(rows), steps, 0))
    values = component.signal[chunk_rows(data, rows, steps)]
    return values if component.begin is None else values - component.begin[rows][:, None]


def _routes(data: AuditInput, settings: AuditSettings, rows: Integers) -> Array:
    return relative_paths(data, rows, ROUTE_CHUNKS * settings.chunk_rows)


def joined(component: Component, values: Array) -> Array:
    """One vector for each chunk. Shape (n, S * d).

    An event (a grip, a start) is one number when it is added up over time: where it happens.
    """
    n, steps = values.shape[:2]
    if component.name != ROTATION:
        values = np.cumsum(values, axis=1) / steps
    return np.asarray(values.reshape(n, -1) / np.sqrt(steps), dtype=np.float64)


def _rotation(data: AuditInput, settings: AuditSettings) -> Component:
    """Chordal distance of rotations: the angle where it is small, and never torn at half a turn."""
    separation = APART * settings.scale_rad
    if data.action_rotation is None:
        return Component(ROTATION, "absent", "rad", separation)
    matrices = rotation_from_6d(data.action[:, data.action_rotation])
    if not np.all(np.isfinite(matrices)):
        return Component(ROTATION, "unreadable", "rad", separation)
    signal = matrices.reshape(len(matrices), -1) / np.sqrt(2.0)
    return Component(ROTATION, "varies", "rad", separation, signal=signal)


def _leftover(data: AuditInput) -> Integers | None:
    """Columns of the action that no other component holds."""
    columns = np.arange(data.action.shape[1])
    taken = [columns[data.action_position]]
    for part in (data.action_rotation, data.action_gripper):
        if part is not None:
            taken.append(columns[part])
    left = np.setdiff1d(columns, np.concatenate(taken))
    return left if len(left) else None


def _stroke(data: AuditInput, name: str, columns: slice | Integers | None) -> Component:
    """Columns without a common unit, each as a share of its own stroke in the training data."""
    if columns is None:
        return Component(name, "absent", "strokes", STROKE_SHARE)
    chosen = np.arange(data.action.shape[1])[columns]
    values = data.placed[:, chosen]
    training = (data.episodes.split == "train")[data.episode]
    known = values[training] if np.any(training) else values
    low, high = np.quantile(known, [0.01, 0.99], axis=0)
    stroke = high - low
    moving = stroke > STROKE_NOISE * white(data, values)
    if not np.any(moving):
        return Component(name, "hardly_varies", "strokes", STROKE_SHARE)
    signal = values[:, moving] / stroke[moving]
    begin = None
    if data.forms is not None and data.forms.added[chosen[moving]].any():
        stood = before(data, chosen[moving], np.arange(len(values)))
        begin = np.where(data.forms.added[chosen[moving]], stood, 0.0) / stroke[moving]
    return Component(name, "varies", "strokes", STROKE_SHARE, signal=signal, begin=begin)


def white(data: AuditInput, values: Array) -> Array:
    """Deviation of white noise on each column, from third differences. Shape (d,).

    Args:
        data: Canonical audit input, for which rows are of one episode.
        values: Shape (N, d).
    """
    third = np.diff(values, THIRD, axis=0)[data.episode[THIRD:] == data.episode[:-THIRD]]
    if len(third) == 0:
        return np.zeros(values.shape[1])
    # 0.6745: median of the absolute value of a standard normal number.
    noise = np.median(np.abs(third), axis=0) / 0.6745 / np.sqrt(THIRD_POWER)
    return np.asarray(noise, dtype=np.float64)


def _scaled(
    data: AuditInput, settings: AuditSettings, component: Component, situations: list[Integers]
) -> Component:
    """The component with its scale and spread over some situations, evenly drawn."""
    if not situations:
        return component
    places = np.linspace(0, len(situations) - 1, min(len(situations), MEASURED)).astype(int)
    parts = [vectors(data, settings, component, situations[place]) for place in places]
    spread = float(np.median([np.sqrt(part.var(axis=0).sum()) for part in parts]))
    if component.name == POSITION:  # the least distance of routes is declared
        return replace(component, spread=spread)
    scale = float(np.median([_nearest(part) for part in parts]))
    separation = max(component.separation, APART * scale)
    return replace(component, separation=separation, scale=scale, spread=spread)


def _nearest(part: Array) -> float:
    """Median distance of a chunk to its nearest other one."""
    gaps = distances(part)
    np.fill_diagonal(gaps, np.inf)
    return float(np.median(gaps.min(axis=1)))
