"""A replay for Rerun: the same messages as for Foxglove, logged as Rerun's own shapes.

Rerun is an extra of half a gigabyte, so it is imported when it is asked for. Its file holds random
row numbers: unlike a replay, two exports of one rollout are not equal byte for byte.
"""

import importlib
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

from genpolicy.contract.latency import Term
from genpolicy.errors import ConfigError
from genpolicy.execution.nanoseconds import NS_PER_S
from genpolicy.integrity.atomic import write_bytes
from genpolicy.replay.bodies import DrawnCell
from genpolicy.replay.journal_file import Drawn, read_session
from genpolicy.replay.messages import (
    JOINTS_SCHEMA_NAME,
    LINE_STRIP,
    SCENE_SCHEMA_NAME,
    TRANSFORM_SCHEMA_NAME,
    WARNING,
    Json,
)
from genpolicy.replay.proposals import Proposals
from genpolicy.replay.replay import task_of
from genpolicy.replay.timeline import Timeline
from genpolicy.tasks.api import load_task
from genpolicy.verification.journal_source import readable

CLOCK = "session"
SOLIDS = ("cubes", "spheres", "cylinders")
MEASURED: Mapping[str, tuple[tuple[str, float], ...]] = {
    "force": (("force_n", 1.0),),
    "state": (("force_n", 1.0),),
    "accept": (("age_ns", 1 / NS_PER_S),),
    "latency": tuple((f"{term}_s", 1.0) for term in Term),
}
"""Kinds of events with numbers that are drawn over time: each field, and what it is multiplied by
(force in N, times in s)."""


def write_rerun(journal: Path, out: Path, *, session: str, task: str | None) -> dict[str, int]:
    """Write one session of a journal as a Rerun recording; the journal is only read.

    Args:
        journal: The journal.
        out: The `.rrd` file to write, whole or not at all.
        session: Name of the session.
        task: Name of the task; None: that of the ladder in which the journal lies.

    Returns:
        Messages of each place in the recording.

    Raises:
        ConfigError: Rerun is not installed, or no such task.
        BadInputError: Not a whole journal of this version, no such session, or an unwritable place.
        IntegrityError: Journal and tables are not of one run.
    """
    rerun = _rerun()
    found = read_session(journal, session)
    cell = DrawnCell.of(load_task(task or task_of(journal)))
    stream = rerun.RecordingStream("genpolicy", recording_id=session, send_properties=False)
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    held = stream.memory_recording()
    counts: dict[str, int] = {}
    with readable(f"{journal}: session {found.session}"):
        proposals = Proposals(journal.parent, found.events[0].event.payload["labels"])
        timeline = Timeline(cell, proposals, found.session)
        for item in timeline.messages(one.event for one in found.events):
            stream.set_time(CLOCK, duration=item.time_ns / NS_PER_S)
            for place, shape in _shapes(rerun, item):
                stream.log(place, shape)
            counts[item.topic] = counts.get(item.topic, 0) + 1
        for one in found.events:
            for name, times in MEASURED.get(one.event.kind, ()):
                stream.set_time(CLOCK, duration=max(one.event.t, 0) / NS_PER_S)
                place = f"/journal/{one.event.kind}/{name.rpartition('_')[0]}"
                stream.log(place, rerun.Scalars(float(one.event.payload[name]) * times))
                counts[place] = counts.get(place, 0) + 1
    write_bytes(out, held.drain_as_bytes())
    return dict(sorted(counts.items()))


def _rerun() -> ModuleType:
    """The library.

    Raises:
        ConfigError: It is not installed.
    """
    os.environ.setdefault("RERUN_ANALYTICS", "0")  # nothing is told to anybody
    try:
        return importlib.import_module("rerun")
    except ImportError as error:
        raise ConfigError(
            where="--to rerun",
            found="without the library rerun-sdk",
            expected="the library of the extra rerun (half a gigabyte)",
            action="Install it: pip install 'genpolicy[rerun]', or take --to foxglove.",
        ) from error


def _shapes(rerun: ModuleType, item: Drawn) -> Iterable[tuple[str, Any]]:
    """Where and what a message is in Rerun."""
    content = item.content
    if item.schema == SCENE_SCHEMA_NAME:
        yield item.topic, rerun.Clear(recursive=True)
        for entity in content["entities"]:
            yield from _entity(rerun, f"{item.topic}/{_safe(entity['id'])}", entity)
    elif item.schema == TRANSFORM_SCHEMA_NAME:
        yield (
            f"{item.topic}/{content['child_frame_id']}",
            rerun.Transform3D(
                translation=_xyz(content["translation"]),
                quaternion=rerun.Quaternion(xyzw=_xyzw(content["rotation"])),
            ),
        )
    elif item.schema == JOINTS_SCHEMA_NAME:
        yield item.topic, rerun.Scalars(content["position_rad"])
    else:
        level = "INFO" if content["level"] < WARNING else "WARN"
        yield item.topic, rerun.TextLog(content["message"], level=level)


def _entity(rerun: ModuleType, place: str, entity: Json) -> Iterable[tuple[str, Any]]:
    for kind in SOLIDS:
        if entity[kind]:
            yield f"{place}/{kind}", _solids(rerun, kind, entity[kind])
    if entity["lines"]:
        yield (
            f"{place}/lines",
            rerun.LineStrips3D(
                [strip for line in entity["lines"] for strip in _strips(line)],
                colors=[_rgba(line["color"]) for line in entity["lines"] for _ in _strips(line)],
            ),
        )
    if entity["texts"]:
        yield (
            f"{place}/texts",
            rerun.Points3D(
                [_xyz(text["pose"]["position"]) for text in entity["texts"]],
                labels=[text["text"] for text in entity["texts"]],
                colors=[_rgba(text["color"]) for text in entity["texts"]],
                radii=0.001,
            ),
        )


def _solids(rerun: ModuleType, kind: str, parts: Sequence[Json]) -> Any:
    common = {
        "centers": [_xyz(part["pose"]["position"]) for part in parts],
        "quaternions": [
            rerun.Quaternion(xyzw=_xyzw(part["pose"]["orientation"])) for part in parts
        ],
        "colors": [_rgba(part["color"]) for part in parts],
        "fill_mode": "solid",
    }
    halves = [[size / 2 for size in _xyz(part["size"])] for part in parts]
    if kind == "cylinders":
        return rerun.Cylinders3D(
            lengths=[2 * half[2] for half in halves], radii=[half[0] for half in halves], **common
        )
    shape = rerun.Boxes3D if kind == "cubes" else rerun.Ellipsoids3D
    return shape(half_sizes=halves, **common)


def _strips(line: Json) -> list[list[list[float]]]:
    """The strips of a line: one, or one between each two points."""
    points = [_xyz(point) for point in line["points"]]
    if line["type"] == LINE_STRIP:
        return [points] if len(points) > 1 else []
    return [points[first : first + 2] for first in range(0, len(points), 2)]


def _xyz(of: Mapping[str, float]) -> list[float]:
    return [of[axis] for axis in "xyz"]


def _xyzw(of: Mapping[str, float]) -> list[float]:
    return [of[axis] for axis in "xyzw"]


def _rgba(of: Mapping[str, float]) -> list[int]:
    return [round(255 * of[part]) for part in "rgba"]


def _safe(name: str) -> str:
    """A name as one part of a path."""
    return "".join(sign if sign.isalnum() else "_" for sign in name)
