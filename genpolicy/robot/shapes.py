"""Collision shapes of the scene file: robot links, what the hand holds, and the surroundings.

The MuJoCo model's geoms are the only source. Each shape knows the frame it is fixed to, so that
placements follow from the kinematics alone; covering spheres and FCL geometries are made of it.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import fcl
import mujoco
import numpy as np
from numpy.typing import NDArray

from genpolicy.errors import ConfigError
from genpolicy.robot.kinematics import TCP_SITE

Array = NDArray[np.float64]
Kind = Literal["box", "cylinder", "capsule", "sphere"]

ROBOT_GROUP, HELD_GROUP = 1, 2
BASE_FRAME = -1
HELD = "held"
TARGET_SITE = "target"  # MJCF convention: where the body opens that the held object goes into
_KINDS: dict[int, Kind] = {
    int(mujoco.mjtGeom.mjGEOM_BOX): "box",
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): "cylinder",
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): "capsule",
    int(mujoco.mjtGeom.mjGEOM_SPHERE): "sphere",
}
SPHERE_SPACING = 1.0  # spheres along a shape, in units of its radius across


@dataclass(frozen=True)
class Shape:
    """One collision shape.

    Attributes:
        name: Name of the geom, or `held`.
        body: Name of the body that it belongs to, or `held`.
        kind: Which primitive.
        half_size_m: Half edges of a box; radius, radius, half length of a cylinder (flat ends)
            or capsule (without its caps); radius three times of a sphere. Shape (3,).
        frame: Joint frame, from 0, that carries it; `BASE_FRAME` for what stands in the base
            frame or on a movable scene body.
        rotation: In that frame (scene: in its body). Shape (3, 3).
        position_m: In that frame (scene: in its body), fingers closed. Shape (3,).
        slide: Direction in which the gripper's opening moves it, zero otherwise. Shape (3,).
        tool: Hangs behind the arm's last link: hand, finger, held object.
    """

    name: str
    body: str
    kind: Kind
    half_size_m: Array
    frame: int
    rotation: Array
    position_m: Array
    slide: Array
    tool: bool = False


@dataclass(frozen=True)
class SceneShapes:
    """All shapes of a scene file.

    Attributes:
        robot: Links, hand and fingers, then the held object where the scene has one.
        scene: Everything else that collides.
        nominal_bodies: Position (3,), m, and yaw, rad, of the scene's bodies in the file.
        held_reach_m: How far the held object reaches below the TCP, m.
        held_half_width_m: Smallest opening of each finger around the held object, m.
        target_body: Body with the site `target`, which the held object may touch in contact
            phases; empty without one.
        target_offset_m: Where the site lies on that body, m. Shape (3,).
    """

    robot: tuple[Shape, ...]
    scene: tuple[Shape, ...]
    nominal_bodies: dict[str, tuple[Array, float]]
    held_reach_m: float
    held_half_width_m: float
    target_body: str
    target_offset_m: Array


def shapes_of(scene_path: Path, *, joints: int, tcp_site: str = TCP_SITE) -> SceneShapes:
    """Read the shapes of an MJCF.

    Args:
        scene_path: The MJCF; the arm's joints come first in it.
        joints: Joints of the arm, from its kinematics.
        tcp_site: Site of the TCP.

    Raises:
        ConfigError: A colliding geom is of a kind without an exact collision test here.
    """
    model = mujoco.MjModel.from_xml_path(str(scene_path))
    data = mujoco.MjData(model)
    data.qpos[:] = 0.0
    mujoco.mj_kinematics(model, data)
    links = links_of(model, joints)
    held = held_placement(model, data, links)
    robot, scene, held_shapes = [], [], []
    for geom in range(model.ngeom):
        if not (model.geom_contype[geom] or model.geom_conaffinity[geom]):
            continue
        group = int(model.geom_group[geom])
        if group == HELD_GROUP:
            if held is not None:
                held_shapes.append(_held_shape(model, geom, held))
        elif group == ROBOT_GROUP:
            robot.append(_robot_shape(model, data, geom, links))
        else:
            scene.append(_scene_shape(model, geom))
    target_body, target_offset = _target(model)
    length, width = _held_size(model, data, links, held_shapes, tcp_site)
    return SceneShapes(
        robot=tuple(robot + held_shapes),
        scene=tuple(scene),
        nominal_bodies=_nominal_bodies(model, scene),
        held_reach_m=length,
        held_half_width_m=width,
        target_body=target_body,
        target_offset_m=target_offset,
    )


def links_of(model: Any, joints: int) -> list[int]:
    """Bodies that the arm's joints carry."""
    return [int(model.jnt_bodyid[joint]) for joint in range(joints)]


