"""The layout: every topic and every field that it names is there, and every panel has a place."""

import json

import pytest
from mcap.reader import make_reader
from replayed import SESSION

from genpolicy.replay.panels import panels
from genpolicy.replay.replay import layout_file, write_replay


@pytest.fixture(scope="module")
def written(journal, tmp_path_factory):
    out = tmp_path_factory.mktemp("panels") / "r.mcap"
    write_replay(journal, out, session=SESSION, task=None)
    return out


@pytest.fixture
def layout(written):
    return json.loads(layout_file(written).read_text())


def schemas(path):
    """Schema of each topic of a file."""
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    return {c.topic: json.loads(summary.schemas[c.schema_id].data)
            for c in summary.channels.values()}  # fmt: skip


def named(layout):
    """Topics, and topics with a field of theirs, that a layout names."""
    configs = layout["configById"].values()
    paths = [path["value"] for config in configs for path in config.get("paths", ())]
    topics = {topic for config in configs for topic in config.get("topics", ())}
    topics |= {config["topicToRender"] for config in configs if "topicToRender" in config}
    fields = [path.partition(".")[::2] for path in paths]
    return topics | {topic for topic, _ in fields}, fields


SHOWS = {"Plot": {"number", "integer"}, "StateTransitions": {"string"}}
"""Types of a field that a panel can show."""


def shown(layout):
    """Panel, topic and field of each path."""
    return [
        (name.partition("!")[0], *path["value"].partition(".")[::2])
        for name, config in layout["configById"].items()
        for path in config.get("paths", ())
    ]


def places(node):
    return [node] if isinstance(node, str) else [*places(node["first"]), *places(node["second"])]


def test_every_topic_that_it_names_is_in_the_file(layout, written):
    topics, _ = named(layout)
    assert topics <= set(schemas(written)) and len(topics) >= 14
    assert {"/replay/raw", "/replay/projected", "/replay/commanded", "/journal/force.".rstrip("."),
            "/replay/joints/commanded"} <= topics  # fmt: skip


def test_every_field_that_it_names_is_one_that_its_panel_can_show(layout, written):
    """A line needs a number; who commands is said in words."""
    known = schemas(written)
    assert len(shown(layout)) >= 20 and {panel for panel, _, _ in shown(layout)} == set(SHOWS)
    for panel, topic, field in shown(layout):
        name, _, index = field.partition("[")
        found = known[topic]["properties"][name]
        kind = found["items"]["type"] if index else found["type"]
        assert kind in SHOWS[panel], (panel, topic, field)


def test_every_panel_has_one_place(layout):
    assert sorted(places(layout["layout"])) == sorted(layout["configById"])
    assert {"configById", "globalVariables", "userNodes", "playbackConfig", "layout"} == set(layout)


def test_what_is_not_in_the_file_is_not_named(task):
    topics, fields = named(panels(["/replay/scene"], joint_count=7, workspace=task.workspace))
    assert topics == {"/replay/scene", "/replay/log"} and fields == []


def test_a_line_for_each_joint_and_the_eye_on_the_middle(layout, task):
    values = [path["value"] for path in layout["configById"]["Plot!joints"]["paths"]]
    assert values[6] == "/replay/joints/commanded.position_rad[6]" and len(values) == 14
    middle = [(a + b) / 2 for a, b in zip(task.workspace.lower_m, task.workspace.upper_m,
                                          strict=True)]  # fmt: skip
    assert layout["configById"]["3D!cell"]["cameraState"]["targetOffset"] == middle


def test_what_frames_are_drawn_with_hides_neither_cell_nor_lines(layout):
    """A viewer by itself draws an arrow of 1 m and a name of .2 m at each frame, in a cell of 1 m;
    a legend that floats lies over the lines."""
    frames = layout["configById"]["3D!cell"]["scene"]["transforms"]
    assert frames["showLabel"] is False and frames["axisScale"] <= 0.2
    plots = [one for name, one in layout["configById"].items() if name.startswith("Plot!")]
    assert len(plots) == 4 and {plot["legendDisplay"] for plot in plots} == {"left"}
