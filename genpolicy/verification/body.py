"""The robot's own body, as MuJoCo has it: torques of a motion, and parts that may not meet."""

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ROBOT, HELD = 1, 2  # geom groups of a scene file
OWN_BIT = 4  # contact bit that scene files leave free: bodies of the robot among themselves
APART_JOINTS = 3  # nearer along the chain, housings overlap in a file of primitives by design


class OwnBody:
    """What the scene file's contact bits leave out: the robot against itself.

    Args:
        model: MuJoCo's model; its contact bits are widened so that robot and held object collide
            with the robot too.
        joints: Joints of the arm, the first ones of the file.
        weld: Number of the weld that holds the object in the hand; None without one.
    """

    def __init__(self, model: Any, joints: int, weld: int | None) -> None:
        groups = model.geom_group
        colliding = (model.geom_contype | model.geom_conaffinity) != 0
        own = np.flatnonzero(colliding & ((groups == ROBOT) | (groups == HELD)))
        bodies = np.unique(model.geom_bodyid[own])
        for bits in (model.geom_contype, model.geom_conaffinity):
            bits[own] |= OWN_BIT
        for bits in (model.body_contype, model.body_conaffinity):
            bits[bodies] |= OWN_BIT
        depth = np.array([_depth(model, body, joints) for body in range(model.nbody)])
        if weld is not None:
            depth[int(model.eq_obj2id[weld])] = depth[int(model.eq_obj1id[weld])]
        self._depth = depth[model.geom_bodyid]

    def may_meet(self, first: int, second: int) -> bool:
        """Two geoms of robot or held object are so near along the chain that nothing is proved."""
        return bool(abs(self._depth[first] - self._depth[second]) < APART_JOINTS)


class Driven:
    """Torques that a motion of the arm needs, by MuJoCo's inverse dynamics, nothing touching.

    Args:
        scene_path: MJCF of robot and scene.
        joints: Joints of the arm, the first ones of the file.
        held: The object that a weld holds in the hand is a part of the hand.
    """

    def __init__(self, scene_path: Path, joints: int, *, held: bool = False) -> None:
        self._model: Any = _grown(scene_path) if held else _plain(scene_path)
        off = mujoco.mjtDisableBit.mjDSBL_CONSTRAINT, mujoco.mjtDisableBit.mjDSBL_CONTACT
        self._model.opt.disableflags |= int(off[0]) | int(off[1])
        self._data: Any = mujoco.MjData(self._model)
        self._joints = joints

    def torque_nm(self, q_rad: Array, dq_rad_s: Array, ddq_rad_s2: Array) -> Array:
        """Torques of the joints, N m. Shapes (J,)."""
        data, joints = self._data, self._joints
        data.qpos[:joints], data.qvel[:joints], data.qacc[:joints] = q_rad, dq_rad_s, ddq_rad_s2
        mujoco.mj_inverse(self._model, data)
        return np.array(data.qfrc_inverse[:joints])


def _plain(scene_path: Path) -> Any:
    return mujoco.MjModel.from_xml_path(str(scene_path))


def _grown(scene_path: Path) -> Any:
    """The scene with a twin of the welded object grown to the hand; as it is without a weld."""
    model, spec = _plain(scene_path), mujoco.MjSpec.from_file(str(scene_path))
    weld = next((i for i in range(model.neq) if model.eq_type[i] == mujoco.mjtEq.mjEQ_WELD), None)
    if weld is None:
        return model
    hand, body = int(model.eq_obj1id[weld]), int(model.eq_obj2id[weld])
    values = model.eq_data[weld]  # anchor on the object, position and turn in the hand
    anchor = np.zeros(3)
    mujoco.mju_rotVecQuat(anchor, values[:3], values[6:10])
    spec.body(model.body(hand).name).add_body(
        pos=values[3:6] - anchor, quat=values[6:10], mass=float(model.body_mass[body]),
        ipos=model.body_ipos[body], iquat=model.body_iquat[body],
        inertia=model.body_inertia[body], explicitinertial=True,
    )  # fmt: skip
    return spec.compile()


def _depth(model: Any, body: int, joints: int) -> int:
    """Joints of the arm between the base and a body."""
    count = 0
    while body > 0:
        first = int(model.body_jntadr[body])
        count += sum(0 <= j < joints for j in range(first, first + int(model.body_jntnum[body])))
        body = int(model.body_parentid[body])
    return count
