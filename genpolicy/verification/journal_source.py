"""Reads a journal file event by event, with the MCAP library and nothing of the executor."""

import io
import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from mcap.reader import make_reader
from numpy.typing import NDArray

from genpolicy.errors import BadInputError
from genpolicy.integrity.hashing import sha256_bytes_of

TOPIC = "/journal/"
MAXIMUM_UNCOMPRESSED_BYTES = 8 << 30
MAXIMUM_PIECE_BYTES = 64 << 20  # unpacked at once; a journal's own writer ends one after 1 MiB
Message = dict[str, Any]


def read_messages(path: Path) -> Iterator[tuple[str, Message]]:
    """Kind and message of every event, in the order of the file.

    Raises:
        IntegrityError: No regular file.
        BadInputError: Not a whole MCAP file of JSON objects on journal topics.
    """
    _, data = sha256_bytes_of(path, keep=True)
    try:
        reader = make_reader(io.BytesIO(data), validate_crcs=True)
        summary = reader.get_summary()
        if summary is None or summary.statistics is None:
            raise ValueError("no summary at its end")
        if sum(c.uncompressed_size for c in summary.chunk_indexes) > MAXIMUM_UNCOMPRESSED_BYTES:
            raise ValueError(f"more than {MAXIMUM_UNCOMPRESSED_BYTES} bytes uncompressed")
        if any(c.uncompressed_size > MAXIMUM_PIECE_BYTES for c in summary.chunk_indexes):
            raise ValueError(f"a piece of more than {MAXIMUM_PIECE_BYTES} bytes uncompressed")
        count = 0
        for _, channel, message in reader.iter_messages(log_time_order=False):
            count += 1
            document = json.loads(message.data, parse_constant=_no_constant)
            if not channel.topic.startswith(TOPIC) or not isinstance(document, dict):
                raise ValueError(f"a message on {channel.topic} that is no journal event")
            if not type(document["t"]) is type(document["n"]) is int:
                raise ValueError(f"event {document['n']!r} at {document['t']!r}")
            if message.log_time != max(document["t"], 0):
                raise ValueError(f"log_time {message.log_time} of an event at {document['t']}")
            yield channel.topic[len(TOPIC) :], document
        if count != summary.statistics.message_count:
            raise ValueError(f"{count} messages, {summary.statistics.message_count} announced")
    except Exception as error:  # damaged bytes make the readers below raise almost anything
        raise BadInputError(
            where=str(path),
            found=f"no journal ({type(error).__name__}: {error})",
            expected="a whole MCAP journal",
            action="Re-run the stage that writes it.",
        ) from error


def floats(text: str) -> NDArray[np.float64]:
    """Numbers of a field: little-endian float64, as hex."""
    return np.frombuffer(bytes.fromhex(text), dtype="<f8")


@contextmanager
def readable(where: str) -> Iterator[None]:
    """What is made of events: a field that is missing or of another kind is bad input.

    Raises:
        BadInputError: A field cannot be read.
    """
    try:
        yield
    except (KeyError, IndexError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise BadInputError(
            where=where,
            found=f"an event that cannot be read ({type(error).__name__}: {error})",
            expected="the fields that its kind has",
            action="Re-run the stage that writes it.",
        ) from error


def _no_constant(name: str) -> float:
    raise ValueError(f"a document with {name}")
