"""The simulated scene: model, its variants, where hole and post stand, the arm's start pose."""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from genpolicy.errors import ContractError
from genpolicy.tasks.tabletop_insertion.start import InsertionStart

Array = NDArray[np.float64]

SCENE_PATH = Path(__file__).with_name("scene.xml")
TCP_SITE = "tcp"
POST = "post"
ARM_JOINTS = 7
# Where the controller's null space pulls the arm to.
POSTURE_RAD = (0.0, -0.17, 0.0, -2.60, 0.0, 2.45, 0.785398163397448)
ROBOT_GROUP, PEG_GROUP = 1, 2

POST_X_M = 0.50
POST_HEIGHT_M = 0.22
FIXTURE_TOP_M = 0.06
HOLE_HALF_WIDTH_M = 0.014
PEG_HALF_LENGTH_M = 0.04
# Distance from the TCP to the tip of the held peg, along the tool.
TIP_OFFSET_M = 0.055
GRASP_OPENING_M = 0.010
OPEN_OPENING_M = 0.040
# Finger opening beyond which the peg is no longer held.
RELEASE_OPENING_M = 0.018

IK_ITERATIONS = 100
IK_TOLERANCE = 1e-11


@dataclass(frozen=True)
class Variant:
    """Physical differences of a probe from the nominal scene.

    Attributes:
        peg_width_scale: Factor on the peg's width.
        peg_mass_scale: Factor on the peg's mass.
        friction_scale: Factor on the sliding friction of peg and fixture.
    """

    peg_width_scale: float = 1.0
    peg_mass_scale: float = 1.0
    friction_scale: float = 1.0


@lru_cache(maxsize=16)
def load_model(variant: Variant = Variant(), path: Path = SCENE_PATH) -> mujoco.MjModel:
    """The compiled scene; shared by all worlds of the variant, nobody may change it."""
    spec = mujoco.MjSpec.from_file(str(path))
    peg = spec.geom("peg")
    peg.size = [
        0.01 * variant.peg_width_scale, 0.01 * variant.peg_width_scale, PEG_HALF_LENGTH_M,
    ]  # fmt: skip
    peg.mass = peg.mass * variant.peg_mass_scale
    for geom in spec.geoms:
        if geom.name == "peg" or geom.name.startswith("fixture"):
            geom.friction = [0.6 * variant.friction_scale, 0.005, 0.0001]
    return spec.compile()


def tool_rotation(yaw_rad: float) -> Array:
    """Rotation of a tool that points down with the given yaw. Shape (3, 3)."""
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    return np.array([[c, s, 0.0], [s, -c, 0.0], [0.0, 0.0, -1.0]])


def scene_poses(
    *, hole_xy_m: Array, hole_yaw_rad: float, post_y_m: float
) -> dict[str, tuple[Array, Array]]:
    """Position (m) and quaternion (w, x, y, z) of every movable body of the scene, by name."""
    half = 0.5 * hole_yaw_rad
    return {
        POST: (
            np.array([POST_X_M, post_y_m, POST_HEIGHT_M / 2]),
            np.array([1.0, 0.0, 0.0, 0.0]),
        ),
        "fixture": (
            np.array([hole_xy_m[0], hole_xy_m[1], 0.0]),
            np.array([np.cos(half), 0.0, 0.0, np.sin(half)]),
        ),
    }


def place_scene(model: mujoco.MjModel, data: mujoco.MjData, start: InsertionStart) -> None:
    """Put post and fixture where the start says."""
    poses = scene_poses(
        hole_xy_m=np.array([start.hole_x_m, start.hole_y_m]),
        hole_yaw_rad=start.hole_yaw_rad,
        post_y_m=start.post_y_m,
    )
    for name, (position, quaternion) in poses.items():
        mocap = int(model.body(name).mocapid[0])
        data.mocap_pos[mocap] = position
        data.mocap_quat[mocap] = quaternion


def solve_arm(model: mujoco.MjModel, position_m: Array, rotation: Array) -> Array:
    """Joint positions, rad, that put the TCP at a pose, near the controller's posture.

    Damped least squares; the null space moves towards the posture in the first half.

    Raises:
        ContractError: The pose is not reached.
    """
    data = mujoco.MjData(model)
    site = int(model.site(TCP_SITE).id)
    jacobian = np.zeros((6, model.nv))
    arm = jacobian[:, :ARM_JOINTS]
    posture = np.array(POSTURE_RAD)
    q = posture.copy()
    for iteration in range(IK_ITERATIONS):
        data.qpos[:ARM_JOINTS] = q
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        relative = rotation @ data.site_xmat[site].reshape(3, 3).T
        skew = relative - relative.T
        error = np.concatenate(
            [
                position_m - data.site_xpos[site],
                0.5 * np.array([skew[2, 1], skew[0, 2], skew[1, 0]]),
            ]
        )
        refining = iteration >= IK_ITERATIONS // 4
        if refining and np.abs(error).max() < IK_TOLERANCE:
            return q
        mujoco.mj_jacSite(model, data, jacobian[:3], jacobian[3:], site)
        inverse = arm.T @ np.linalg.inv(arm @ arm.T + 1e-10 * np.eye(6))
        q = q + inverse @ error
        if not refining:
            q = q + 0.3 * (np.eye(ARM_JOINTS) - inverse @ arm) @ (posture - q)
    raise ContractError(
        where="the start pose of the TCP",
        found=f"{position_m.tolist()} m, {np.abs(error).max():.1e} away from the best solution",
        expected="a pose that the arm reaches",
        action="Draw starts inside the workspace.",
    )
