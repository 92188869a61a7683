"""Schemas of events: a viewer reads each, and no event that is written contradicts its own."""

import sys
from pathlib import Path

import jsonschema
import pytest

from genpolicy.evidence.shadow.rig import Rig
from genpolicy.execution.event_schemas import NOT_DESCRIBED, event_schema, schema_name
from genpolicy.execution.journal import EVENT_FIELDS

sys.path.insert(0, str(Path(__file__).parents[1]))
from viewer_rules import stops_at

KINDS = sorted(EVENT_FIELDS)


@pytest.mark.parametrize("kind", KINDS)
def test_a_viewer_reads_it_and_it_asks_for_every_field(kind):
    schema = event_schema(kind, EVENT_FIELDS[kind])
    jsonschema.Draft202012Validator.check_schema(schema)
    assert stops_at(schema) == []
    assert schema["required"] == ["session", "n", "t", *EVENT_FIELDS[kind]]
    left_out = {name for own, name in NOT_DESCRIBED if own == kind}
    assert set(schema["properties"]) == set(schema["required"]) - left_out


def test_what_is_not_described_is_a_field_that_there_is():
    assert all(name in EVENT_FIELDS[kind] for kind, name in NOT_DESCRIBED)


def test_events_are_what_their_schemas_say():
    rig = Rig(session="s")
    for _ in range(3):
        rig.run()
    rig.executor.force_event(rig.now_s)
    rig.journal.candidate(
        rig.now_s, chunk_id="x", method="flow", index=0, layers={"fresh": None}, first_reason=None
    )
    rig.journal.conditioning(
        rig.now_s, invocation_id="i", exposed_s=0.0, key=("drawn", 3), history=rig.chunk().actions
    )
    rig.journal.exposure(rig.now_s, rig.chunk().actions[0])
    rig.journal.arrived(rig.now_s, exposed_s=0.0)
    rig.supervisor.emergency_stop(rig.now_s)
    rig.tick(2)
    seen = set()
    for event in rig.end():
        message = {"session": event.session, "n": event.n, "t": event.t, **event.payload}
        jsonschema.Draft202012Validator(
            event_schema(event.kind, EVENT_FIELDS[event.kind])
        ).validate(message)
        seen.add(event.kind)
    assert {"session", "enqueue", "accept", "candidate", "conditioning", "supervisor"} <= seen


def test_one_name_may_hold_another_thing_in_another_kind():
    """Golden: rows of a chunk are counted by what became of them; a history has a number."""
    rows = {kind: event_schema(kind, EVENT_FIELDS[kind])["properties"]["rows"]["type"]
            for kind in ("conditioning", "enqueue", "discard", "finish")}  # fmt: skip
    assert rows == {"conditioning": "integer", "enqueue": "integer", "discard": "object",
                    "finish": "object"}  # fmt: skip


def test_a_field_of_which_nobody_says_what_it_holds_is_refused():
    with pytest.raises(KeyError, match="colour"):
        event_schema("hold", ("reason", "colour"))


def test_names_are_those_of_the_kinds():
    assert schema_name("hold") == "genpolicy.journal.hold"


@pytest.mark.parametrize(
    ("schema", "said"),
    [
        ({"type": "object", "required": ["t"]}, "names no properties"),
        ({"properties": {}}, "is no object"),
        ({"type": ["number", "null"]}, "has the type"),
        ({"enum": [0, 1]}, "has the type None"),
        ({"type": "null"}, "has the type 'null'"),
        ({"type": "array"}, "nothing of its items"),
        ({"type": "array", "items": {"type": "array", "items": {"type": "number"}}}, "no plain"),
        ({"type": "array", "items": {"type": "object"}}, "names no properties"),
        ({"type": "string", "contentEncoding": "hex"}, "encoded as 'hex'"),
    ],
)
def test_the_rules_find_what_a_viewer_stops_at(schema, said):
    """Injected faults: each as a message, or else as its field."""
    whole = schema if "number" not in str(schema.get("type")) and (
        schema.get("type") == "object" or "properties" in schema
    ) else {"type": "object", "properties": {"x": schema}}  # fmt: skip
    [found] = stops_at(whole)
    assert said in found
