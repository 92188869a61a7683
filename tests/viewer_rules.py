"""What a public viewer reads of a JSON schema, and what it stops at.

The rules of the reader that Foxglove published last and Lichtblick's, read in their sources and
said in our words: a message is an object that names its `properties`; each field has one plain
type, by its name; a text is plain or base64; an array says what its items are, and they are no
arrays. What they add (several numbers of one name, `oneOf`) only one of both reads.
"""

import io
import json

from mcap.reader import make_reader

PLAIN = {"boolean", "string", "number", "integer"}


def stops_at(schema, where="message"):
    """Places of a schema at which the viewer stops; empty where it reads all of it."""
    if schema.get("type") != "object":
        return [f"{where} is no object"]
    fields = schema.get("properties")
    if not isinstance(fields, dict):
        return [f"{where} names no properties"]
    return [found for name, field in fields.items() for found in _field(field, f"{where}.{name}")]


def _field(field, where):
    kind = field.get("type")
    if not isinstance(kind, str):
        return [f"{where} has the type {kind!r}"]
    if kind == "object":
        return stops_at(field, where)
    if kind == "array":
        items = field.get("items")
        if not isinstance(items, dict):
            return [f"{where} says nothing of its items"]
        if items.get("type") == "array" or "contentEncoding" in items:
            return [f"{where} has items of no plain type"]
        return _field(items, f"{where}[]")
    if kind not in PLAIN:
        return [f"{where} has the type {kind!r}"]
    if kind == "string" and field.get("contentEncoding") not in (None, "base64"):
        return [f"{where} is encoded as {field['contentEncoding']!r}"]
    return []


def channels(data):
    """(topic, message encoding, schema encoding, schema) of every channel of an MCAP file."""
    summary = make_reader(io.BytesIO(data), validate_crcs=True).get_summary()
    for channel in summary.channels.values():
        schema = summary.schemas[channel.schema_id]
        yield channel.topic, channel.message_encoding, schema.encoding, json.loads(schema.data)


def unread(data):
    """Topics of an MCAP file that the viewer does not read, with why; and how many it reads."""
    found, read = {}, 0
    for topic, messages, encoding, schema in channels(data):
        stops = stops_at(schema)
        if (messages, encoding) != ("json", "jsonschema"):
            stops = [f"{messages} by {encoding}", *stops]
        read += not stops
        if stops:
            found[topic] = stops
    return found, read
