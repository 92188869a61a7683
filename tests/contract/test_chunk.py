"""The chunk: what it rests on is complete, its numbers cannot change, its hash follows them."""

import hashlib
from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest

from genpolicy.contract.chunk import (
    ChunkMetadata,
    Projected,
    Proposal,
    actions_sha256,
    frozen_array,
    raw_actions,
)
from genpolicy.errors import ContractError, NonFiniteError

METADATA = ChunkMetadata(
    chunk_id="c1",
    condition_observation_event_time_s=1.0,
    policy_checkpoint_hash="w",
    sampler_config_hash="s",
    action_start_time_s=1.1,
    action_period_s=0.1,
    valid_until_s=2.0,
    task_phase="approach",
    calibration_epoch="k",
    predecessor_chunk_id="",
    session_epoch=0,
    method="flow",
    candidate_index=0,
)
TIMES = ("condition_observation_event_time_s", "action_start_time_s", "action_period_s",
         "valid_until_s")  # fmt: skip


@pytest.mark.parametrize("name", TIMES)
@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf")])
def test_a_time_that_is_no_number_is_refused(name, value):
    with pytest.raises(NonFiniteError, match=f"chunk c1: {name} is .*finite time.*hold"):
        replace(METADATA, **{name: value})


@pytest.mark.parametrize("period_s", [0.0, -0.1])
def test_a_period_that_does_not_advance_is_refused(period_s):
    with pytest.raises(ContractError, match=r"chunk c1: action_period_s is .*, expected > 0"):
        replace(METADATA, action_period_s=period_s)


def test_actions_are_a_copy_that_nobody_changes():
    actions = np.zeros((4, 10))
    proposal = Proposal(metadata=METADATA, actions=actions, selected_by="first")
    actions[:] = 7
    assert not proposal.actions.any()
    with pytest.raises(ValueError, match="read-only"):
        proposal.actions[0, 0] = 1
    with pytest.raises(FrozenInstanceError):
        proposal.selected_by = "mine"


def test_a_projection_keeps_what_was_proposed():
    proposal = Proposal(metadata=METADATA, actions=np.zeros((4, 10)), selected_by="first")
    projected = Projected(
        proposal=proposal, actions=np.ones((4, 10)), position_change_m=1, rotation_change_rad=0
    )
    assert projected.metadata is METADATA
    assert not projected.proposal.actions.any() and projected.actions.all()


def test_the_hash_of_actions_is_that_of_their_bytes():
    """Golden: sha256 of sixteen bytes, 1.0 and 2.0 as little-endian float64."""
    data = bytes.fromhex("000000000000f03f0000000000000040")
    expected = hashlib.sha256(data).hexdigest()
    assert actions_sha256(np.array([1.0, 2.0])) == expected
    assert actions_sha256(np.array([1.0, 2.0], dtype=">f8")) == expected
    assert actions_sha256(np.array([1.0, 9.0, 2.0])[::2]) == expected
    assert actions_sha256(np.array([2.0, 1.0])) != expected
    assert frozen_array(np.array([1, 2])).dtype == np.float64


class Hostile:
    """Not to be had as an array, and not by an error that NumPy would raise."""

    def __array__(self, dtype=None, copy=None):
        raise RuntimeError("no array today")


@pytest.mark.parametrize(
    "answer",
    ["text", b"\x00" * 80, None, [[1.0], [1.0, 2.0]], 3.0, np.ones((4, 10), dtype=complex),
     np.array([[None] * 10]), np.ones((4, 10), dtype=bool), object(),
     Hostile()],
)  # fmt: skip
def test_what_is_no_array_of_numbers_has_no_row_and_raises_nothing(answer):
    assert Proposal(METADATA, answer, "first").actions.shape == (0, 0)


@pytest.mark.parametrize("kind", [np.float32, np.int64, np.uint8])
def test_real_numbers_are_kept_whatever_their_width_and_shape(kind):
    for shape in ((4, 10), (10,), (1, 4, 10), (0, 10)):
        kept = raw_actions(np.ones(shape, dtype=kind))
        assert kept.dtype == np.float64 and kept.shape == shape and not kept.flags.writeable


@pytest.mark.parametrize(
    ("name", "value"),
    [("chunk_id", 3), ("task_phase", None), ("method", b"flow"), ("session_epoch", 1.0),
     ("session_epoch", True), ("session_epoch", np.zeros(2)), ("candidate_index", "0"),
     ("valid_until_s", "2.0"), ("action_start_time_s", None)],
)  # fmt: skip
def test_metadata_of_another_kind_are_refused(name, value):
    with pytest.raises(ContractError, match=r"metadata of chunk .*text for names.*hold"):
        replace(METADATA, **{name: value})
    made = replace(METADATA)
    object.__setattr__(made, name, value)
    assert METADATA.well_typed and not made.well_typed
