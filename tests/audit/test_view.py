"""The audit's view of a dataset: columns, scales, and what the action commands of them."""

import numpy as np
import pytest

from genpolicy.audit.data import relative_paths
from genpolicy.audit.settings import AuditSettings
from genpolicy.audit.view import from_dataset
from genpolicy.data.contract import TCP_ACTION
from genpolicy.errors import ContractError


def small_dataset():
    import pandas as pd

    from genpolicy.data.dataset import Dataset
    from genpolicy.data.frames import Frames

    times = np.array([0.0, 0.05, 0.1, 9.0, 9.05])
    frames = Frames(
        episode=np.array([0, 0, 0, 1, 1]), index=np.array([0, 1, 2, 0, 1]), event_time_s=times,
        observation=np.arange(25.0).reshape(5, 5), action=np.arange(50.0).reshape(5, 10),
        phase=np.array(["approach"] * 5), stream_event_time_s={"robot": times, "other": times},
        stream_receive_time_s={"robot": times + 0.01, "other": times},
    )  # fmt: skip
    episodes = pd.DataFrame({
        "episode_uuid": ["b", "a"], "split": ["train", "test"], "operator": ["not_recorded", "x"],
        "object": ["peg", None], "calibration_epoch": ["e", "e"], "outcome": ["success", "failure"],
        "is_recovery": [None, True], "recorded_at_s": [5.0, 9.0],
    })  # fmt: skip
    action = {"components": list(TCP_ACTION.components), "units": list(TCP_ACTION.units)}
    return Dataset(frames, episodes, {"action_contract": action}, "", None)


def contract():
    from genpolicy.contract.observation import Channel, ObservationContract

    return ObservationContract((
        Channel("tcp_position_m", ("x", "y", "z"), "m", "robot", 0.1),
        Channel("hole_pose", ("x_m", "cos_yaw"), "1", "robot", 0.1),
    ))  # fmt: skip


def test_a_dataset_becomes_audit_input():
    settings = AuditSettings(ignored_channels=[])
    data = from_dataset(small_dataset(), contract=contract(), settings=settings, period_s=0.05)
    assert data.episodes.uuid.tolist() == ["a", "b"]
    assert data.index.tolist() == [0, 1, 0, 1, 2]
    assert data.observation[2].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert data.observation_scale.tolist() == [0.01, 0.01, 0.01, 0.01, 0.1]
    assert data.episodes.operator.tolist() == ["x", ""]
    assert data.episodes.is_recovery.tolist() == [True, False]
    assert data.episodes.order.tolist() == [1.0, 0.0]
    assert list(data.delay_s) == ["robot"] and data.delay_s["robot"] == pytest.approx(0.01)
    stamps = small_dataset().frames.stream_event_time_s["robot"]
    assert list(data.stream_time_s) == ["robot"]
    assert sorted(data.stream_time_s["robot"]) == sorted(stamps)
    with pytest.raises(ContractError, match="naming the channel force"):
        from_dataset(
            small_dataset(), contract=contract(), period_s=0.05,
            settings=AuditSettings(context_channels=["force"]),
        )  # fmt: skip


def view(**settings):
    chosen = AuditSettings(ignored_channels=[], **settings)
    return from_dataset(small_dataset(), contract=contract(), settings=chosen, period_s=0.05)


def test_a_whole_pose_has_its_rotation_and_costs_no_copy():
    data = view()
    assert (data.observation_position, data.action_position) == (slice(0, 3), slice(0, 3))
    assert data.action_rotation == slice(3, 9)
    assert data.paired


def test_components_pair_by_name_in_any_order():
    data = view(
        position_components=["tcp_position_m.y", "tcp_position_m.x"],
        action_components=["tcp_y_m", "gripper_opening_m"],
    )
    assert data.position[2].tolist() == [1.0, 0.0]
    assert data.commanded[2].tolist() == [1.0, 9.0]
    assert data.action_rotation is None
    paths = relative_paths(data, np.array([2]), 2)
    assert paths[0, 0].tolist() == [0.0, 9.0]


def test_what_pairs_with_nothing_begins_at_its_own_first_action():
    data = view(position_channel=None, reference_channel=None, context_channels=[])
    assert not data.paired
    assert data.position.shape == (5, 0)
    assert relative_paths(data, np.array([2]), 2)[0, 0].tolist() == [0.0] * 10
    assert relative_paths(data, np.array([2]), 2)[0, 1].tolist() == [10.0] * 10


@pytest.mark.parametrize(
    ("settings", "text"),
    [
        ({"position_components": ["tcp_position_m.w"]}, "naming the component tcp_position_m.w"),
        ({"action_components": ["tcp_x_m"]}, "pairing 3 observed with 1 commanded"),
        ({"channel_scale": {"force": 1.0}}, "naming the channel force"),
    ],
)
def test_names_that_do_not_exist_are_refused(settings, text):
    with pytest.raises(ContractError, match=text):
        view(**settings)


def test_a_scale_can_be_set_by_channel():
    assert (
        view(channel_scale={"hole_pose": 0.3}).observation_scale.tolist() == [0.01] * 3 + [0.3] * 2
    )
