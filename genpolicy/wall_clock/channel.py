"""Frames over a pipe, read by somebody who must never wait, fail or grow for the sake of a sender.

A frame is a magic word, the length and the CRC-32 of its payload (little-endian, 4 bytes each),
and the payload. What is no frame is skipped and counted; a sender that floods fills its own pipe.
"""

import os
import struct
import zlib
from collections import Counter

MAGIC = b"GPW1"
HEADER = struct.Struct("<4sII")
MAXIMUM_PAYLOAD_BYTES = 128 << 10
"""An answer of 512 rows is under 90 kB of hex; the default chunk of 16 rows is 2.6 kB."""
READ_BYTES = 64 << 10
MOST_FRAMES = 64
"""Of one reading, whole ones and what only began like one; the rest waits in the pipe."""


def frame(payload: bytes) -> bytes:
    """The bytes of a frame."""
    return HEADER.pack(MAGIC, len(payload), zlib.crc32(payload)) + payload


class Inbox:
    """Frames that arrive at a descriptor, from a sender who may do anything.

    Args:
        descriptor: Read end of a pipe; it is made non-blocking.

    Attributes:
        closed: Nobody can send any more.
        dropped: What was no frame: `garbage_bytes` before a magic word, `oversize` frames,
            `damaged` ones (another CRC), `truncated` ones at the end.
    """

    def __init__(self, descriptor: int) -> None:
        os.set_blocking(descriptor, False)
        self.descriptor = descriptor
        self.closed = False
        self.dropped: Counter[str] = Counter()
        self._buffer = bytearray()

    def read(self) -> list[bytes]:
        """Payloads that are whole now; never waits, never raises, at most `MOST_FRAMES`."""
        if not self.closed and len(self._buffer) < HEADER.size + MAXIMUM_PAYLOAD_BYTES:
            self._receive()
        found: list[bytes] = []
        for _ in range(MOST_FRAMES):
            if not self._seek():
                break
            _, length, crc = HEADER.unpack_from(self._buffer)
            end = HEADER.size + length
            if length > MAXIMUM_PAYLOAD_BYTES:
                self._skip("oversize")
            elif len(self._buffer) < end:
                break
            elif zlib.crc32(payload := bytes(self._buffer[HEADER.size : end])) != crc:
                self._skip("damaged")
            else:
                del self._buffer[:end]
                found.append(payload)
        else:
            return found  # there may be more
        if self.closed and self._buffer:
            self.dropped["truncated"] += 1
            self._buffer.clear()
        return found

    def _receive(self) -> None:
        try:
            data = os.read(self.descriptor, READ_BYTES)
        except (BlockingIOError, InterruptedError):
            return
        except OSError:
            data = b""
        self.closed = not data
        self._buffer += data

    def _seek(self) -> bool:
        """Move to the next magic word. Returns whether a whole header stands there."""
        at = self._buffer.find(MAGIC)
        if at < 0:  # its beginning may be the last thing that came
            at = max(0, len(self._buffer) - len(MAGIC) + 1)
            while at < len(self._buffer) and not MAGIC.startswith(self._buffer[at:]):
                at += 1
        self.dropped["garbage_bytes"] += at
        del self._buffer[:at]
        return len(self._buffer) >= HEADER.size

    def _skip(self, why: str) -> None:
        """Not this one: look for the next magic word, which may stand inside of it."""
        self.dropped[why] += 1
        del self._buffer[: len(MAGIC)]


class Outbox:
    """Frames to somebody who may have stopped reading.

    Args:
        descriptor: Write end of a pipe; it is made non-blocking.

    Attributes:
        closed: Nobody reads any more.
    """

    def __init__(self, descriptor: int) -> None:
        os.set_blocking(descriptor, False)
        self.closed = False
        self._descriptor = descriptor
        self._pending = b""
        self._shut = False

    def send(self, payload: bytes) -> bool:
        """Whether a frame was taken; not while an earlier one waits, and never waited for."""
        self.flush()
        if self._pending or self.closed:
            return False
        self._pending = frame(payload)
        self.flush()
        return not self.closed

    def flush(self) -> None:
        """Write what the pipe takes now."""
        try:
            while self._pending:
                self._pending = self._pending[os.write(self._descriptor, self._pending) :]
        except (BlockingIOError, InterruptedError):
            return
        except OSError:
            self.closed = True

    def close(self) -> None:
        """Nobody sends any more."""
        if not self._shut:
            self._shut = self.closed = True
            os.close(self._descriptor)


def send_all(descriptor: int, data: bytes) -> bool:
    """Whether somebody reads; waits as long as the pipe is full."""
    try:
        while data:
            data = data[os.write(descriptor, data) :]
    except BrokenPipeError:
        return False
    return True
