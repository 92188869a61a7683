"""Foxglove's well-known messages that a replay is made of: their JSON schemas, and what fills them.

Named and shaped as the viewer knows them (`foxglove.SceneUpdate`, `foxglove.FrameTransform`); the
schemas describe the fields that are written here, and no others, in the plain types that public
viewers read (`genpolicy.execution.event_schemas` says which). Lengths in m, in the robot's base
frame unless a frame is named; colours are red, green, blue and opacity from 0 to 1.

Source: Foxglove, well-known message schemas.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from genpolicy.data.recording.wire import FRAME, JOINTS, LOG_SCHEMA, LOG_SCHEMA_NAME, timestamp

Array = NDArray[np.float64]
Json = dict[str, Any]
Colour = tuple[float, float, float, float]

SCENE_SCHEMA_NAME = "foxglove.SceneUpdate"
TRANSFORM_SCHEMA_NAME = "foxglove.FrameTransform"
JOINTS_SCHEMA_NAME = JOINTS.schema_name
"""As in a recording: the same fields."""
LINE_STRIP, LINE_LIST = 0, 2
DELETE_ALL = 1
DECIMALS = 6
"""Of metres and of quaternions: a thousandth of a millimetre, above a processor's last bits."""
INFO, WARNING, ERROR = 2, 3, 4
"""Levels of `foxglove.Log`."""
TEXT_M = 0.018
"""Height of a letter, m."""
KINDS_OF_PRIMITIVES = (
    "arrows", "cubes", "spheres", "cylinders", "lines", "triangles", "texts", "models",
)  # fmt: skip
IDENTITY = np.eye(3)


def _object(**properties: Json) -> Json:
    return {"type": "object", "properties": properties, "required": list(properties)}


def _list(items: Json) -> Json:
    return {"type": "array", "items": items}


_NUMBER, _TEXT, _FLAG = {"type": "number"}, {"type": "string"}, {"type": "boolean"}
_NANOSECONDS = {"type": "integer", "minimum": 0, "maximum": 999_999_999}
_TIME = {**_object(sec={"type": "integer", "minimum": 0}, nsec=_NANOSECONDS), "title": "time"}
_DURATION = {**_object(sec={"type": "integer"}, nsec=_NANOSECONDS), "title": "duration"}
_VECTOR = _object(x=_NUMBER, y=_NUMBER, z=_NUMBER)
_QUATERNION = _object(x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER)
_POSE = _object(position=_VECTOR, orientation=_QUATERNION)
_PART = {"type": "number", "minimum": 0, "maximum": 1}
_COLOUR = _object(r=_PART, g=_PART, b=_PART, a=_PART)
_SOLID = _object(pose=_POSE, size=_VECTOR, color=_COLOUR)
_CYLINDER = _object(
    pose=_POSE, size=_VECTOR, bottom_scale=_NUMBER, top_scale=_NUMBER, color=_COLOUR
)
_LINE = _object(
    type={"type": "integer", "enum": [LINE_STRIP, 1, LINE_LIST]},
    pose=_POSE, thickness=_NUMBER, scale_invariant=_FLAG, points=_list(_VECTOR), color=_COLOUR,
    colors=_list(_COLOUR), indices=_list({"type": "integer", "minimum": 0}),
)  # fmt: skip
_LETTERS = _object(
    pose=_POSE, billboard=_FLAG, font_size=_NUMBER, scale_invariant=_FLAG, color=_COLOUR, text=_TEXT
)
_UNUSED = {"type": "array", "items": _object(), "maxItems": 0}
_ENTITY = _object(
    timestamp=_TIME, frame_id=_TEXT, id=_TEXT, lifetime=_DURATION, frame_locked=_FLAG,
    metadata=_list(_object(key=_TEXT, value=_TEXT)),
    arrows=_UNUSED, cubes=_list(_SOLID), spheres=_list(_SOLID), cylinders=_list(_CYLINDER),
    lines=_list(_LINE), triangles=_UNUSED, texts=_list(_LETTERS), models=_UNUSED,
)  # fmt: skip
_DELETION = _object(timestamp=_TIME, type={"type": "integer", "enum": [0, DELETE_ALL]}, id=_TEXT)

SCHEMAS: dict[str, Json] = {
    SCENE_SCHEMA_NAME: {
        "title": SCENE_SCHEMA_NAME, **_object(deletions=_list(_DELETION), entities=_list(_ENTITY)),
    },
    TRANSFORM_SCHEMA_NAME: {
        "title": TRANSFORM_SCHEMA_NAME,
        **_object(
            timestamp=_TIME, parent_frame_id=_TEXT, child_frame_id=_TEXT, translation=_VECTOR,
            rotation=_QUATERNION,
        ),
    },
    LOG_SCHEMA_NAME: LOG_SCHEMA,
    JOINTS_SCHEMA_NAME: {
        "title": JOINTS_SCHEMA_NAME, **_object(timestamp=_TIME, position_rad=_list(_NUMBER)),
    },
}  # fmt: skip
"""JSON schema of each message, by its name."""


