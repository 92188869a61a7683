"""The layout that opens a replay: what stands where on a viewer's screen.

A Foxglove or Lichtblick layout as JSON: the cell in 3-D, the log, and over time who commands, the
phase, the age of actions, what latencies are made of, the force and the joints.

Source: the layout files that both write.
"""

from collections.abc import Collection, Iterable
from typing import Any

from genpolicy.contract.latency import Term
from genpolicy.data.recording.wire import FRAME
from genpolicy.replay.timeline import (
    COMMANDED,
    JOINTS_COMMANDED,
    JOINTS_MEASURED,
    LOG,
    PROJECTED,
    RAW,
    REJECTED,
    ROBOT,
    SCENE,
)
from genpolicy.tasks.api import Workspace

Json = dict[str, Any]
Paths = Iterable[tuple[str, str]]
"""Label and path of a message's field, of each line of a plot."""

DRAWN = (SCENE, ROBOT, COMMANDED, RAW, PROJECTED, REJECTED)
AGES = (("age, ns", "/journal/accept.age_ns"), ("age of fallback, ns", "/journal/fallback.age_ns"))
FORCES = (
    ("force, N", "/journal/state.force_n"), ("force, each new peak, N", "/journal/force.force_n"),
)  # fmt: skip
LATENCIES = tuple((f"{term}, s", f"/journal/latency.{term}_s") for term in Term)
STATES = (
    ("who commands", "/journal/mode.new"),
    ("phase", "/journal/phase.new"),
    ("supervisor", "/journal/supervisor.state"),
    ("recovery", "/journal/recovery.new"),
)
DISTANCE_M, BESIDE_DEG = 1.6, 135
"""From the eye to the middle of the workspace, and how far it stands round: facing the arm, which
else hides what it does."""
FRAMES = {"showLabel": False, "axisScale": 0.1}
"""How frames are drawn: as a viewer has it by itself, an arrow is 1 m long and its name hides the
cell."""
LEGEND_PX = 150


def panels(topics: Collection[str], *, joint_count: int, workspace: Workspace) -> Json:
    """The layout of a replay.

    Args:
        topics: All topics of its file; no other is named.
        joint_count: Joints of the arm.
        workspace: What the eye looks at.
    """
    joints = [
        (f"{said} joint {number}, rad", f"{topic}.position_rad[{number}]")
        for topic, said in ((JOINTS_COMMANDED, "commanded"), (JOINTS_MEASURED, "measured"))
        for number in range(joint_count)
    ]
    found = {
        "3D!cell": _cell([topic for topic in DRAWN if topic in topics], workspace),
        "RosOut!log": {"topicToRender": LOG, "minLogLevel": 1, "searchTerms": []},
        "StateTransitions!states": {"paths": _paths(STATES, topics), "isSynced": True},
        "Plot!ages": _plot(AGES, topics),
        "Plot!latency": _plot(LATENCIES, topics),
        "Plot!force": _plot(FORCES, topics),
        "Plot!joints": _plot(joints, topics),
    }
    right = _above(
        "StateTransitions!states",
        _above(
            _above("Plot!ages", "Plot!latency", 50), _above("Plot!force", "Plot!joints", 40), 45
        ),
        20,
    )
    return {
        "configById": found,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": {
            "direction": "row",
            "first": _above("3D!cell", "RosOut!log", 75),
            "second": right,
            "splitPercentage": 60,
        },
    }


def _cell(topics: Iterable[str], workspace: Workspace) -> Json:
    ends = zip(workspace.lower_m, workspace.upper_m, strict=True)
    return {
        "cameraState": {
            "perspective": True, "distance": DISTANCE_M, "phi": 60,
            "thetaOffset": BESIDE_DEG,
            "target": [0, 0, 0], "targetOffset": [(low + high) / 2 for low, high in ends],
            "targetOrientation": [0, 0, 0, 1], "fovy": 45, "near": 0.01, "far": 100,
        },
        "followMode": "follow-none", "followTf": FRAME,
        "scene": {"transforms": FRAMES}, "transforms": {},
        "layers": {}, "publish": {}, "imageMode": {},
        "topics": {topic: {"visible": True} for topic in topics},
    }  # fmt: skip


def _plot(paths: Paths, topics: Collection[str]) -> Json:
    return {
        "paths": _paths(paths, topics),
        "xAxisVal": "timestamp", "isSynced": True, "showLegend": True, "legendDisplay": "left",
        "showXAxisLabels": True, "showYAxisLabels": True, "showPlotValuesInLegend": True,
        "sidebarDimension": LEGEND_PX,
    }  # fmt: skip


def _paths(paths: Paths, topics: Collection[str]) -> list[Json]:
    return [
        {"value": path, "label": label, "enabled": True, "timestampMethod": "receiveTime"}
        for label, path in paths
        if path.partition(".")[0] in topics
    ]


def _above(first: str | Json, second: str | Json, percent: int) -> Json:
    return {
        "direction": "column", "first": first, "second": second, "splitPercentage": percent,
    }  # fmt: skip
