"""Channels and actions from a sample of the columns."""

import numpy as np
import pytest

from genpolicy.data.formats.sample import Sample, action_of, channels_of
from genpolicy.data.formats.source import Column, RawEpisode
from genpolicy.data.formats.units import is_wrapped_angle


def sample(values, name="state"):
    episodes = [
        RawEpisode(f"e{i}", "0", {name: part}) for i, part in enumerate(np.array_split(values, 4))
    ]
    lengths = [len(part.columns[name]) for part in episodes]
    return Sample(episodes, np.repeat(np.arange(4), lengths))


def test_an_angle_that_jumps_is_written_as_cosine_and_sine_one_unwrapped_is_noted():
    turning = np.linspace(0, 5 * np.pi, 400)
    wrapped = np.mod(turning, 2 * np.pi)
    assert is_wrapped_angle(wrapped, np.repeat(np.arange(4), 100))
    assert not is_wrapped_angle(turning, np.repeat(np.arange(4), 100))
    # A jump between two episodes is none.
    assert not is_wrapped_angle(np.array([0.1] * 50 + [6.2] * 50), np.repeat([0, 1], 50))
    columns = [Column("state", 2, components=("block_yaw", "wrist_roll"))]
    notes: list[str] = []
    channels = channels_of(columns, sample(np.stack([wrapped, turning], axis=1)), notes)
    assert [(c.transform, c.components, c.unit) for c in channels] == [
        ("cos_sin", ["block_yaw_cos", "block_yaw_sin"], "rad"),
        ("none", ["wrist_roll"], "rad"),
    ]
    assert any("written as cos and sin" in note for note in notes)
    assert any("spans 2.5 turns" in note for note in notes)


def test_scalar_columns_of_one_beginning_and_unit_are_one_channel():
    names = ("tool_x_m", "tool_y_m", "x", "gripper", "block_angle_rad")
    values = np.random.default_rng(0).uniform(0, 1, (80, 5))
    episodes = [RawEpisode("e", "0", {n: values[:, i] for i, n in enumerate(names)})]
    few = Sample(episodes, np.zeros(80, dtype=np.int64))
    channels = channels_of([Column(name, None) for name in names], few, [])
    assert [(c.name, c.components) for c in channels] == [
        ("tool_m", ["x", "y"]), ("state_m", ["x"]), ("gripper", ["gripper"]),
        ("block_rad", ["angle"]),
    ]  # fmt: skip
    told = action_of([Column("tool_x_m", None), Column("x", None)], few, [])
    assert told.components == ["tool_x_m", "x"]


@pytest.mark.parametrize(("faulty", "unit"), [(3, "rad"), (6, "deg")])
def test_a_minority_in_another_unit_does_not_decide_the_unit_of_all(faulty, unit):
    joint = np.random.default_rng(0).uniform(-2.5, 2.5, (10, 40))
    joint[:faulty] *= 180.0 / np.pi
    few = Sample(
        [RawEpisode(f"e{k}", "0", {"joint": part}) for k, part in enumerate(joint)],
        np.repeat(np.arange(10), 40),
    )
    notes: list[str] = []
    assert action_of([Column("joint", None)], few, notes).units == [unit]
    channels_of([Column("joint", None)], few, notes)
    assert not notes


def test_a_joint_that_rests_or_moves_little_in_most_episodes_is_not_outvoted():
    number = np.repeat(np.arange(10), 2)
    few = Sample([], number)
    for small in (0.0, 4.0):
        values = np.where(number < 6, small, 90.0)
        assert few.usual(values).all()
    radians = np.where(number < 6, 1.5, np.degrees(1.5))
    assert few.usual(radians).tolist() == (number < 6).tolist()
    # Those that rest have no unit, and do not make the others large.
    resting = np.where(number < 6, 0.0, np.where(number < 9, 1.5, np.degrees(1.5)))
    assert few.usual(resting).tolist() == (number < 9).tolist()
    # By another factor it is no degree; a half is no minority.
    assert few.usual(np.where(number < 6, 1.5, 1500.0)).all()
    assert few.usual(np.where(number < 5, 1.5, np.degrees(1.5))).all()
    assert Sample([], number[:0]).usual(np.zeros(0)).tolist() == []


def test_an_angle_that_jumps_is_seen_beside_some_in_degrees():
    turning = np.mod(np.linspace(0, 9 * np.pi, 400).reshape(10, 40) + 0.5, 2 * np.pi)
    turning[:3] *= 180.0 / np.pi
    episodes = [RawEpisode(f"e{k}", "0", {"yaw": part}) for k, part in enumerate(turning)]
    few, notes = Sample(episodes, np.repeat(np.arange(10), 40)), []
    assert [c.transform for c in channels_of([Column("yaw", None)], few, notes)] == ["cos_sin"]
    assert not any("spans" in note for note in notes)
