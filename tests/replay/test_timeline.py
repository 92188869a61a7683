"""The timeline: every topic whole at every time, with places and reasons of the journal."""

import json
from collections import Counter
from types import SimpleNamespace

import jsonschema
import numpy as np
import pytest
from replayed import SESSION, entities

from genpolicy.contract.action import POSITION
from genpolicy.execution.journal import Event, decode_actions, encode_actions, read_journal
from genpolicy.replay.journal_file import read_session
from genpolicy.replay.messages import SCENE_SCHEMA_NAME, SCHEMAS
from genpolicy.replay.proposals import Proposals
from genpolicy.replay.timeline import (
    COMMANDED,
    JOINTS_COMMANDED,
    JOINTS_MEASURED,
    LOG,
    PATH_POINTS,
    PROJECTED,
    RAW,
    REJECTED,
    ROBOT,
    SCENE,
    TRANSFORMS,
    Timeline,
)

HELD = {"method": "flow", "fixture": "held_out", "observation": "0"}


def timeline(cell, proposals=None, session=SESSION):
    return Timeline(cell, proposals or SimpleNamespace(rejected=lambda _: None), session)


@pytest.fixture(scope="session")
def events(journal):
    return read_journal(journal)[SESSION]


@pytest.fixture(scope="session")
def shown(journal, ladder, cell):
    found = read_session(journal, SESSION)
    proposals = Proposals(ladder / "shadow", HELD)
    return list(timeline(cell, proposals).messages(item.event for item in found.events))


def last(shown, topic):
    return [item for item in shown if item.topic == topic][-1].content


def event(kind, t_ns, n=0, **payload):
    return Event("s", n, kind, t_ns, payload)


def accept(t_ns, position, row=0):
    action = np.array([[*position, 1.0, 0, 0, 0, -1.0, 0, 0.01]])
    return event("accept", t_ns, arrival=0, chunk_id="c", row=row, age_ns=50_000_000,
                 action=encode_actions(action))  # fmt: skip


def test_every_message_is_valid_json_of_its_schema(shown):
    validators = {name: jsonschema.Draft202012Validator(schema) for name, schema in SCHEMAS.items()}
    assert {item.topic for item in shown} == {
        SCENE, ROBOT, COMMANDED, RAW, PROJECTED, REJECTED, TRANSFORMS, LOG,
        JOINTS_COMMANDED, JOINTS_MEASURED,
    }  # fmt: skip
    for item in shown:
        document = json.loads(json.dumps(item.content, allow_nan=False))
        validators[item.schema].validate(document)
        stamps = [document.get("timestamp")]
        stamps += [part["timestamp"] for kind in document.values() if isinstance(kind, list)
                   for part in kind if isinstance(part, dict)]  # fmt: skip
        for stamp in filter(None, stamps):
            assert stamp["sec"] * 10**9 + stamp["nsec"] == item.time_ns


def test_times_are_those_of_the_journal_and_a_topic_speaks_once_for_each(shown, events):
    assert {item.time_ns for item in shown} <= {event.t for event in events}
    assert [item.time_ns for item in shown] == sorted(item.time_ns for item in shown)
    often = Counter((item.topic, item.time_ns) for item in shown if item.topic != LOG)
    assert set(often.values()) == {1}


def test_every_update_says_all_that_stands(shown):
    for item in shown:
        if item.schema == SCENE_SCHEMA_NAME:
            assert [deletion["type"] for deletion in item.content["deletions"]] == [1]
            ids = [entity["id"] for entity in item.content["entities"]]
            assert len(ids) == len(set(ids))


def test_the_scene_has_every_shape_and_the_workspace(shown, cell):
    names = {name.split()[-1] for name in entities(last(shown, SCENE))}
    assert names == {"workspace", *(shape.name for shape in cell.collision.shapes.scene)}


