"""What stands in a message: arrays of samples to JSON and back, one kind per schema.

Poses use Foxglove's well-known JSON schemas, so that its viewer shows them; the rest has small
schemas of its own. A rotation is a quaternion on the wire and two matrix columns in memory.
A number that is not finite becomes `null`, and `null` becomes NaN: it is for the dataset's
contract check to refuse it with its row.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import orjson
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from genpolicy.contract.rotation import orthonormality_error, rotation_from_6d, rotation_to_6d
from genpolicy.errors import ContractError

Array = NDArray[np.float64]
Numbers = tuple[Any, ...]

FRAME = "robot_base"
NS_PER_S = 1_000_000_000
ROTATION_TOLERANCE = 1e-6


@dataclass(frozen=True)
class Kind:
    """One kind of message.

    Attributes:
        schema_name: Name of the JSON schema.
        schema: The JSON schema.
        width: Numbers per sample in memory; 0 for any.
        fields: Message body (without timestamp) of the wire numbers of one sample.
        numbers: The wire numbers of one message; the inverse of `fields`.
        to_wire: Samples (n, width) to wire numbers (n, m).
        from_wire: The inverse.
    """

    schema_name: str
    schema: dict[str, Any]
    width: int
    fields: Callable[[list[float]], dict[str, Any]]
    numbers: Callable[[dict[str, Any]], Numbers]
    to_wire: Callable[[Array, str], Array]
    from_wire: Callable[[Array, str], Array]


def encode(kind: Kind, values: Array, event_time_ns: Sequence[int], *, where: str) -> list[bytes]:
    """JSON messages of samples (n, width).

    Raises:
        ContractError: A rotation that is not one.
    """
    rows = kind.to_wire(values, where).tolist()
    return [
        orjson.dumps({"timestamp": timestamp(time), **kind.fields(row)})
        for row, time in zip(rows, event_time_ns, strict=True)
    ]


def decode(
    kind: Kind, messages: Sequence[bytes], event_time_ns: Sequence[int], *, where: str
) -> Array:
    """Samples (n, width) of JSON messages.

    Raises:
        ContractError: A message is not JSON, does not match the schema, or its timestamp is not
            its publish time.
    """
    rows: list[Numbers] = []
    for index, (data, time) in enumerate(zip(messages, event_time_ns, strict=True)):
        document = parse(data, time, where=f"{where}, message {index}")
        try:
            row = kind.numbers(document)
        except (KeyError, TypeError, IndexError) as error:
            raise _mismatch(f"{where}, message {index}", kind, repr(error)) from error
        if any(type(number) not in (float, int, type(None)) for number in row) or (
            rows and len(row) != len(rows[0])
        ):
            raise _mismatch(f"{where}, message {index}", kind, repr(row)[:80])
        rows.append(row)
    try:
        wire = np.array(rows, dtype=np.float64)
    except OverflowError as error:
        raise _mismatch(where, kind, "a number beyond float64") from error
    return kind.from_wire(wire, where)


def timestamp(time_ns: int) -> dict[str, int]:
    """Foxglove's time."""
    sec, nsec = divmod(int(time_ns), NS_PER_S)
    return {"sec": sec, "nsec": nsec}


def parse(data: bytes, time_ns: int, *, where: str) -> dict[str, Any]:
    """The JSON object of one message, whose timestamp must be `time_ns`.

    Raises:
        ContractError: Not JSON, not an object, or of another time.
    """
    try:
        document = orjson.loads(data)
        stamp = document["timestamp"]
        same = stamp["sec"] * NS_PER_S + stamp["nsec"] == time_ns
    except (orjson.JSONDecodeError, KeyError, TypeError) as error:
        raise ContractError(
            where=where,
            found=f"not readable ({error!r:.120})",
            expected="a JSON object with a timestamp and finite numbers",
            action="Record null for a value that is missing, never NaN.",
        ) from error
    if not same:
        raise ContractError(
            where=f"{where}: timestamp",
            found=str(stamp)[:80],
            expected=f"the publish time {time_ns} ns",
            action="Publish every message with the event time of its sample.",
        )
    return dict(document)


def _mismatch(where: str, kind: Kind, found: str) -> ContractError:
    return ContractError(
        where=where,
        found=f"not a {kind.schema_name} ({found})",
        expected="the numbers that its schema names",
        action="Write messages that match their schema.",
    )


def _same(values: Array, where: str) -> Array:
    return values


def _check_rotation(error: Array, where: str) -> None:
    bad = np.flatnonzero(error > ROTATION_TOLERANCE)
    if bad.size:
        raise ContractError(
            where=f"{where}, row {bad[0]}: rotation",
            found=f"{error[bad[0]]:.3g} away from a unit rotation",
            expected=f"at most {ROTATION_TOLERANCE}",
            action="Record rotations, in rad, as unit quaternions or orthonormal columns.",
        )


def _pose_to_wire(values: Array, where: str) -> Array:
    columns = values[:, 3:9]
    _check_rotation(orthonormality_error(columns), where)
    quaternion = np.full((len(values), 4), np.nan)
    known = np.isfinite(columns).all(axis=1)
    if known.any():
        quaternion[known] = Rotation.from_matrix(rotation_from_6d(columns[known])).as_quat()
    return np.concatenate([values[:, :3], quaternion], axis=1)


