"""A blend is a new proposal: own id, no authority, as old as its older parent."""

from dataclasses import replace

import numpy as np
import pytest

from genpolicy.contract.action import ROTATION, join_action
from genpolicy.contract.chunk import DiscardReason, Proposal, actions_sha256
from genpolicy.contract.rotation import orthonormality_error
from genpolicy.errors import ContractError
from genpolicy.evidence.shadow.rig import Rig
from genpolicy.execution.blending import blend


def straight(x_m, yaw_rad=0.0):
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    rotation = np.tile(np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]]), (16, 1, 1))
    position = np.column_stack([np.full(16, x_m), np.zeros(16), np.full(16, 0.1)])
    return join_action(position, rotation, 0.04)


@pytest.fixture
def parents():
    rig = Rig()
    older = Proposal(rig.chunk().metadata, straight(0.4), "first")
    rig.advance(0.1)
    newer = Proposal(rig.chunk().metadata, straight(0.5, 0.3), "first")
    return older, newer


def test_golden_ramp(parents):
    """Worked by hand: weights 1/4, 2/4, 3/4 of the way from 0.4 m to 0.5 m, then the newer."""
    result = blend(*parents, chunk_id="blend", blend_steps=3)
    assert result.actions[:4, 0] == pytest.approx([0.425, 0.45, 0.475, 0.5], abs=1e-15)
    assert np.array_equal(result.actions[3:], parents[1].actions[3:])
    assert orthonormality_error(result.actions[:, ROTATION]).max() < 1e-12


def test_metadata_is_the_more_cautious_of_both(parents):
    older, newer = parents
    result = blend(older, newer, chunk_id="blend", blend_steps=3)
    assert result.metadata.chunk_id == "blend" and result.selected_by == "blend"
    assert result.metadata.condition_observation_event_time_s == 0.0
    assert result.metadata.valid_until_s == older.metadata.valid_until_s
    assert result.metadata.action_start_time_s == newer.metadata.action_start_time_s
    assert type(result) is Proposal


def test_equal_parents_blend_to_themselves(parents):
    older, newer = parents
    same = replace(newer, actions=older.actions)
    assert blend(older, same, chunk_id="b", blend_steps=5).actions == pytest.approx(
        older.actions, abs=1e-15
    )


def test_the_parents_admission_does_not_carry_over():
    rig = Rig()
    rig.observe()
    first, second = rig.chunk(), rig.chunk()
    mixed = blend(
        Proposal(first.metadata, straight(0.4), "first"),
        Proposal(second.metadata, straight(0.5), "first"),
        chunk_id="blend", blend_steps=3,
    )  # fmt: skip
    forged = replace(second, metadata=mixed.metadata, actions=mixed.actions)
    assert forged.actions_sha256 != actions_sha256(mixed.actions)
    assert rig.deliver(forged) is DiscardReason.INFEASIBLE
    assert rig.deliver(mixed) is DiscardReason.INFEASIBLE


@pytest.mark.parametrize("field, value", [
    ("policy_checkpoint_hash", "0"), ("sampler_config_hash", "0"), ("task_phase", "insert"),
    ("calibration_epoch", "other"), ("session_epoch", 3), ("method", "other"),
    ("action_period_s", 0.1), ("action_start_time_s", 0.113), ("action_start_time_s", -0.05),
])  # fmt: skip
def test_parents_that_do_not_belong_together_are_refused(parents, field, value):
    older, newer = parents
    other = replace(newer, metadata=replace(newer.metadata, **{field: value}))
    with pytest.raises(ContractError, match="blend of two chunks"):
        blend(older, other, chunk_id="b", blend_steps=3)


def test_a_parents_id_no_steps_and_opposite_rotations_are_refused(parents):
    older, newer = parents
    opposite = replace(newer, actions=straight(0.5, np.pi))
    for second, chunk_id, steps in (
        (newer, newer.metadata.chunk_id, 3), (newer, "b", 0), (opposite, "b", 1),
    ):  # fmt: skip
        with pytest.raises(ContractError, match="blend of two chunks"):
            blend(older, second, chunk_id=chunk_id, blend_steps=steps)