def test_the_command_stands_at_the_accepted_action(shown, events):
    accepted = [item for item in events if item.kind == "accept"]
    assert len(accepted) >= 3
    updates = [item for item in shown if item.topic == COMMANDED]
    frames = [item for item in shown if item.topic == TRANSFORMS]
    assert len(updates) == len(frames) == len(accepted)
    for told, update, frame in zip(accepted, updates, frames, strict=True):
        position = decode_actions(told.payload["action"])[0, POSITION]
        own = entities(update.content)["commanded"]
        place = own["spheres"][0]["pose"]["position"]
        np.testing.assert_allclose([place[axis] for axis in "xyz"], position, atol=1e-6)
        moved = frame.content["translation"]
        np.testing.assert_allclose([moved[axis] for axis in "xyz"], position, atol=1e-6)
        assert f"row {told.payload['row']}" in own["texts"][0]["text"]
        assert f"age {told.payload['age_ns'] / 1e6:.0f} ms" in own["texts"][0]["text"]
        assert update.time_ns == frame.time_ns == told.t


def test_the_arm_holds_the_tool_where_it_was_commanded(shown, events, cell):
    """Property: kinematics of the drawn joints end at the accepted action."""
    of_robot = {item.time_ns: item.content for item in shown if item.topic == ROBOT}
    enqueued = next(item.payload for item in events if item.kind == "enqueue")
    motion, first = enqueued["motion"], enqueued["checked_rows"][0]
    joints = np.frombuffer(bytes.fromhex(motion["q_rad"])).reshape(-1, motion["joints"])
    for told in (item for item in events if item.kind == "accept"):
        placed = cell.robot(joints[told.payload["row"] - first], 0.01)
        hand = next(place for shape, _, place in placed if shape.name == "hand")
        drawn = next(e for name, e in entities(of_robot[told.t]).items() if name.endswith("hand"))
        at = drawn["cubes"][0]["pose"]["position"]
        np.testing.assert_allclose([at[axis] for axis in "xyz"], hand, atol=1e-6)
        position, _ = cell.collision.kinematics.forward(joints[told.payload["row"] - first])
        commanded = decode_actions(told.payload["action"])[0, POSITION]
        np.testing.assert_allclose(position, commanded, atol=1e-3)


def test_the_proposed_chunk_is_a_line_through_all_its_actions(shown, events):
    enqueued = next(item.payload for item in events if item.kind == "enqueue")
    own = entities(last(shown, PROJECTED))["projected"]
    points = [[point[axis] for axis in "xyz"] for point in own["lines"][0]["points"]]
    np.testing.assert_allclose(points, decode_actions(enqueued["actions"])[:, POSITION], atol=1e-6)
    assert {"key": "chunk_id", "value": enqueued["chunk_id"]} in own["metadata"]


def test_the_chunk_as_sampled_stands_beside_the_projected_one_and_says_how_far_it_was_moved(
    cell, events
):
    """Property: where the journal keeps no other actions, they are those that were admitted."""
    enqueued = next(item for item in events if item.kind == "enqueue")
    admitted = decode_actions(enqueued.payload["actions"])
    moved = np.array(admitted)
    moved[3, 1] += 0.002
    for raw, expected, said in (
        ("", admitted, "at most 0.00 mm"), (encode_actions(moved), moved, "at most 2.00 mm"),
    ):  # fmt: skip
        told = event("enqueue", 5, **{**enqueued.payload, "raw": raw})
        shown = list(timeline(cell).messages([told]))
        own = entities(last(shown, RAW))["raw"]
        points = [[point[axis] for axis in "xyz"] for point in own["lines"][0]["points"]]
        np.testing.assert_allclose(points, expected[:, POSITION], atol=1e-6)
        assert {"key": "moved by projection", "value": said} in own["metadata"]
        other = entities(last(shown, PROJECTED))["projected"]
        assert own["lines"][0]["color"] != other["lines"][0]["color"]


