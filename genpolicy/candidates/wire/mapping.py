"""From named observation channels to a policy's inputs, and from its numbers to the mapped action.

Everything before the first check of feasibility: whatever a policy says, in mm or quaternions, from
the base or from the hand, or as joint positions, becomes the one action that all methods are judged
by. Relative actions start at the state that conditioned them, never at a newer one: the chunk says
what it meant then.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation as Turn

from genpolicy.candidates.wire.channels import columns_of
from genpolicy.candidates.wire.entry import LENGTH, Gripper, Input, Orientation, Output
from genpolicy.candidates.wire.joints import JointSpace
from genpolicy.candidates.wire.writing import written
from genpolicy.contract.action import join_action
from genpolicy.contract.observation import ObservationContract
from genpolicy.contract.rotation import rotation_from_6d
from genpolicy.errors import ContractError

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

POSITION_SIZE, ROTATION_SIZE = 3, 6
METRE, PURE = "m", "1"
UNIT_OF_SIZE = {POSITION_SIZE: METRE, ROTATION_SIZE: PURE}
"""Of the numbers of an anchor, by how many there are."""


class Inputs:
    """What a policy is given of an observation.

    Args:
        wanted: By name on the wire.
        contract: The observation in force.
        observation_horizon: H_o.

    Raises:
        ContractError: A channel that the observation does not have, or more history than H_o.
    """

    def __init__(
        self, wanted: dict[str, Input], contract: ObservationContract, *, observation_horizon: int
    ) -> None:
        lengths = _lengths(contract)
        self._parts: dict[str, tuple[Indices, Array, Input]] = {}
        for name, part in wanted.items():
            if part.history > observation_horizon:
                raise ContractError(
                    where=f"observation.{name}.history of the candidate",
                    found=str(part.history),
                    expected=f"at most H_o = {observation_horizon}",
                    action="Ask for fewer observations, or declare a longer observation_horizon.",
                )
            columns = columns_of(part.channels, contract, where=f"observation.{name}")
            scale = np.where(lengths[columns], 1.0 / LENGTH[part.unit], 1.0)
            self._parts[name] = (columns, scale, part)

    def of(self, observations: Array) -> dict[str, NDArray[np.floating]]:
        """Arrays by name, of observations (H_o, D_o), newest last."""
        given = {}
        for name, (columns, scale, part) in self._parts.items():
            values = (observations[-part.history :, columns] * scale).astype(part.dtype)
            given[name] = values if part.history > 1 else values[0]
        return given


class Outputs:
    """What a policy's numbers mean.

    Args:
        output: As declared.
        contract: The observation in force, which holds the anchor.
        scene: The MJCF that describes the robot, for whoever says joint positions; None where
            nobody knows it.

    Raises:
        ContractError: An anchor that the observation does not have, or of another unit, or other
            joints than the robot's.
    """

    def __init__(
        self, output: Output, contract: ObservationContract, *, scene: Path | None = None
    ) -> None:
        self.output = output
        self._anchor: tuple[Indices, Indices] | None = None
        self._joints: JointSpace | None = None
        if output.joints is not None:
            self._joints = JointSpace(output.joints, output, contract, scene)
        elif output.anchor is not None:
            self._anchor = (
                _anchor(output.anchor.position, contract, "action.anchor.position", POSITION_SIZE),
                _anchor(output.anchor.rotation, contract, "action.anchor.rotation", ROTATION_SIZE),
            )

    def mapped(self, chunks: Array, conditioned_by: Array) -> Array:
        """Mapped actions of chunks.

        Args:
            chunks: What the policy said. Shape (N, K, D).
            conditioned_by: Newest observation that it was given. Shape (D_o,).

        Returns:
            Positions in m and rotations in the base frame, openings in m; a row without a rotation
            is NaN there, and the first check rejects it; so is a number beyond `LARGEST`, which no
            arithmetic behind it has to bear. Row by row in memory, as compiled checks
            want it. Shape (N, K, 10).
        """
        mapped = self._mapped(np.where(np.abs(chunks) <= LARGEST, chunks, np.nan), conditioned_by)
        mapped[~(np.abs(mapped) <= LARGEST)] = np.nan
        return mapped

    def _mapped(self, chunks: Array, conditioned_by: Array) -> Array:
        opened = opening(self.output.gripper, chunks)
        if self._joints is not None:
            place, turned = self._joints.poses(chunks, conditioned_by)
            return np.ascontiguousarray(join_action(place, turned, opened))
        position = self.output.position
        assert position is not None  # an entry without joints has one
        place = chunks[..., position.columns] * LENGTH[position.unit]
        if self._as_predicted:
            assert self.output.rotation is not None  # see `_as_predicted`
            six = chunks[..., self.output.rotation.columns]
            return np.ascontiguousarray(np.concatenate([place, six, opened[..., None]], axis=-1))
        turned = self._turns(chunks)
        if self.output.motion != "absolute":
            place, turned = self._from_anchor(place, turned, conditioned_by)
        return np.ascontiguousarray(join_action(place, turned, opened))

    def written(self, actions: Array, conditioned_by: Array) -> Array:
        """The inverse: mapped actions as the policy would say them, after this observation.

        Args:
            actions: Shape (K, 10).
            conditioned_by: Newest observation that it is given. Shape (D_o,).

        Returns:
            Shape (K, D).

        Raises:
            ContractError: A form in which they cannot be said (see `not_writable`).
        """
        if self._anchor is None:
            return written(self.output, actions, None)
        position, rotation = conditioned_by[self._anchor[0]], conditioned_by[self._anchor[1]]
        return written(self.output, actions, (position, rotation_from_6d(rotation)))

    @property
    def _as_predicted(self) -> bool:
        """Six numbers that are the action's own: how far they are from a rotation is evidence."""
        rotation = self.output.rotation
        return (
            self.output.motion == "absolute"
            and rotation is not None
            and rotation.form == "rotation_6d"
        )

    def _turns(self, chunks: Array) -> Array:
        if self.output.rotation is not None:
            columns = self.output.rotation.columns
            return turns(self.output.rotation, chunks[..., columns])
        return np.broadcast_to(np.eye(3), (*chunks.shape[:-1], 3, 3))

    def _from_anchor(self, place: Array, turned: Array, seen: Array) -> tuple[Array, Array]:
        assert self._anchor is not None  # an entry without one is absolute
        position, rotation = seen[self._anchor[0]], rotation_from_6d(seen[self._anchor[1]])
        in_hand = self.output.frame == "tcp"
        if self.output.motion == "relative":
            moved = place @ rotation.T if in_hand else place
            return position + moved, rotation @ turned if in_hand else turned @ rotation
        places, rotations = np.empty_like(place), np.empty_like(turned)
        at = np.broadcast_to(position, place[:, 0].shape)
        towards = np.broadcast_to(rotation, turned[:, 0].shape)
        for row in range(place.shape[1]):
            step = place[:, row]
            at = at + (np.einsum("nij,nj->ni", towards, step) if in_hand else step)
            towards = towards @ turned[:, row] if in_hand else turned[:, row] @ towards
            places[:, row], rotations[:, row] = at, towards
        return places, rotations


