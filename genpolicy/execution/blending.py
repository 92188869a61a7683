"""Blending two chunks: the result is a new proposal, with its own id and no authority.

Smoothness is not authority: neither parent's admission carries over, so a blend goes through
projection and all six layers again before it can be enqueued.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import ROTATION
from genpolicy.contract.chunk import Projected, Proposal
from genpolicy.contract.rotation import rotation_from_6d, rotation_to_6d
from genpolicy.errors import ContractError
from genpolicy.execution.settings import to_ns

Array = NDArray[np.float64]

SAME_FIELDS = (
    "policy_checkpoint_hash",
    "sampler_config_hash",
    "task_phase",
    "calibration_epoch",
    "session_epoch",
    "method",
)


def blend(
    older: Proposal | Projected, newer: Proposal | Projected, *, chunk_id: str, blend_steps: int
) -> Proposal:
    """The newer chunk, its first actions ramped in from the older one that is being executed.

    Row j of the result is `(1 - w) * older + w * newer` with `w = (j + 1) / (blend_steps + 1)`
    where the older chunk still has an action for that time, the newer one elsewhere. Rotations are
    blended in their six numbers and made orthonormal again.

    Args:
        older: Chunk whose rest the blend continues.
        newer: Chunk on the same grid of times.
        chunk_id: Name of the blend; not that of a parent.
        blend_steps: Rows over which the newer chunk takes over, >= 1.

    Returns:
        A proposal that is as old as its older observation and ends as early as its earlier end.

    Raises:
        ContractError: Parents of different makers, phases or time grids, a parent's id, or
            rotations so far apart that a blend of them is none.
    """
    first, second = older.metadata, newer.metadata
    for name in SAME_FIELDS:
        if getattr(first, name) != getattr(second, name):
            _refuse(f"parents with two values of {name}", "one")
    period_ns = to_ns(first.action_period_s)
    offset_ns = to_ns(second.action_start_time_s) - to_ns(first.action_start_time_s)
    if to_ns(second.action_period_s) != period_ns or offset_ns % period_ns or offset_ns < 0:
        _refuse("parents on different time grids", "one period, starts whole periods apart")
    if chunk_id in (first.chunk_id, second.chunk_id) or blend_steps < 1:
        _refuse(f"id {chunk_id!r}, {blend_steps} steps", "an id of its own and at least one step")
    offset = offset_ns // period_ns
    overlap = max(0, min(blend_steps, len(older.actions) - offset, len(newer.actions)))
    weight = (np.arange(overlap) + 1.0)[:, None] / (blend_steps + 1.0)
    actions = newer.actions.copy()
    mixed = (1 - weight) * older.actions[offset : offset + overlap] + weight * actions[:overlap]
    mixed[:, ROTATION] = rotation_to_6d(rotation_from_6d(mixed[:, ROTATION]))
    if not np.isfinite(mixed).all():
        _refuse("a blend of opposite rotations", "rotations less than half a turn apart")
    actions[:overlap] = mixed
    metadata = replace(
        second,
        chunk_id=chunk_id,
        condition_observation_event_time_s=min(
            first.condition_observation_event_time_s, second.condition_observation_event_time_s
        ),
        valid_until_s=min(first.valid_until_s, second.valid_until_s),
    )
    return Proposal(metadata=metadata, actions=actions, selected_by="blend")


def _refuse(found: str, expected: str) -> None:
    raise ContractError(
        where="a blend of two chunks",
        found=found,
        expected=expected,
        action="Use the newer chunk unblended.",
    )