def test_joints_are_those_that_were_commanded_and_those_that_were_measured(shown, events):
    enqueued = [item for item in events if item.kind == "enqueue"]
    measured = [item for item in shown if item.topic == JOINTS_MEASURED]
    assert len(measured) == len(enqueued) >= 1
    for told, item in zip(enqueued, measured, strict=True):
        expected = np.frombuffer(bytes.fromhex(told.payload["motion"]["q_meas_rad"]))
        np.testing.assert_allclose(item.content["position_rad"], expected[-7:], atol=1e-6)
    motion, first = enqueued[0].payload["motion"], enqueued[0].payload["checked_rows"][0]
    joints = np.frombuffer(bytes.fromhex(motion["q_rad"])).reshape(-1, motion["joints"])
    commanded = {item.time_ns: item.content for item in shown if item.topic == JOINTS_COMMANDED}
    accepted = [item for item in events if item.kind == "accept"]
    assert set(commanded) == {item.t for item in accepted}
    for told in accepted:
        found = commanded[told.t]["position_rad"]
        np.testing.assert_allclose(found, joints[told.payload["row"] - first], atol=1e-6)


def test_rejected_proposals_bear_another_colour_the_action_and_the_reason(shown, events):
    payloads = [item.payload for item in events if item.kind == "candidate"]
    rejected = [payload for payload in payloads if payload["first_reason"]]
    found = entities(last(shown, REJECTED))
    assert len(found) == len(rejected) >= 3
    blue = entities(last(shown, PROJECTED))["projected"]["lines"][0]["color"]
    for payload, own in zip(rejected, found.values(), strict=True):
        assert payload["first_reason"].replace("_", " ") in own["texts"][0]["text"]
        assert f"action {payload['measures']['first_row']}" in own["texts"][0]["text"]
        assert len(own["lines"]) == 2 and all(item["color"] != blue for item in own["lines"])


def test_the_offending_action_is_marked_with_the_tool_there(shown, ladder, events, cell):
    proposals = Proposals(ladder / "shadow", HELD)
    marked = 0
    for payload in (item.payload for item in events if item.kind == "candidate"):
        told = proposals.rejected(payload)
        if told is None:
            continue
        own = next(e for name, e in entities(last(shown, REJECTED)).items()
                   if name.endswith(f"candidate {told.index}"))  # fmt: skip
        place = told.judged[told.row, POSITION]
        if not np.all(np.isfinite(place)):
            assert not own["cubes"]  # a tool that has no place is not drawn
            continue
        marked += 1
        spheres = [[s["pose"]["position"][axis] for axis in "xyz"] for s in own["spheres"]
                   if s["size"]["x"] > 0.01 and s["color"]["r"] > 0.8]  # fmt: skip
        assert any(np.allclose(at, place, atol=1e-6) for at in spheres)
        assert len(own["cubes"]) >= len([s for s in cell.collision.shapes.robot if s.tool]) - 1
    assert marked >= 2


def test_what_touches_is_red_on_both_sides(shown, ladder, events):
    proposals = Proposals(ladder / "shadow", HELD)
    told = next(
        item
        for item in map(proposals.rejected, (e.payload for e in events if e.kind == "candidate"))
        if item is not None and item.touching
    )
    own = next(e for name, e in entities(last(shown, REJECTED)).items()
               if name.endswith(f"candidate {told.index}"))  # fmt: skip
    red = [item for kind in ("cubes", "cylinders") for item in own[kind] if item["color"]["a"] == 1]
    assert len(red) == 2


