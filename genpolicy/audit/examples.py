"""What a person looks at: example situations, the clock of every episode, where support ends.

These tables decide nothing. They hold what the figures of the audit's page and of gate A show.
"""

import numpy as np

from genpolicy.audit.components import vectors
from genpolicy.audit.data import Array, AuditInput, Integers, origin, relative_paths
from genpolicy.audit.run import AuditResult
from genpolicy.audit.semantics import episode_lags, realigned
from genpolicy.audit.settings import AuditSettings
from genpolicy.audit.shown_rows import Alignment, ExampleChunk, SupportPoint
from genpolicy.audit.situations import Situation

EXAMPLES = 3
UNITS = {"m": "m", "px": "px", "rad": "rad", "deg": "deg", "n": "N"}


def example_chunks(result: AuditResult, settings: AuditSettings) -> list[ExampleChunk]:
    """Chunks of a few situations, chosen evenly over how far apart their chunks lie."""
    rows: list[ExampleChunk] = []
    for number, item in enumerate(_chosen(result, settings)):
        rows += _chunks(result, settings, number, item)
    return rows


def alignment(result: AuditResult, settings: AuditSettings) -> list[Alignment]:
    """Clock of every episode before and after realignment; empty where nothing pairs."""
    data, table = result.data, result.data.episodes
    if not data.paired:
        return []
    lags = episode_lags(data, settings.maximum_lag_rows)
    shifted, moved = realigned(data, result.semantics)
    after = episode_lags(shifted, settings.maximum_lag_rows) if moved else lags
    order = table.order if np.all(np.isfinite(table.order)) else np.arange(len(table), dtype=float)
    before_s, after_s = (_offset_s(values, data.period_s, settings) for values in (lags, after))
    return [
        Alignment(
            episode_uuid=str(table.uuid[number]),
            epoch=str(table.calibration_epoch[number]),
            order=float(order[number]),
            lag_rows=float(lags[number]),
            offset_before_s=float(before_s[number]),
            offset_after_s=float(after_s[number]),
        )
        for number in range(len(table))
    ]


def support_points(result: AuditResult) -> list[SupportPoint]:
    """Every query of the audit, analysed or not, in order of phase and row."""
    data = result.data
    points: dict[tuple[str, int], tuple[bool, bool]] = {}
    for reach in result.support:
        points |= {(reach.phase, row): (False, False) for row in reach.missed}
    for item in result.situations:
        points[item.phase, item.neighbourhood.query] = (True, item.two_mode)
    keys = sorted(points)
    places = origin(data, np.array([row for _, row in keys], dtype=np.int64))
    return [
        SupportPoint(
            phase=phase,
            episode_uuid=str(data.episodes.uuid[data.episode[row]]),
            index=int(data.index[row]),
            analysed=points[phase, row][0],
            two_mode=points[phase, row][1],
            position=tuple(place.tolist()),
        )
        for (phase, row), place in zip(keys, places, strict=True)
    ]


def position_names(data: AuditInput) -> list[str]:
    """Names of the position's components, without their channel where they share one."""
    if not data.paired:
        width = data.commanded.shape[1]
        return [f"action {number}" for number in range(width)]
    names = [str(name) for name in np.asarray(data.observation_names)[data.observation_position]]
    channels = {name.rpartition(".")[0] for name in names}
    return [name.rpartition(".")[2] for name in names] if len(channels) == 1 else names


def position_unit(data: AuditInput) -> str:
    """Unit of the position by the suffix of its names; empty where they do not agree."""
    if not data.paired:
        return ""
    names = np.asarray(data.observation_names)[data.observation_position]
    found = {_unit(str(name)) for name in names}
    return found.pop() if len(found) == 1 else ""


def _unit(name: str) -> str:
    ends = [part.rpartition("_")[2] for part in reversed(name.split("."))]
    return next((UNITS[end] for end in ends if end in UNITS), "")


def _chosen(result: AuditResult, settings: AuditSettings) -> list[Situation]:
    """Situations to show: of several modes where there are any, else any; never the best ones."""
    several = [item for item in result.situations if item.two_mode]
    pool = several or list(result.situations)
    if not pool:
        return []
    phases = [item.phase for item in pool]
    primary = max(sorted(set(phases)), key=phases.count)
    pool = [item for item in pool if item.phase == primary]
    spread = [
        item.clustering.separation if several else _spread(result, settings, item) for item in pool
    ]
    order = np.argsort(spread, kind="stable")
    places = (np.arange(EXAMPLES) + 0.5) / EXAMPLES * len(pool)
    return [pool[int(order[place])] for place in np.unique(places.astype(int))]


def _spread(result: AuditResult, settings: AuditSettings, item: Situation) -> float:
    members = item.neighbourhood.members
    return float(vectors(result.data, settings, result.component, members).var(axis=0).sum())


def _chunks(
    result: AuditResult, settings: AuditSettings, number: int, item: Situation
) -> list[ExampleChunk]:
    data = result.data
    members, query = item.neighbourhood.members, item.neighbourhood.query
    paths = relative_paths(data, members, settings.chunk_rows)
    parts = vectors(data, settings, result.component, members)
    coordinate = _coordinate(parts, item.clustering.labels)
    placed = paths + origin(data, np.array([query], dtype=np.int64))[:, None, :]
    distance = np.append(item.neighbourhood.distance, 0.0)
    return [
        ExampleChunk(
            example=number,
            phase=item.phase,
            two_mode=item.two_mode,
            query_uuid=str(data.episodes.uuid[data.episode[query]]),
            query_index=int(data.index[query]),
            episode_uuid=str(data.episodes.uuid[data.episode[row]]),
            is_query=bool(row == query),
            distance=float(distance[place]),
            cluster=int(item.clustering.labels[place]),
            coordinate=float(coordinate[place]),
            path=tuple(placed[place].ravel().tolist()),
        )
        for place, row in enumerate(members)
    ]


def _coordinate(vectors: Array, labels: Integers) -> Array:
    """Place of each chunk along the axis on which the clusters (else the chunks) differ most."""
    centred = vectors - vectors.mean(axis=0)
    kinds = np.unique(labels)
    if len(kinds) > 1:
        spread = np.stack([centred[labels == kind].mean(axis=0) for kind in kinds])
    else:
        spread = centred
    axis = np.linalg.svd(spread, full_matrices=False)[2][0]
    # The sign of a singular vector is arbitrary: fix it, so that equal data give equal figures.
    axis = axis * np.sign(axis[np.argmax(np.abs(axis))] or 1.0)
    return np.asarray(centred @ axis, dtype=np.float64)


def _offset_s(lags: Array, period_s: float, settings: AuditSettings) -> Array:
    known = lags[np.isfinite(lags)]
    middle = float(np.median(known)) if len(known) else 0.0
    declared = settings.declared_lag_rows
    return np.asarray((lags - (middle if declared is None else declared)) * period_s)
