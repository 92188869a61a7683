"""A stand-in for the library of Rerun: the calls that an export makes, as they were recorded.

The real library is half a gigabyte, an extra that no continuous run installs. `RECORDED` holds the
parameters of each call as release 0.41.0 has them; a call that does not fit them is an error
here as there, and where the library is installed a test holds `RECORDED` against it.
"""

import inspect
import json
from types import ModuleType, SimpleNamespace
from typing import Any

RECORDED: dict[str, str] = {
    "RecordingStream": (
        "application_id, *, recording_id=, make_default=, make_thread_default=, "
        "default_enabled=, send_properties=, batcher_config="
    ),
    "RecordingStream.set_log_time_enabled": "enabled",
    "RecordingStream.set_log_tick_enabled": "enabled",
    "RecordingStream.memory_recording": "",
    "RecordingStream.set_time": "timeline, *, sequence=, duration=, timestamp=",
    "RecordingStream.log": "entity_path, entity, *extra, static=, strict=",
    "Clear": "*, recursive",
    "Transform3D": (
        "*, translation=, rotation=, rotation_axis_angle=, quaternion=, scale=, mat3x3=, "
        "from_parent=, relation=, child_frame=, parent_frame="
    ),
    "Quaternion": "*, xyzw",
    "Scalars": "scalars",
    "TextLog": "text, *, level=, color=",
    "LineStrips3D": "strips, *, radii=, colors=, labels=, show_labels=, class_ids=",
    "Points3D": (
        "positions, *, radii=, colors=, labels=, show_labels=, point_shading=, "
        "class_ids=, keypoint_ids="
    ),
    "Boxes3D": (
        "*, sizes=, mins=, half_sizes=, centers=, rotation_axis_angles=, quaternions=, "
        "rotations=, colors=, radii=, fill_mode=, labels=, show_labels=, class_ids="
    ),
    "Ellipsoids3D": (
        "*, half_sizes=, radii=, centers=, rotation_axis_angles=, quaternions=, colors=, "
        "line_radii=, fill_mode=, labels=, show_labels=, class_ids="
    ),
    "Cylinders3D": (
        "*, lengths=, radii=, centers=, rotation_axis_angles=, quaternions=, colors=, "
        "line_radii=, fill_mode=, labels=, show_labels=, class_ids="
    ),
}
"""Names of parameters by call; `=` behind what may be left out."""
EACH = {
    "LineStrips3D": ("strips", "colors"),
    "Points3D": ("positions", "labels", "colors"),
    "Boxes3D": ("half_sizes", "centers", "quaternions", "colors"),
    "Ellipsoids3D": ("half_sizes", "centers", "quaternions", "colors"),
    "Cylinders3D": ("lengths", "radii", "centers", "quaternions", "colors"),
}
"""Of a shape of several parts, what has one entry a part; the viewer would repeat the last."""


def parameters_of(function: Any) -> str:
    """The parameters of a call, without `self`, as `RECORDED` writes them."""
    names, keyword_only = [], False
    for one in inspect.signature(function).parameters.values():
        if one.name == "self":
            continue
        if one.kind is one.KEYWORD_ONLY and not keyword_only:
            names += ["*"]
        keyword_only = keyword_only or one.kind in (one.KEYWORD_ONLY, one.VAR_POSITIONAL)
        star = "*" if one.kind is one.VAR_POSITIONAL else ""
        names.append(f"{star}{one.name}{'' if one.default is one.empty else '='}")
    return ", ".join(names)


def bound(call: str, *args: Any, **kwargs: Any) -> dict[str, Any]:
    """Arguments of a recorded call by name.

    Raises:
        TypeError: It has no such parameter.
    """
    scope: dict[str, Any] = {}
    exec(f"def call({RECORDED[call].replace('=', '=None')}): ...", scope)
    return inspect.signature(scope["call"]).bind(*args, **kwargs).arguments


class Library(ModuleType):
    """The module `rerun`, of which every recording that was drained is kept.

    Attributes:
        logged: Per drained recording its name, and of each message time, place, shape and fields.
    """

    def __init__(self) -> None:
        super().__init__("rerun")
        self.logged: list[tuple[str, list[tuple[float, str, str, dict[str, Any]]]]] = []
        for name in RECORDED:
            if name != "RecordingStream" and "." not in name:
                setattr(self, name, self._shape(name))

    @staticmethod
    def _shape(name: str) -> Any:
        def made(*args: Any, **kwargs: Any) -> SimpleNamespace:
            fields = bound(name, *args, **kwargs)
            assert len({len(fields[each]) for each in EACH.get(name, ())}) <= 1, (name, fields)
            return SimpleNamespace(kind=name, fields=fields)

        return made

    def RecordingStream(self, *args: Any, **kwargs: Any) -> "Stream":
        """A stream, that writes into this library."""
        return Stream(self, bound("RecordingStream", *args, **kwargs))


class Stream:
    """A recording that is being made: every call must be a recorded one."""

    def __init__(self, library: Library, made: dict[str, Any]) -> None:
        self._library, self._name, self._now = library, made["recording_id"], None
        self._messages: list[tuple[float, str, str, dict[str, Any]]] = []
        self.clocks: dict[str, bool] = {}

    def __getattr__(self, name: str) -> Any:
        call = f"RecordingStream.{name}"
        return lambda *args, **kwargs: self._called(name, bound(call, *args, **kwargs))

    def _called(self, name: str, fields: dict[str, Any]) -> Any:
        if name == "set_time":
            self._now = fields["timeline"], fields["duration"]
        elif name == "log":
            assert self._now is not None, "a message without a time stands at the wall clock's"
            shape = fields["entity"]
            message = (self._now[1], fields["entity_path"], shape.kind, shape.fields)
            self._messages.append(message)
        elif name == "memory_recording":
            return SimpleNamespace(drain_as_bytes=self._drained)
        else:
            self.clocks[name] = fields["enabled"]
        return None

    def _drained(self) -> bytes:
        assert set(self.clocks.values()) == {False}, "times of the export are no times of a rollout"
        self._library.logged.append((self._name, self._messages))
        return json.dumps([len(self._messages), self._name]).encode()
