"""What the tests of a replay read of a file: every message, and what was added."""

import io
import json

from mcap.reader import make_reader

SESSION = "flow/held_out/0"


def messages_of(data):
    """(schema, channel, message) in the order of the file."""
    reader = make_reader(io.BytesIO(data), validate_crcs=True)
    return list(reader.iter_messages(log_time_order=False))


def added(data):
    """(topic, schema name, log_time, document) of what a replay adds, in the order of the file."""
    return [
        (channel.topic, schema.name, message.log_time, json.loads(message.data))
        for schema, channel, message in messages_of(data)
        if not channel.topic.startswith("/journal/")
    ]


def copied(data, session):
    """All that a message of a session is, in the order of the file."""
    return [
        (channel.topic, channel.message_encoding, dict(channel.metadata), schema.name,
         schema.encoding, schema.data, message.log_time, message.publish_time, message.sequence,
         message.data)
        for schema, channel, message in messages_of(data)
        if channel.topic.startswith("/journal/") and json.loads(message.data)["session"] == session
    ]  # fmt: skip


def entities(document):
    return {entity["id"]: entity for entity in document["entities"]}
