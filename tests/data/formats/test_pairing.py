"""Which action components bear the name of which observed ones."""

from genpolicy.data.formats.contract import ActionSource, ChannelSource
from genpolicy.data.formats.pairing import pair_by_name


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