def fcl_geometry(shape: Shape, *, inflation_m: float) -> Any:
    """FCL geometry that contains every point within `inflation_m` of the shape."""
    x, y, z = (float(v) for v in shape.half_size_m)
    d = float(inflation_m)
    if shape.kind == "box":
        return fcl.Box(2 * (x + d), 2 * (y + d), 2 * (z + d))
    if shape.kind == "cylinder":
        return fcl.Cylinder(x + d, 2 * (z + d))
    if shape.kind == "capsule":
        return fcl.Capsule(x + d, 2 * z)
    return fcl.Sphere(x + d)


def bounding_spheres(shape: Shape) -> tuple[Array, float]:
    """Spheres that cover a shape.

    Returns:
        Centres in the shape's own axes, m, shape (S, 3), and their common radius, m.
    """
    half = shape.half_size_m
    if shape.kind == "sphere":
        return np.zeros((1, 3)), float(half[0])
    axis = int(np.argmax(half)) if shape.kind == "box" else 2
    across = float(np.linalg.norm(np.delete(half, axis))) if shape.kind == "box" else float(half[0])
    count = max(1, int(np.ceil(half[axis] / (SPHERE_SPACING * across))))
    spacing = 2 * half[axis] / count
    centres = np.zeros((count, 3))
    centres[:, axis] = -half[axis] + spacing * (np.arange(count) + 0.5)
    # Each sphere covers its slice; the caps of a capsule lie in the spheres at the slice ends.
    radius = float(np.hypot(across, spacing / 2))
    if shape.kind == "capsule":
        radius = across + spacing / 2
    return centres, radius


def matrix(quaternion: Array) -> Array:
    """Rotation (3, 3) of a quaternion w, x, y, z."""
    flat = np.zeros(9)
    mujoco.mju_quat2Mat(flat, np.asarray(quaternion, dtype=float))
    return flat.reshape(3, 3)


def _half_size(model: Any, geom: int) -> tuple[Kind, Array]:
    kind = _KINDS.get(int(model.geom_type[geom]))
    size = np.array(model.geom_size[geom], dtype=float)
    if kind is None:
        raise ConfigError(
            where=f"geom {model.geom(geom).name}",
            found=f"of MuJoCo type {int(model.geom_type[geom])}",
            expected="a box, cylinder, capsule or sphere",
            action="Describe colliding bodies with primitives, or give the geom contype 0.",
        )
    if kind in ("cylinder", "capsule"):
        size = np.array([size[0], size[0], size[1]])
    if kind == "sphere":
        size = np.full(3, size[0])
    return kind, size


def _carrier(model: Any, body: int, links: list[int]) -> int:
    while body and body not in links:
        body = int(model.body_parentid[body])
    return links.index(body) if body in links else BASE_FRAME


def _relative(
    data: Any, links: list[int], frame: int, rotation: Array, position: Array
) -> tuple[Array, Array]:
    if frame == BASE_FRAME:
        return rotation, position
    base = np.array(data.xmat[links[frame]]).reshape(3, 3)
    return base.T @ rotation, base.T @ (position - data.xpos[links[frame]])