def opening(gripper: Gripper, chunks: Array) -> Array:
    """Distance of each finger from closed, m, of chunks (..., D). Shape (...)."""
    share = (chunks[..., gripper.column] - gripper.closed) / (gripper.open - gripper.closed)
    opened: Array = share * gripper.open_m
    return opened


def turns(orientation: Orientation, numbers: Array) -> Array:
    """Rotation matrices of numbers (..., n) of a form; NaN where they are none. (..., 3, 3)."""
    form = orientation.form
    if form == "rotation_6d":
        return rotation_from_6d(numbers)
    flat = numbers.reshape(-1, numbers.shape[-1])
    known = np.isfinite(flat).all(axis=1)
    if form.startswith("quaternion"):
        known &= np.linalg.norm(flat, axis=1) > np.finfo(float).tiny
    result = np.full((len(flat), 3, 3), np.nan)
    if known.any():
        result[known] = _matrices(form, flat[known])
    return result.reshape(*numbers.shape[:-1], 3, 3)


def _matrices(form: str, rows: Array) -> Array:
    if form == "matrix":
        # The nearest rotation of a matrix that is none is not what was said.
        given = rows.reshape(-1, 3, 3)
        columns = np.concatenate([given[..., 0], given[..., 1]], axis=-1)
        made = rotation_from_6d(columns)
        off = np.abs(made - given).max(axis=(1, 2))
        return np.where((off < MATRIX_TOLERANCE)[:, None, None], made, np.nan)
    if form == "quaternion_xyzw":
        turned = Turn.from_quat(rows)
    elif form == "quaternion_wxyz":
        turned = Turn.from_quat(rows[:, [1, 2, 3, 0]])
    elif form == "rotation_vector_rad":
        turned = Turn.from_rotvec(rows)
    else:
        turned = Turn.from_euler("xyz", rows, degrees=form.endswith("deg"))
    matrices: Array = turned.as_matrix()
    return matrices


LARGEST = 1e6
"""Of the numbers of a chunk: a thousand kilometres, and nothing that overflows when squared."""
MATRIX_TOLERANCE = 1e-2
"""Of a network's matrix, per number; the six-number form is judged by feasibility itself."""


def _lengths(contract: ObservationContract) -> NDArray[np.bool_]:
    """Which numbers of the observation are lengths."""
    return np.array([unit == METRE for unit in _units(contract)])


def _units(contract: ObservationContract) -> list[str]:
    """Unit of each number of the observation."""
    return [
        METRE if component.endswith("_m") else channel.unit
        for channel in contract.channels
        for component in channel.components
    ]


def _anchor(
    names: Sequence[str] | None, contract: ObservationContract, where: str, size: int
) -> Indices:
    """Where the position in m, or the rotation in pure numbers, of an anchor is observed."""
    columns = columns_of(names or (), contract, where=where)
    if len(columns) != size:
        raise ContractError(
            where=f"{where} of the candidate",
            found=f"{len(columns)} numbers",
            expected=f"{size}",
            action="Name the pose that relative actions start from.",
        )
    units, expected = _units(contract), UNIT_OF_SIZE[size]
    if other := [column for column in columns if units[column] != expected]:
        named = contract.component_names[other[0]]
        raise ContractError(
            where=f"{where} of the candidate",
            found=f"{named} in {units[other[0]]}",
            expected=f"{size} numbers in {expected}",
            action="Name the pose that relative actions start from.",
        )
    return columns
