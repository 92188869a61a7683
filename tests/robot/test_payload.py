"""The load of a closed hand, read from the scene file that declares what is held."""

import numpy as np
import pytest

from genpolicy.robot.kinematics import ArmKinematics
from genpolicy.robot.payload import payload_of
from genpolicy.tasks.api import load_task


@pytest.fixture
def scene(tmp_path):
    """Writes the default scene with other words."""
    text = load_task("tabletop_insertion").scene_path.read_text()

    def write(*changes):
        made = text
        for old, new in changes:
            assert made.count(old) == 1, old
            made = made.replace(old, new)
        path = tmp_path / "scene.xml"
        path.write_text(made)
        return path

    return write


def test_a_box_in_the_hand(scene):
    path = scene()
    load = payload_of(path, joints=7)
    assert load.mass_kg == 0.05 and load.joint == 6
    # 20 x 20 x 80 mm, hanging along the axis of the last joint: m / 12 (b^2 + c^2).
    np.testing.assert_allclose(load.centre_m, [0.0, 0.0, 0.107 + 0.1184], atol=1e-9)
    across, along = 0.05 / 12 * (0.08**2 + 0.02**2), 0.05 / 12 * 2 * 0.02**2
    np.testing.assert_allclose(load.inertia_kg_m2, np.diag([across, across, along]), atol=1e-9)
    assert ArmKinematics(path).joint_count == 7


def test_its_mass_is_that_of_the_file(scene):
    assert payload_of(scene(('mass="0.05"', 'mass="2.5"')), joints=7).mass_kg == 2.5


def test_without_a_weld_nothing_is_held(scene):
    grasp = '<weld name="grasp" body1="hand" body2="peg" relpose="0 0 0.1184 0 1 0 0" '
    assert payload_of(scene((grasp + 'solref="0.004 1"/>', "")), joints=7) is None
