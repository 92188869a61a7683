"""How positions with any number of components are shown on paper.

One component: its value over the action steps. Two or three: the scene, seen along the axis in
which the least happens. More (joints): over the steps, along the direction in which the paths
differ most, since no plane of a joint space looks like the scene.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SCENE = 3
"""Most components that are a place in the scene."""


@dataclass(frozen=True)
class Plane:
    """Where a path of positions is drawn.

    Attributes:
        x_label: Name of the horizontal axis, with its unit.
        y_label: Name of the vertical axis, with its unit.
        columns: The two components of a scene; None where paths are drawn over the steps.
        direction: Direction that the vertical axis shows, where there are many. Shape (P,).
    """

    x_label: str
    y_label: str
    columns: tuple[int, int] | None
    direction: Array | None = None

    @property
    def is_scene(self) -> bool:
        """Whether both axes are lengths of one scene."""
        return self.columns is not None

    def line(self, path: Array) -> Array:
        """Points to draw of a path of shape (K, P). Shape (K, 2)."""
        if self.columns is not None:
            return np.asarray(path[:, list(self.columns)], dtype=np.float64)
        steps = np.arange(len(path), dtype=np.float64)
        value = path[:, 0] if self.direction is None else (path - path[0]) @ self.direction
        return np.stack([steps, value], axis=1)


def plane_of(
    paths: Sequence[Array], names: Sequence[str], unit: str, *, from_above: bool = False
) -> Plane:
    """The plane that shows these paths best.

    Args:
        paths: Shapes (K, P), of one situation or of many.
        names: Name of each component. Length P.
        unit: Their unit; empty if they have none in common.
        from_above: Show the first two components of a scene whatever happens in the third,
            because obstacles are known there.
    """
    width = len(names)
    if width <= 1:
        return Plane("action steps ahead", _label(names[0] if names else "value", unit), None)
    scene = _scene(names)
    if scene:
        spread = np.sum([np.ptp(path - path[0], axis=0) ** 2 for path in paths], axis=0)
        used = scene[:2] if from_above else _widest(spread, scene)
        return Plane(_label(names[used[0]], unit), _label(names[used[1]], unit), (used[0], used[1]))
    direction = main_direction(np.concatenate([path - path[0] for path in paths]))[0]
    return Plane("action steps ahead", _label("motion along main direction", unit), None, direction)


def scatter_of(positions: Array, names: Sequence[str], unit: str) -> tuple[Array, str, str]:
    """Two numbers of each position and their labels; with many components the principal ones.

    Args:
        positions: Shape (n, P), P at least 2.
        names: Name of each component.
        unit: Their unit; empty if they have none in common.

    Returns:
        Shape (n, 2), and the labels.
    """
    scene = _scene(names)
    if scene:
        used = _widest(np.ptp(positions, axis=0), scene)
        return positions[:, used], _label(names[used[0]], unit), _label(names[used[1]], unit)
    axes = main_direction(positions, count=2)
    centred = positions - positions.mean(axis=0)
    total = float(np.sum(centred**2)) or 1.0
    places = centred @ axes.T
    shares = np.sum(places**2, axis=0) / total
    first, second = (
        _label(f"{order} main direction ({share:.0%} of the spread)", unit)
        for order, share in zip(("first", "second"), shares, strict=True)
    )
    return places, first, second


def main_direction(points: Array, count: int = 1) -> Array:
    """Directions of largest spread, largest first, each with its largest component positive.

    Args:
        points: Shape (n, P).
        count: How many.

    Returns:
        Shape (count, P).
    """
    centred = points - points.mean(axis=0)
    # Of the small square matrix: its eigenvectors cost the same for any number of points.
    axes = np.linalg.eigh(centred.T @ centred)[1][:, ::-1][:, :count].T
    signs = np.sign(axes[np.arange(count), np.argmax(np.abs(axes), axis=1)])
    return np.asarray(axes * np.where(signs == 0, 1.0, signs)[:, None])


def _scene(names: Sequence[str]) -> list[int]:
    """Which components are a place in the scene; none if they are joints, or of two arms."""
    if len(names) <= SCENE:
        return list(range(len(names)))
    ends = [name.rpartition(".")[2].removesuffix("_m").removesuffix("_px") for name in names]
    found = [place for place, end in enumerate(ends) if end in ("x", "y", "z")]
    kinds = [ends[place] for place in found]
    return found if kinds in (["x", "y"], ["x", "y", "z"]) else []


def _widest(spread: Array, scene: list[int]) -> list[int]:
    """The two components of a scene with the largest spread, in their order."""
    order = np.argsort(-spread[scene], kind="stable")[:2]
    return sorted(scene[int(place)] for place in order)


def _label(name: str, unit: str) -> str:
    end = name.rpartition(".")[2]
    name = end if end in ("x", "y", "z") else name
    plain = name.removesuffix(f"_{unit}") if unit else name
    plain = plain.replace("_", " ")
    return f"{plain}, {unit}" if unit else plain
