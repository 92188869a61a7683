"""What the viewers are held against: every channel, and a file that they must stop at."""

import json

import pytest
from mcap.reader import make_reader
from mcap.writer import Writer
from viewer_rules import stops_at

from benchmarks.viewers.__main__ import NO_PROBLEM, faults, topics_of
from benchmarks.viewers.broken import with_a_broken_schema
from benchmarks.viewers.foxglove import Seen

PLAIN = {"type": "object", "properties": {"force_n": {"type": "number"}}}


@pytest.fixture
def file(tmp_path):
    out = tmp_path / "watch.mcap"
    with out.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema("state", "jsonschema", json.dumps(PLAIN).encode())
        for topic, count in (("/state", 3), ("/never", 0)):
            channel = writer.register_channel(topic, "json", schema)
            for n in range(count):
                writer.add_message(channel, n, b'{"force_n": 1.5}', n)
        writer.finish()
    return out


def test_the_broken_copy_holds_the_same_and_is_one_that_viewers_stop_at(file, tmp_path):
    out = tmp_path / "broken.mcap"
    assert with_a_broken_schema(file, out) == "/state"
    assert topics_of(file) == {"/state": 3, "/never": 0} and topics_of(out) == {"/state": 3}
    broken = json.loads(json.dumps(PLAIN))
    broken["properties"]["force_n"]["type"] = ["number", "null"]
    with out.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    (schema,) = summary.schemas.values()
    assert json.loads(schema.data) == broken
    assert not stops_at(PLAIN) and stops_at(broken)


def test_a_channel_that_is_not_listed_a_problem_and_a_fault_are_each_told(file):
    good = Seen("/state\nstate\n3", NO_PROBLEM, ("warn: a hint",))
    assert faults(file, good) == []
    assert faults(file, Seen("/other", NO_PROBLEM, ())) == ["not listed: /state"]
    assert faults(file, Seen("/state", "Failed to parse", ())) == ["it lists problems"]
    assert faults(file, Seen("/state", NO_PROBLEM, ("uncaught: x",))) == ["uncaught: x"]
