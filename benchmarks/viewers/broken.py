"""A copy of a file with one schema that a viewer must stop at."""

import json
from pathlib import Path

from mcap.reader import make_reader
from mcap.writer import Writer


def with_a_broken_schema(file: Path, out: Path) -> str:
    """Write a copy in which a field of one channel may be a number or nothing.

    Returns:
        The channel's topic.

    Raises:
        ValueError: No message, or none with a field.
    """
    with file.open("rb") as read, out.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        known: dict[int, int] = {}
        schemas: dict[int, int] = {}
        broken = ""
        for schema, channel, message in make_reader(read).iter_messages():
            if schema is None:
                raise ValueError(f"{channel.topic} has no schema")
            if schema.id not in schemas:
                data = json.loads(schema.data)
                if not broken and data.get("properties"):
                    broken = channel.topic
                    first = next(iter(data["properties"].values()))
                    first["type"] = ["number", "null"]
                schemas[schema.id] = writer.register_schema(
                    schema.name, schema.encoding, json.dumps(data).encode()
                )
            if channel.id not in known:
                known[channel.id] = writer.register_channel(
                    channel.topic, channel.message_encoding, schemas[schema.id]
                )
            writer.add_message(
                known[channel.id], message.log_time, message.data, message.publish_time
            )
        writer.finish()
    if not broken:
        raise ValueError(f"{file} has no schema with a field")
    return broken