def vector(values: Array) -> Json:
    """x, y and z of an array of shape (3,)."""
    return dict(zip("xyz", _rounded(values), strict=True))


def quaternion(rotation: Array) -> Json:
    """The quaternion of a rotation matrix (3, 3), w not negative."""
    found = Rotation.from_matrix(rotation).as_quat(canonical=True)
    return dict(zip("xyzw", _rounded(found), strict=True))


def pose(position_m: Array, rotation: Array = IDENTITY) -> Json:
    """A pose of position (3,), m, and rotation matrix (3, 3)."""
    return {"position": vector(position_m), "orientation": quaternion(rotation)}


def colour(values: Colour) -> Json:
    """Red, green, blue and opacity."""
    return dict(zip("rgba", values, strict=True))


def solid(position_m: Array, rotation: Array, size_m: Array, look: Colour) -> Json:
    """A box or an ellipsoid by its full sizes along its own axes, m. Shape (3,)."""
    return {"pose": pose(position_m, rotation), "size": vector(size_m), "color": colour(look)}


def cylinder(position_m: Array, rotation: Array, size_m: Array, look: Colour) -> Json:
    """An upright cylinder by its diameters and its height, m. Shape (3,)."""
    return {**solid(position_m, rotation, size_m, look), "bottom_scale": 1.0, "top_scale": 1.0}


def line(points_m: Array, look: Colour, *, width_px: float = 3.0, pairs: bool = False) -> Json:
    """A line through points (n, 3), m; with `pairs`, one between each two of them."""
    return {
        "type": LINE_LIST if pairs else LINE_STRIP,
        "pose": pose(np.zeros(3)),
        "thickness": width_px,
        "scale_invariant": True,
        "points": [vector(point) for point in points_m],
        "color": colour(look),
        "colors": [],
        "indices": [],
    }


def dots(points_m: Array, look: Colour, *, diameter_m: float) -> list[Json]:
    """A sphere at each of some points (n, 3), m."""
    size = np.full(3, diameter_m)
    return [solid(point, IDENTITY, size, look) for point in points_m]


def letters(position_m: Array, text: str, look: Colour) -> Json:
    """Text that always faces the reader."""
    return {
        "pose": pose(position_m),
        "billboard": True,
        "font_size": TEXT_M,
        "scale_invariant": False,
        "color": colour(look),
        "text": text,
    }


def entity(name: str, time_ns: int, *, facts: Sequence[tuple[str, str]] = (), **parts: Any) -> Json:
    """Something that stands in the scene until the next update of its topic.

    Args:
        name: Its name on the topic.
        time_ns: Since when, ns.
        facts: What the viewer says of it when it is clicked: names and values.
        parts: Lists of primitives, by their kind (`cubes`, `lines`, ...).
    """
    return {
        "timestamp": timestamp(time_ns),
        "frame_id": FRAME,
        "id": name,
        "lifetime": {"sec": 0, "nsec": 0},
        "frame_locked": True,
        "metadata": [{"key": key, "value": value} for key, value in facts],
        **{kind: parts.pop(kind, []) for kind in KINDS_OF_PRIMITIVES},
        **parts,
    }


def scene_update(time_ns: int, entities: Sequence[Json]) -> Json:
    """All that stands on a topic from now on; what stood there before is deleted.

    A viewer that jumps to a time asks each topic for its last message only, so every message must
    say all.
    """
    deletion = {"timestamp": timestamp(time_ns), "type": DELETE_ALL, "id": ""}
    return {"deletions": [deletion], "entities": list(entities)}


def transform(time_ns: int, child: str, position_m: Array, rotation: Array) -> Json:
    """Where a frame is in the base frame."""
    return {
        "timestamp": timestamp(time_ns),
        "parent_frame_id": FRAME,
        "child_frame_id": child,
        "translation": vector(position_m),
        "rotation": quaternion(rotation),
    }


def joints(time_ns: int, q_rad: Array) -> Json:
    """Positions of the joints (J,), rad."""
    return {"timestamp": timestamp(time_ns), "position_rad": _rounded(q_rad)}


def log(time_ns: int, level: int, message: str, *, name: str, source: tuple[str, int]) -> Json:
    """A line of the log; `source` is the session and the number of the event there."""
    return {
        "timestamp": timestamp(time_ns),
        "level": level,
        "message": message,
        "name": name,
        "file": source[0],
        "line": source[1],
    }


def _rounded(values: Array) -> list[float]:
    # Adding zero turns a negative zero into one: both are the same place.
    found: list[float] = (np.round(np.asarray(values, dtype=float), DECIMALS) + 0.0).tolist()
    return found
