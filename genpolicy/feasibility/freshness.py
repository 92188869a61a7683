"""The freshness layer: is the chunk meant for this moment? It reads the table of checks."""

import math

from genpolicy.contract.chunk import ChunkMetadata
from genpolicy.errors import NonFiniteError
from genpolicy.execution.checks import CHECKS, Check, Checks, Place, at
from genpolicy.execution.moment import Chunk, Moment, View
from genpolicy.execution.nanoseconds import NS_PER_S, ChunkTimes, to_ns
from genpolicy.feasibility.context import Context

REASONS = {check.name: check.reason for check in at(CHECKS, Place.LAYER) if check.reason}
"""Why a chunk is discarded that this layer refuses, by the name of the check."""


def fresh(
    metadata: ChunkMetadata, context: Context, *, checks: Checks = CHECKS
) -> dict[str, float]:
    """Session, calibration, phase, weights, sampler, and time, by name of the check.

    Args:
        metadata: Of the chunk.
        context: The moment of the check.
        checks: The table; its rows of the place `LAYER` are asked.

    Returns:
        A margin each, s: limit minus value for a question of time (infinite where nothing limits
        it yet), otherwise 0 where it holds and -1 where it does not. NaN, which passes nothing,
        where a time is no finite number.
    """
    rows = at(checks, Place.LAYER)
    try:
        moment = _moment(metadata, context)
    except NonFiniteError:
        return {row.name: math.nan for row in rows}
    return {row.name: _margin(row, moment) for row in rows}


def _margin(check: Check, moment: Moment) -> float:
    if check.margin_ns is None:
        return 0.0 if check.holds(moment) else -1.0
    margin_ns = check.margin_ns(moment)
    return math.inf if margin_ns is None else margin_ns / NS_PER_S


def _moment(metadata: ChunkMetadata, context: Context) -> Moment:
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
        about=Chunk(metadata, ChunkTimes.of(metadata)),
        accepted_condition_ns=None if newest_s is None else to_ns(newest_s),
    )
