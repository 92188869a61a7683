"""The cell with half a millimetre of play: an unseen grasp, a noisy camera, a post of any width."""

import copy
from pathlib import Path

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from genpolicy.tasks.tabletop_insertion import scene
from genpolicy.tasks.tabletop_insertion.scene import Variant
from genpolicy.tasks.tabletop_insertion.world import TabletopWorld
from genpolicy.tasks.tight_insertion.start import TightStart

SCENE_PATH = Path(__file__).with_name("scene.xml")
HOLE_HALF_WIDTH_M = 0.0105
CAMERA_NOISE_M = 0.0005
PLAY_SHARE = 0.5 / 4
"""Play here over that of the tabletop: a probe's wider peg takes as much of either."""
GRASP_POSITION, GRASP_QUATERNION = slice(3, 6), slice(6, 10)
"""Where a weld keeps the pose of the held body in that of the hand."""


class TightWorld(TabletopWorld):
    """One simulated cell, at rest at its start; see `TabletopWorld`."""

    start: TightStart
    hole_half_width_m = HOLE_HALF_WIDTH_M
    camera_noise_m = CAMERA_NOISE_M

    def _model(self) -> mujoco.MjModel:
        """A model of its own: where the peg sits in the grasp, and the width of the post."""
        drawn = self._probe.variant
        variant = Variant(
            peg_width_scale=1.0 + PLAY_SHARE * (drawn.peg_width_scale - 1.0),
            peg_mass_scale=drawn.peg_mass_scale,
            friction_scale=drawn.friction_scale,
        )
        model = copy.copy(scene.load_model(variant, SCENE_PATH))
        start, grasp = self.start, int(model.equality("grasp").id)
        weld = model.eq_data[grasp]
        weld[GRASP_POSITION] += [start.grip_x_m, start.grip_y_m, 0.0]
        held = Rotation.from_quat(weld[GRASP_QUATERNION], scalar_first=True)
        lean = Rotation.from_rotvec([start.tilt_x_rad, start.tilt_y_rad, 0.0])
        weld[GRASP_QUATERNION] = (lean * held).as_quat(scalar_first=True)
        post = int(model.geom("post").id)
        model.geom_size[post, 0] = start.post_radius_m
        model.geom_rbound[post] = np.hypot(*model.geom_size[post, :2])
        return model
