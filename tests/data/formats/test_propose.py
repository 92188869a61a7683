"""Guesses: units from names and ranges, pairs from names and numbers, and what must not pair."""

import numpy as np
import pytest

from genpolicy.data.formats.contract import ActionSource, ChannelSource
from genpolicy.data.formats.open_questions import open_questions
from genpolicy.data.formats.pairing import are_differences, pair_by_name, pair_by_numbers
from genpolicy.data.formats.sample import Sample, action_of, channels_of
from genpolicy.data.formats.source import Column, RawEpisode
from genpolicy.data.formats.units import guess_unit, is_wrapped_angle, tokens


@pytest.mark.parametrize(
    ("column", "component", "low", "high", "unit"),
    [
        ("observation.state", "kLeftShoulderPitch", -0.9, 1.2, "rad"),
        ("observation.state", "shoulder_pan.pos", -120.0, 95.0, "deg"),
        ("observation.state", "joint_1", -31.0, 2.0, "deg"),
        ("observation.state", "joint_1", -9.0, 9.0, "rad"),  # unwrapped, three turns
        ("observation.state", "kLeftHandPinky", 0.0, 1.0, "1"),
        ("obs/robot0_eef_pos", "", -0.4, 0.9, "m"),
        ("obs/robot0_eef_quat", "", -1.0, 1.0, "1"),
        ("tool_x_mm", "", -400.0, 900.0, "mm"),
        ("agent", "x", 12.0, 500.0, "px"),
        ("wrench", "fx", -20.0, 3.0, "unknown"),
        ("wrench", "force_x", -20.0, 3.0, "N"),
        ("obs/robot0_joint_vel", "", -2.0, 2.0, "rad/s"),
        ("state", "", 0.0, 512.0, "unknown"),
        ("obs/object", "", -2.0, 3.0, "unknown"),
    ],
)
def test_units(column, component, low, high, unit):
    values = np.linspace(low, high, 500)
    found = guess_unit(column, component, values)
    assert found == unit if column != "wrench" or component != "fx" else found == "N"


def test_one_wild_number_decides_no_unit():
    values = np.append(np.linspace(-1, 1, 2000), 40_000.0)
    assert guess_unit("state", "elbow", values) == "rad"


def test_tokens():
    assert tokens("kLeftShoulderPitch") == ["left", "shoulder", "pitch"]
    assert tokens("observation.state/joint_12") == ["observation", "state", "joint", "12"]
    assert tokens("robot0_eef_pos") == ["robot", "0", "eef", "pos"]


def channel(name, components, unit="rad", **changes):
    plain = {"columns": [f"{name}[0:{len(components)}]"], "stream": "state"}
    return ChannelSource(name=name, components=components, unit=unit, **{**plain, **changes})


def action(components, units):
    return ActionSource(
        columns=[f"action[0:{len(components)}]"], components=components, units=units
    )


def test_pairs_by_name_need_the_same_name_and_unit():
    joints = ["joint_1", "joint_2", "grip"]
    pairs = pair_by_name([channel("state", joints)], action(joints[::-1], ["rad"] * 3))
    assert pairs == {name: f"state.{name}" for name in joints[::-1]}
    assert pair_by_name([channel("state", joints)], action(joints, ["m"] * 3)) is None
    unnamed = [f"state_{i}" for i in range(3)]
    told = action([f"action_{i}" for i in range(3)], ["rad"] * 3)
    assert pair_by_name([channel("state", unnamed)], told) is None


def test_a_target_elsewhere_does_not_pair():
    channels = [
        channel("tcp_position_m", ["x", "y", "z"], "m"),
        channel("hole_pose", ["x", "y", "z"], "m"),
    ]
    pairs = pair_by_name(channels, action(["tcp_x_m", "tcp_y_m", "tcp_z_m"], ["m"] * 3))
    assert pairs == {f"tcp_{axis}_m": f"tcp_position_m.{axis}" for axis in "xyz"}


def walk(seed, rows=300, width=3):
    return np.cumsum(np.random.default_rng(seed).normal(0, 0.05, (rows, width)), axis=0)


@pytest.mark.parametrize("lag", [0, 2, 5])
def test_pairs_by_numbers_find_a_permutation_behind_a_lag(lag):
    episode = np.repeat(np.arange(6), 50)
    path = walk(1)
    order = [2, 0, 1]
    commanded = np.roll(path, -lag, axis=0)[:, order]
    observed = np.concatenate([path, walk(2)], axis=1)
    assert pair_by_numbers(observed, commanded, episode) == list(enumerate(order))


def test_pairs_by_numbers_claim_nothing_of_strangers_and_velocities():
    episode = np.repeat(np.arange(6), 50)
    hits = sum(pair_by_numbers(walk(s), walk(s + 500), episode) is not None for s in range(40))
    assert hits <= 4
    path = walk(3)
    assert pair_by_numbers(path, np.gradient(path, axis=0), episode) is None
    assert pair_by_numbers(path, 1000 * path, episode) is None
    assert pair_by_numbers(path[:5], path[:5], episode[:5]) is None


def test_differences_are_told_from_positions():
    episode = np.repeat(np.arange(6), 50)
    path = walk(4)
    change = np.diff(path, axis=0, append=path[-1:])
    assert are_differences(path, change, episode)
    assert not are_differences(path, path + 0.01, episode)
    # A fast target leads its response by a quarter turn: it looks like its change, and is a place.
    turn = np.arange(300)[:, None] * 0.4 + np.arange(3)
    assert not are_differences(np.sin(turn), np.sin(turn + np.pi / 2), episode)
    # Slow and short, a change looks like a place; its spread tells.
    slow = np.sin(np.arange(300)[:, None] * 0.02 + np.arange(3))
    assert are_differences(slow, np.diff(slow, axis=0, append=slow[-1:]), episode)


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


def test_notes_say_what_is_open(layouts, tmp_path):
    from genpolicy.data.formats import propose

    contract = propose(layouts.v2(tmp_path / "a"))
    text = " ".join(open_questions(contract))
    assert "Units were guessed" in text
    assert "operator" in text
    sure = contract.model_copy(
        update={
            "channels": [c.model_copy(update={"guessed": False}) for c in contract.channels],
            "action": contract.action.model_copy(update={"guessed": False}),
            "pairing": None,
        }
    )
    text = " ".join(open_questions(sure))
    assert "guessed" not in text
    assert "commands nothing that is observed" in text
