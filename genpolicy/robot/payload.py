"""What the hand holds, as a load on the arm: mass and inertia of the body that the scene welds.

The task declares it where it declares the object: in its scene file. A hand without a weld holds
nothing that is known.
"""

from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from genpolicy.robot.shapes import held_placement, links_of, matrix

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Payload:
    """A load that moves with one joint of the arm.

    Attributes:
        joint: Number of the joint whose frame carries it, from 0.
        mass_kg: Its mass, > 0.
        centre_m: Its centre of mass in that frame. Shape (3,).
        inertia_kg_m2: Its inertia about that centre, in axes of that frame. Shape (3, 3).
    """

    joint: int
    mass_kg: float
    centre_m: Array
    inertia_kg_m2: Array


def payload_of(scene_path: Path, *, joints: int) -> Payload | None:
    """The load of a closed hand; None where the scene welds nothing to it, or nothing with mass.

    Args:
        scene_path: The MJCF; the arm's joints come first in it.
        joints: Joints of the arm.
    """
    model = mujoco.MjModel.from_xml_path(str(scene_path))
    data = mujoco.MjData(model)
    data.qpos[:] = 0.0
    mujoco.mj_kinematics(model, data)
    held = held_placement(model, data, links_of(model, joints))
    if held is None:
        return None
    body, joint, rotation, position = held
    mass_kg = float(model.body_mass[body])
    if not mass_kg > 0:
        return None
    axes = rotation @ matrix(model.body_iquat[body])
    inertia = axes @ np.diag(model.body_inertia[body]) @ axes.T
    centre = position + rotation @ np.array(model.body_ipos[body])
    return Payload(joint, mass_kg, centre, inertia)