def test_without_actions_the_reason_stands_at_the_last_command(cell):
    told = SimpleNamespace(index=1, layer="geometric", reason="scene_collision", row=None,
                           margin=None, unit="", raw=None, projected=None, judged=None,
                           touching=(), said="geometric: scene collision")  # fmt: skip
    found = list(
        timeline(cell, SimpleNamespace(rejected=lambda _: told)).messages(
            [accept(0, (0.5, 0.1, 0.2)),
             event("candidate", 50_000_000, 1, chunk_id="c", index=1,
                   first_reason="scene_collision")]
        )
    )  # fmt: skip
    [own] = entities(last(found, REJECTED)).values()
    at = own["texts"][0]["pose"]["position"]
    assert (at["x"], at["y"]) == (0.5, 0.1) and 0.2 < at["z"] < 0.3
    assert own["texts"][0]["text"] == "geometric: scene collision" and own["lines"] == []


def test_rejected_proposals_are_gone_with_the_next_verdict(cell):
    told = SimpleNamespace(index=0, layer="x", reason="r", row=None, margin=None, unit="", raw=None,
                           projected=None, judged=None, touching=(), said="x: r")  # fmt: skip
    bad = SimpleNamespace(rejected=lambda payload: told if payload["first_reason"] else None)
    candidates = [
        event("candidate", t, n, chunk_id=str(n), index=0, first_reason=reason)
        for n, (t, reason) in enumerate([(0, "r"), (0, "r"), (50, "r"), (100, None)])
    ]
    found = timeline(cell, bad).messages(candidates)
    counts = [len(item.content["entities"]) for item in found if item.topic == REJECTED]
    assert counts == [2, 1, 0]


def test_a_scene_that_stands_still_is_said_once_and_one_that_moves_again(cell):
    body = cell.obstacles[0]
    here, there = (
        {body: np.array([x, 0.0, 0.11, 1, 0, 0, 0]).astype("<f8").tobytes().hex()}
        for x in (0.5, 0.45)
    )
    told = [event("scene", t, bodies=bodies) for t, bodies in ((0, here), (5, here), (9, there))]
    found = [item for item in timeline(cell).messages(told) if item.topic == SCENE]
    assert [item.time_ns for item in found] == [0, 9]
    places = [
        next(e for name, e in entities(item.content).items() if name.endswith(body))
        for item in found
    ]
    assert [e["cylinders"][0]["pose"]["position"]["x"] for e in places] == [0.5, 0.45]


def test_a_hold_is_said_once_for_each_reason(cell):
    told = [
        event("hold", 0, 0, reason="empty"), event("hold", 5, 1, reason="empty"),
        event("hold", 9, 2, reason="watchdog"), accept(12, (0.5, 0, 0.1)),
        event("hold", 15, 4, reason="watchdog"),
    ]  # fmt: skip
    found = [item.content for item in timeline(cell).messages(told) if item.topic == LOG]
    assert [(line["message"], line["file"], line["line"]) for line in found] == [
        ("hold: empty", SESSION, 0), ("hold: watchdog", SESSION, 2), ("hold: watchdog", SESSION, 4),
    ]  # fmt: skip


def test_the_path_is_cut_at_its_oldest_end(cell):
    told = [accept(t, (0.4 + 1e-3 * t, 0.0, 0.1)) for t in range(PATH_POINTS + 5)]
    points = entities(last(list(timeline(cell).messages(told)), COMMANDED))["path"]["lines"][0]
    assert len(points["points"]) == PATH_POINTS
    assert points["points"][-1]["x"] == pytest.approx(0.4 + 1e-3 * (PATH_POINTS + 4))
    assert points["points"][0]["x"] == pytest.approx(0.4 + 1e-3 * 5)


def test_chunks_of_the_fallback_have_their_own_colour(shown, events, cell):
    enqueued = next(item for item in events if item.kind == "enqueue")
    other = Event("s", 0, "enqueue", 0, {**enqueued.payload, "source": "fallback"})
    found = list(timeline(cell).messages([other]))
    colours = [
        entities(last(items, PROJECTED))["projected"]["lines"][0]["color"]
        for items in (shown, found)
    ]
    assert colours[0] != colours[1]
    assert any(item.topic == ROBOT for item in found)  # where it was measured, before any command
