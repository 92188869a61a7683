"""Several chunks at once, as the layers see them, and what a layer answers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import GRIPPER, POSITION, ROTATION
from genpolicy.contract.chunk import Projected
from genpolicy.feasibility.context import Context
from genpolicy.feasibility.kernels.turn import from_rows

Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True)
class Margins:
    """A layer's answer for B chunks.

    Attributes:
        values: Margin of each check, in the check's unit; feasible where >= 0. Shapes (B,).
        details: What touched what, one text per chunk; empty where there is nothing to tell.
    """

    values: Mapping[str, Array]
    details: tuple[str, ...] = ()


@dataclass(frozen=True)
class Solution:
    """Inverse kinematics of a batch; the last iterate where a pose is not reached.

    Attributes:
        q_rad: Joint positions, rad. Shape (B, n, J).
        position_error_m: Distance that is left, m. Shape (B, n).
        rotation_error_rad: Angle that is left, rad. Shape (B, n).
    """

    q_rad: Array
    position_error_m: Array
    rotation_error_rad: Array


@dataclass(frozen=True)
class Batch:
    """B chunks and their contexts.

    The array properties need chunks of the right shape with equally many executable rows; before
    the representation layer only `projected` and `contexts` may be read.

    Attributes:
        projected: The chunks.
        contexts: One per chunk.
        solution: Inverse kinematics, from `inverse.solved` on.
    """

    projected: tuple[Projected, ...]
    contexts: tuple[Context, ...]
    solution: Solution | None = None

    def __len__(self) -> int:
        return len(self.projected)

    @cached_property
    def actions(self) -> Array:
        """Projected rows that can be executed. Shape (B, n, D_a)."""
        pairs = zip(self.projected, self.contexts, strict=True)
        return np.stack([p.actions[c.rows(len(p.actions))] for p, c in pairs])

    @cached_property
    def rotation(self) -> Array:
        """Rotation of each row. Shape (B, n, 3, 3)."""
        result = np.empty((*self.actions.shape[:2], 3, 3))
        from_rows(self.actions, ROTATION.start, result)
        return result

    @cached_property
    def last_action(self) -> Array:
        """Action commanded last. Shape (B, D_a)."""
        return np.stack([c.last_action for c in self.contexts])

    @cached_property
    def q_cmd_rad(self) -> Array:
        """Joint positions of the last command, rad. Shape (B, J)."""
        return np.stack([c.q_cmd for c in self.contexts])

    @property
    def solved(self) -> Solution:
        """The inverse kinematics, which must have been computed."""
        assert self.solution is not None, "inverse.solved comes before the kinematic layer"
        return self.solution

    @cached_property
    def openings_m(self) -> Array:
        """Gripper opening at the last action, then at each row, m. Shape (B, n + 1)."""
        rows = np.concatenate([self.last_action[:, None], self.actions], axis=1)
        return np.asarray(rows[..., GRIPPER])

    @cached_property
    def steps_m(self) -> Array:
        """TCP displacement of every action, from the last one on, m. Shape (B, n, 3)."""
        before = np.concatenate([self.last_action[:, None], self.actions[:, :-1]], axis=1)
        steps: Array = self.actions[..., POSITION] - before[..., POSITION]
        return steps

    def held(self, held_opening_m: float) -> BoolArray:
        """Whether the object is still held: at the last action, then at each row. (B, n + 1)."""
        held: BoolArray = np.logical_and.accumulate(self.openings_m <= held_opening_m, axis=1)
        return held

    def in_phases(self, phases: frozenset[str]) -> BoolArray:
        """Whether the active phase is one of these. Shape (B,)."""
        return np.array([c.phase in phases for c in self.contexts])

    def take(self, rows: Sequence[int] | NDArray[np.intp]) -> "Batch":
        """The batch of some of the chunks; the batch itself where that is all of them."""
        if len(rows) == len(self):
            return self
        found = self.solution
        return Batch(
            tuple(self.projected[i] for i in rows),
            tuple(self.contexts[i] for i in rows),
            None
            if found is None
            else Solution(
                found.q_rad[rows], found.position_error_m[rows], found.rotation_error_rad[rows]
            ),
        )
