"""Messages that do not match their schema."""

import orjson
import pytest
from making import Maker, refused


def plain(body=None, **options):
    """A recording with one message of plain numbers, which is well formed unless told."""
    maker = Maker()
    channel = maker.channel("/stream/any", "genpolicy.Numbers")
    return maker.message(channel, {"values": [1.0]} if body is None else body, **options).bytes()


def test_unknown_schema_and_topic():
    maker = Maker()
    maker.message(maker.channel(schema="other.Thing"), {"opening_m": 0.0})
    refused(maker.bytes(), "other.Thing")
    maker = Maker()
    maker.message(maker.channel("/camera/image"), {"opening_m": 0.0})
    refused(maker.bytes(), "/camera/image is unknown")
    maker = Maker()
    maker.message(maker.channel(encoding="protobuf"), {"opening_m": 0.0})
    refused(maker.bytes(), "jsonschema")


@pytest.mark.parametrize(
    "raw",
    [b"", b"{", b"[]", b"null", b'{"timestamp": 3}', b"\xff\xfe", b'{"a": NaN}', b"[" * 100_000],
)
def test_not_json(raw):
    refused(plain(raw=raw), "message 0")


@pytest.mark.parametrize(
    "body",
    [{}, {"values": 3.0}, {"values": ["1.0"]}, {"values": [True]}, {"values": {"0": 1.0}}],
)
def test_json_that_does_not_match(body):
    refused(plain(body or {"else": 1}), "message 0 is not a genpolicy.Numbers")


def test_json_of_another_time_frame_or_width():
    body = {"timestamp": {"sec": 0, "nsec": 8}, "values": [1.0]}
    refused(plain(raw=orjson.dumps(body)), "expected the publish time 7 ns")
    maker = Maker()
    channel = maker.channel("/robot/wrench", "genpolicy.Wrench")
    force = {"x": 0.0, "y": 0.0, "z": 0.0}
    maker.message(channel, {"frame_id": "world", "force_n": force})
    refused(maker.bytes(), "robot_base")
    maker = Maker()
    channel = maker.channel("/stream/any", "genpolicy.Numbers")
    maker.message(channel, {"values": [1.0]}, sequence=1)
    maker.message(channel, {"values": [1.0, 2.0]}, sequence=2)
    refused(maker.bytes(), "message 1")


@pytest.mark.parametrize("log_time", [0, 2**63, 2**64 - 1])
def test_impossible_times(log_time):
    refused(plain(log_time=log_time), "message 0: log time")
