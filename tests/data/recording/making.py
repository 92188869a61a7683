"""A maker of recordings of which something is wrong, and the refusal they meet."""

import io

import orjson
import pytest
from mcap.writer import CompressionType, Writer

from genpolicy.data.recording.reader import parse_episode
from genpolicy.data.recording.writer import EPISODE_METADATA
from genpolicy.errors import BadInputError

UUID = "00000000-0000-0000-0000-000000000009"


def refused(data, match):
    with pytest.raises(BadInputError, match=match) as caught:
        parse_episode(data, where="bad.mcap")
    assert caught.value.where.startswith("bad.mcap")
    assert caught.value.exit_code == 2
    assert caught.value.action
    return caught.value


class Maker:
    """A hand-made MCAP with one mistake."""

    def __init__(self, *, metadata=True, data_crc=True, crc=True, compression=CompressionType.ZSTD):
        self.sink = io.BytesIO()
        self.writer = Writer(
            self.sink, enable_data_crcs=data_crc, enable_crcs=crc, compression=compression
        )
        self.writer.start()
        if metadata:
            self.writer.add_metadata(EPISODE_METADATA, {"episode_uuid": UUID})

    def channel(self, topic="/robot/gripper", schema="genpolicy.Gripper", encoding="jsonschema"):
        schema_id = self.writer.register_schema(schema, encoding, b"{}")
        return self.writer.register_channel(topic, "json", schema_id)

    def message(self, channel, body=None, *, time=7, log_time=8, sequence=0, raw=None):
        stamp = {"timestamp": {"sec": 0, "nsec": time}}
        data = orjson.dumps({**stamp, **(body or {})}) if raw is None else raw
        self.writer.add_message(channel, log_time, data, time, sequence)
        return self

    def bytes(self):
        self.writer.finish()
        return self.sink.getvalue()
