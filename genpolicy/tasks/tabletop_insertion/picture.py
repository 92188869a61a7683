"""A picture of the cell by ray casting: no graphics library, no display, the same bytes anywhere.

Lambert shading with one lamp, its shadows and ambient light.
"""

from functools import lru_cache

import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]

EYE_M = np.array([1.25, -0.95, 0.95])
LOOK_AT_M = np.array([0.42, 0.0, 0.17])
FIELD_OF_VIEW_RAD = 0.62
LAMP_M = np.array([0.55, -0.75, 1.7])
AMBIENT, DIFFUSE, SHADOW = 0.45, 0.60, 0.45
BACKGROUND = np.array([0.93, 0.95, 0.97])
FAR_M = 10.0
SHADOW_BIAS_M = 1e-3


def draw(
    model: mujoco.MjModel, data: mujoco.MjData, *, width: int = 240, height: int = 180
) -> Picture:
    """Picture of a scene, seen from above and aside so that arm, post and fixture show.

    Args:
        model: The scene.
        data: Its state, kinematics up to date.
        width: Pixels, >= 1.
        height: Pixels, >= 1.

    Returns:
        Red, green, blue. Shape (height, width, 3), uint8.
    """
    rays = _rays(width, height)
    geoms, distances, normals = _cast(model, data, EYE_M, rays)
    hit = geoms >= 0
    colours = np.broadcast_to(BACKGROUND, rays.shape).copy()
    points = EYE_M + distances[hit, None] * rays[hit]
    normals = normals[hit] / np.linalg.norm(normals[hit], axis=1, keepdims=True)
    facing = np.where(np.sum(normals * rays[hit], axis=1) > 0, -1.0, 1.0)
    to_lamp = LAMP_M - points
    to_lamp /= np.linalg.norm(to_lamp, axis=1, keepdims=True)
    lambert = np.clip(facing * np.sum(normals * to_lamp, axis=1), 0.0, 1.0)
    lit = _lit(model, data, points)
    light = AMBIENT + DIFFUSE * lambert * np.where(lit, 1.0, SHADOW)
    colours[hit] = model.geom_rgba[geoms[hit], :3] * light[:, None]
    pixels = np.round(255.0 * np.clip(colours, 0.0, 1.0)).astype(np.uint8)
    return np.asarray(pixels.reshape(height, width, 3))


@lru_cache(maxsize=8)
def _rays(width: int, height: int) -> Array:
    forward = LOOK_AT_M - EYE_M
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right = right / np.linalg.norm(right)
    up = np.cross(right, forward)
    half = np.tan(0.5 * FIELD_OF_VIEW_RAD)
    v = half * (1.0 - 2.0 * (np.arange(height) + 0.5) / height)
    u = half * width / height * (2.0 * (np.arange(width) + 0.5) / width - 1.0)
    rays = forward + u[None, :, None] * right + v[:, None, None] * up
    rays = rays.reshape(-1, 3)
    return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))


def _cast(
    model: mujoco.MjModel, data: mujoco.MjData, origin: Array, rays: Array
) -> tuple[NDArray[np.int32], Array, Array]:
    count = len(rays)
    geoms = np.full(count, -1, dtype=np.int32)
    distances = np.zeros(count)
    normals = np.zeros(3 * count)
    mujoco.mj_multiRay(
        model, data, origin, np.ascontiguousarray(rays).ravel(), None, True, -1,
        geoms, distances, normals, count, FAR_M,
    )  # fmt: skip
    return geoms, distances, normals.reshape(count, 3)


def _lit(model: mujoco.MjModel, data: mujoco.MjData, points: Array) -> NDArray[np.bool_]:
    """Whether the lamp sees each point, by rays from the lamp."""
    away = points - LAMP_M
    lengths = np.linalg.norm(away, axis=1)
    _, distances, _ = _cast(model, data, LAMP_M, away / lengths[:, None])
    return np.asarray(distances >= lengths - SHADOW_BIAS_M * 3)
