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
    assert action_of([Column("joint", None)], few, []).units == [unit]


def test_the_usual_episodes_are_those_of_the_usual_size_and_all_where_there_is_none():
    number = np.repeat(np.arange(4), 2)
    few = Sample([], number)
    wild = np.array([1.0, -2.0, 3.0, 1.0, 2.0, 1.0, 900.0, 0.0])
    assert few.usual(wild).tolist() == wild[:6].tolist()
    rests = np.array([0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0, 1.0])
    assert few.usual(rests).tolist() == rests.tolist()
    assert Sample([], number[:0]).usual(wild[:0]).tolist() == []
