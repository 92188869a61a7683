"""The freshness layer: is the chunk meant for this moment? It reads the table of checks."""

import math
from collections.abc import Sequence
from dataclasses import replace

from genpolicy.contract.chunk import ChunkMetadata
from genpolicy.errors import NonFiniteError
from genpolicy.execution.checks import CHECKS, Check, Checks, Place, at
from genpolicy.execution.moment import Chunk, Moment, View
from genpolicy.execution.nanoseconds import NS_PER_S, ChunkTimes, to_ns
from genpolicy.feasibility.context import Context

REASONS = {check.name: check.reason for check in at(CHECKS, Place.LAYER) if check.reason}
"""Why a chunk is discarded that this layer refuses, by the name of the check."""


def fresh(
    chunks: Sequence[ChunkMetadata], contexts: Sequence[Context], *, checks: Checks = CHECKS
) -> list[dict[str, float]]:
    """Session, calibration, phase, weights, sampler, and time, by name of the check.

    A context that several chunks share is read once.

    Args:
        chunks: Metadata of each.
        contexts: The moment of the check, one per chunk.
        checks: The table; its rows of the place `LAYER` are asked.

    Returns:
        Of each chunk a margin each, s: limit minus value for a question of time (infinite where
        nothing limits it yet), otherwise 0 where it holds and -1 where it does not. NaN, which
        passes nothing, where a time is no finite number.
    """
    rows = at(checks, Place.LAYER)
    unknown = {row.name: math.nan for row in rows}
    moments = {key: _moment(c) for key, c in {id(c): c for c in contexts}.items()}
    found = []
    for metadata, context in zip(chunks, contexts, strict=True):
        moment, times = moments[id(context)], _times(metadata)
        if moment is None or times is None:
            found.append(dict(unknown))
            continue
        asked = replace(moment, about=Chunk(metadata, times))
        found.append({row.name: _margin(row, asked) for row in rows})
    return found


def _margin(check: Check, moment: Moment) -> float:
    if check.margin_ns is None:
        return 0.0 if check.holds(moment) else -1.0
    margin_ns = check.margin_ns(moment)
    return math.inf if margin_ns is None else margin_ns / NS_PER_S


def _times(metadata: ChunkMetadata) -> ChunkTimes | None:
    """Times of a chunk; None where one is no number."""
    try:
        return ChunkTimes.of(metadata)
    except NonFiniteError:
        return None


def _moment(context: Context) -> Moment | None:
    """The moment of a context, about no chunk yet; None where one of its times is no number."""
    try:
        return _moment_of(context)
    except NonFiniteError:
        return None


def _moment_of(context: Context) -> Moment:
    newest_s = context.newest_accepted_observation_s
    view = View(
        phase=context.phase,
        calibration_epoch=context.calibration_epoch,
        newest_observation_ns=to_ns(context.latest_observation_event_time_s),
        maximum_age_ns=to_ns(context.maximum_age_s),
        checkpoint=context.active_checkpoint_hash,
        sampler=context.active_sampler_hash,
        session_epoch=context.session_epoch,
    )
    return Moment(
        now_ns=to_ns(context.now_s),
        view=view,
        accepted_condition_ns=None if newest_s is None else to_ns(newest_s),
    )