def _robot_shape(model: Any, data: Any, geom: int, links: list[int]) -> Shape:
    body = int(model.geom_bodyid[geom])
    frame = _carrier(model, body, links)
    in_body = matrix(model.geom_quat[geom])
    body_rotation = np.array(data.xmat[body]).reshape(3, 3)
    rotation, position = _relative(
        data, links, frame, body_rotation @ in_body,
        data.xpos[body] + body_rotation @ model.geom_pos[geom],
    )  # fmt: skip
    slide = np.zeros(3)
    joint = int(model.body_jntadr[body])
    if joint >= len(links) and model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE:
        world = body_rotation @ model.jnt_axis[joint]
        slide, _ = _relative(data, links, frame, world, np.zeros(3))
    kind, half = _half_size(model, geom)
    name = model.geom(geom).name
    tool = frame == len(links) - 1 and body != links[-1]
    return Shape(name, model.body(body).name, kind, half, frame, rotation, position, slide, tool)


def held_placement(model: Any, data: Any, links: list[int]) -> tuple[int, int, Array, Array] | None:
    """Held body, frame, rotation and position of it in the frame, from the weld to the hand."""
    for i in range(model.neq):
        first, second = int(model.eq_obj1id[i]), int(model.eq_obj2id[i])
        if model.eq_type[i] != mujoco.mjtEq.mjEQ_WELD or _carrier(model, first, links) < 0:
            continue
        # eq_data: anchor on the second body (3), position (3) and quaternion (4) in the first.
        values = np.array(model.eq_data[i])
        hand = np.array(data.xmat[first]).reshape(3, 3)
        in_hand = matrix(values[6:10])
        origin = data.xpos[first] + hand @ (values[3:6] - in_hand @ values[:3])
        frame = _carrier(model, first, links)
        rotation, position = _relative(data, links, frame, hand @ in_hand, origin)
        return second, frame, rotation, position
    return None


def _held_shape(model: Any, geom: int, held: tuple[int, int, Array, Array]) -> Shape:
    _, frame, rotation, position = held
    kind, half = _half_size(model, geom)
    return Shape(
        HELD, HELD, kind, half, frame,
        rotation @ matrix(model.geom_quat[geom]),
        position + rotation @ model.geom_pos[geom], np.zeros(3), tool=True,
    )  # fmt: skip


def _scene_shape(model: Any, geom: int) -> Shape:
    kind, half = _half_size(model, geom)
    name, body = model.geom(geom).name, model.body(int(model.geom_bodyid[geom])).name
    rotation, position = matrix(model.geom_quat[geom]), np.array(model.geom_pos[geom])
    return Shape(name, body, kind, half, BASE_FRAME, rotation, position, np.zeros(3))


def _nominal_bodies(model: Any, scene: list[Shape]) -> dict[str, tuple[Array, float]]:
    bodies = {}
    for name in dict.fromkeys(shape.body for shape in scene):
        body = model.body(name)
        rotation = matrix(body.quat)
        bodies[name] = (np.array(body.pos), float(np.arctan2(rotation[1, 0], rotation[0, 0])))
    return bodies


def _held_size(
    model: Any, data: Any, links: list[int], held: list[Shape], tcp_site: str
) -> tuple[float, float]:
    sites = [i for i in range(model.nsite) if model.site(i).name == tcp_site]
    if not held or not sites:
        return 0.0, 0.0
    frame = held[0].frame
    _, tcp = _relative(data, links, frame, np.eye(3), np.array(data.site_xpos[sites[0]]))
    rotation, _ = _relative(
        data, links, frame, np.array(data.site_xmat[sites[0]]).reshape(3, 3), np.zeros(3)
    )
    tips = [
        float(
            rotation[:, 2] @ (s.position_m - tcp)
            + np.abs(rotation[:, 2] @ s.rotation) @ s.half_size_m
        )
        for s in held
    ]
    return max(tips), min(float(s.half_size_m.min()) for s in held)


def _target(model: Any) -> tuple[str, Array]:
    for site in range(model.nsite):
        if model.site(site).name == TARGET_SITE:
            body = int(model.site_bodyid[site])
            return str(model.body(body).name), np.array(model.site_pos[site])
    return "", np.zeros(3)