def _pose_from_wire(wire: Array, where: str) -> Array:
    quaternion = wire[:, 3:]
    norm = np.linalg.norm(quaternion, axis=1, keepdims=True)
    _check_rotation(np.abs(norm[:, 0] - 1.0), where)
    columns = np.full((len(wire), 6), np.nan)
    known = np.isfinite(quaternion).all(axis=1)
    if known.any():
        columns[known] = rotation_to_6d(Rotation.from_quat(quaternion[known]).as_matrix())
    return np.concatenate([wire[:, :3], columns], axis=1)


def _planar_to_wire(values: Array, where: str) -> Array:
    cosine, sine = values[:, 2], values[:, 3]
    _check_rotation(np.abs(np.hypot(cosine, sine) - 1.0), where)
    half = np.arctan2(sine, cosine) / 2.0
    flat = np.where(np.isfinite(half), 0.0, np.nan)
    return np.stack(
        [values[:, 0], values[:, 1], np.zeros(len(values)), flat, flat, np.sin(half), np.cos(half)],
        axis=1,
    )


def _planar_from_wire(wire: Array, where: str) -> Array:
    _check_rotation(np.abs(np.linalg.norm(wire[:, 3:], axis=1) - 1.0), where)
    _check_rotation(np.linalg.norm(wire[:, 3:5], axis=1), where)
    yaw = 2.0 * np.arctan2(wire[:, 5], wire[:, 6])
    return np.stack([wire[:, 0], wire[:, 1], np.cos(yaw), np.sin(yaw)], axis=1)


def _pose_fields(row: list[float]) -> dict[str, Any]:
    return {
        "frame_id": FRAME,
        "pose": {
            "position": dict(zip("xyz", row[:3], strict=True)),
            "orientation": dict(zip("xyzw", row[3:], strict=True)),
        },
    }


def _pose_numbers(message: dict[str, Any]) -> Numbers:
    if message["frame_id"] != FRAME:
        raise KeyError(f"frame_id {message['frame_id']!r:.40} is not {FRAME!r}")
    position, q = message["pose"]["position"], message["pose"]["orientation"]
    return position["x"], position["y"], position["z"], q["x"], q["y"], q["z"], q["w"]


def _wrench_fields(row: list[float]) -> dict[str, Any]:
    return {"frame_id": FRAME, "force_n": dict(zip("xyz", row, strict=True))}


def _wrench_numbers(message: dict[str, Any]) -> Numbers:
    if message["frame_id"] != FRAME:
        raise KeyError(f"frame_id {message['frame_id']!r:.40} is not {FRAME!r}")
    force = message["force_n"]
    return force["x"], force["y"], force["z"]


_NUMBER = {"type": ["number", "null"]}


def _object(title: str, properties: dict[str, Any]) -> dict[str, Any]:
    stamp = {"type": "integer", "minimum": 0}
    time = {"type": "object", "title": "time", "properties": {"sec": stamp, "nsec": stamp}}
    return {
        "title": title,
        "type": "object",
        "properties": {"timestamp": time, **properties},
        "required": ["timestamp", *properties],
    }


def _vector(names: str) -> dict[str, Any]:
    return {
        "type": "object",
        "properties": {name: _NUMBER for name in names},
        "required": list(names),
    }


def _pose_kind(
    width: int, to_wire: Callable[[Array, str], Array], from_wire: Callable[[Array, str], Array]
) -> Kind:
    pose = {
        "type": "object",
        "properties": {"position": _vector("xyz"), "orientation": _vector("xyzw")},
        "required": ["position", "orientation"],
    }
    schema = _object("foxglove.PoseInFrame", {"frame_id": {"type": "string"}, "pose": pose})
    return Kind(
        "foxglove.PoseInFrame", schema, width, _pose_fields, _pose_numbers, to_wire, from_wire
    )


def _numbers_kind(title: str, name: str, width: int) -> Kind:
    """Numbers in a list below `name`, or one number where the width is 1."""
    if width == 1:
        schema = _object(title, {name: _NUMBER})
        return Kind(
            title, schema, 1, lambda row: {name: row[0]}, lambda m: (m[name],), _same, _same
        )

    def numbers(message: dict[str, Any]) -> Numbers:
        if not isinstance(message[name], list):
            raise TypeError(f"{name} is not a list")
        return tuple(message[name])

    schema = _object(title, {name: {"type": "array", "items": _NUMBER}})
    return Kind(title, schema, width, lambda row: {name: row}, numbers, _same, _same)


POSE = _pose_kind(9, _pose_to_wire, _pose_from_wire)
PLANAR_POSE = _pose_kind(4, _planar_to_wire, _planar_from_wire)
GRIPPER = _numbers_kind("genpolicy.Gripper", "opening_m", 1)
OFFSET = _numbers_kind("genpolicy.Offset", "offset_m", 1)
JOINTS = _numbers_kind("genpolicy.Joints", "position_rad", 7)
NUMBERS = _numbers_kind("genpolicy.Numbers", "values", 0)
WRENCH = Kind(
    "genpolicy.Wrench",
    _object("genpolicy.Wrench", {"frame_id": {"type": "string"}, "force_n": _vector("xyz")}),
    3,
    _wrench_fields,
    _wrench_numbers,
    _same,
    _same,
)
LOG_SCHEMA_NAME = "foxglove.Log"
LOG_SCHEMA = _object(
    LOG_SCHEMA_NAME,
    {
        "level": {"type": "integer"},
        "message": {"type": "string"},
        "name": {"type": "string"},
        "file": {"type": "string"},
        "line": {"type": "integer", "minimum": 0},
    },
)
