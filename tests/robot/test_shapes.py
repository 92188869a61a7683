"""Shapes and the spheres around them."""

import numpy as np

from genpolicy.robot.shapes import bounding_spheres


def test_spheres_cover_their_shapes(model, rng):
    for shape in model.shapes.robot:
        centres, radius = bounding_spheres(shape)
        half = shape.half_size_m
        if shape.kind == "box":
            points = rng.uniform(-half, half, (4000, 3))
        else:
            angle, reach = rng.uniform(0, 2 * np.pi, 4000), half[0]
            flat = reach * np.stack([np.cos(angle), np.sin(angle)], axis=1)
            points = np.column_stack([flat, rng.uniform(-half[2], half[2], 4000)])
            if shape.kind == "capsule":
                caps = rng.normal(size=(4000, 3))
                caps *= reach / np.linalg.norm(caps, axis=1, keepdims=True)
                points = np.concatenate([points, caps + np.sign(caps[:, 2:]) * [0, 0, half[2]]])
        distance = np.linalg.norm(points[:, None] - centres, axis=2).min(axis=1)
        assert distance.max() <= radius + 1e-12, shape.name
