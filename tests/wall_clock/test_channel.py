"""Frames: whatever comes, in whatever pieces, reading never waits, raises or grows."""

import contextlib
import os
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from genpolicy.wall_clock.channel import (
    HEADER,
    MAGIC,
    MAXIMUM_PAYLOAD_BYTES,
    MOST_FRAMES,
    READ_BYTES,
    Inbox,
    Outbox,
    frame,
)


@pytest.fixture
def pipe():
    return Pipe()


class Pipe:
    """An inbox, and the end that fills it."""

    def __init__(self) -> None:
        reader, self.writer = os.pipe()
        self.inbox = Inbox(reader)

    def say(self, data: bytes) -> list[bytes]:
        """What is read in all while this is written."""
        found = []
        for at in range(0, len(data), 4096):
            os.write(self.writer, data[at : at + 4096])
            found += self.inbox.read()
        while more := self.inbox.read():
            found += more
        return found


def test_a_frame_is_read_whole_and_once(pipe):
    assert pipe.inbox.read() == []  # and it did not wait
    assert pipe.say(frame(b"one") + frame(b"") + frame(b"two")) == [b"one", b"", b"two"]
    assert pipe.inbox.dropped.total() == 0 and not pipe.inbox.closed


def test_a_frame_that_comes_in_pieces_is_waited_for_without_waiting(pipe):
    data = frame(b"payload")
    assert [pipe.say(data[n : n + 1]) for n in range(len(data) - 1)] == [[]] * (len(data) - 1)
    assert pipe.say(data[-1:]) == [b"payload"]


@given(
    parts=st.lists(st.one_of(st.binary(max_size=60), st.just(MAGIC), st.just(MAGIC[:3])),
                   max_size=12),
    size=st.integers(1, 40),
)  # fmt: skip
def test_behind_any_garbage_the_next_whole_frames_are_found(parts, size):
    """A damaged header may swallow as much as the longest frame, and no more."""
    pipe, data = Pipe(), b"".join(parts)
    try:
        found = []
        for at in range(0, len(data), size):
            found += pipe.say(data[at : at + size])
        pad = HEADER.size + MAXIMUM_PAYLOAD_BYTES
        found += pipe.say(b"\0" * pad + frame(b"good"))
        assert found[-1] == b"good"
        assert len(pipe.inbox._buffer) == 0
    finally:
        os.close(pipe.writer)
        os.close(pipe.inbox.descriptor)


def test_what_is_too_long_is_skipped_and_what_stands_behind_is_read(pipe):
    lies = HEADER.pack(MAGIC, MAXIMUM_PAYLOAD_BYTES + 1, 0)
    assert pipe.say(lies + b"x" * 100 + frame(b"good")) == [b"good"]
    assert pipe.inbox.dropped == {"oversize": 1, "garbage_bytes": 108}


def test_a_changed_bit_is_no_frame_and_hides_none_inside(pipe):
    inside = frame(b"inside")
    damaged = bytearray(frame(inside + b"!"))
    damaged[-1] ^= 1
    assert pipe.say(bytes(damaged) + frame(b"next")) == [b"inside", b"next"]
    assert pipe.inbox.dropped["damaged"] == 1


def test_the_longest_frame_fits(pipe):
    payload = os.urandom(MAXIMUM_PAYLOAD_BYTES)
    assert pipe.say(frame(payload)) == [payload]


def test_one_reading_is_bounded_and_loses_nothing(pipe):
    count = 3 * MOST_FRAMES
    os.write(pipe.writer, frame(b"a") * count)
    sizes = []
    while found := pipe.inbox.read():
        sizes.append(len(found))
    assert sizes == [MOST_FRAMES] * 3


def test_the_buffer_is_bounded_whatever_a_header_promises(pipe):
    os.set_blocking(pipe.writer, False)
    begin = struct.pack("<4sII", MAGIC, MAXIMUM_PAYLOAD_BYTES, 0)
    for _ in range(40):
        with contextlib.suppress(BlockingIOError):
            os.write(pipe.writer, begin)
        pipe.inbox.read()
        assert len(pipe.inbox._buffer) <= HEADER.size + MAXIMUM_PAYLOAD_BYTES + READ_BYTES


def test_the_buffer_is_bounded_where_more_comes_than_is_taken(pipe):
    os.set_blocking(pipe.writer, False)
    for _ in range(20):
        with contextlib.suppress(BlockingIOError):
            os.write(pipe.writer, frame(b"a") * 4000)
        assert len(pipe.inbox.read()) == MOST_FRAMES
        assert len(pipe.inbox._buffer) <= HEADER.size + MAXIMUM_PAYLOAD_BYTES + READ_BYTES


def test_a_sender_that_dies_in_a_frame_is_counted_once(pipe):
    os.write(pipe.writer, frame(b"whole") + frame(b"half")[:-2])
    os.close(pipe.writer)
    assert pipe.inbox.read() == [b"whole"]
    assert pipe.inbox.read() == [] == pipe.inbox.read()
    assert pipe.inbox.closed and pipe.inbox.dropped == {"truncated": 1, "garbage_bytes": 0}


def test_what_was_sent_before_the_death_is_read_to_its_end(pipe):
    os.write(pipe.writer, frame(b"a") * (2 * MOST_FRAMES))
    os.close(pipe.writer)
    assert sum(len(pipe.inbox.read()) for _ in range(5)) == 2 * MOST_FRAMES


def test_an_inbox_whose_descriptor_is_gone_is_closed():
    reader, _writer = os.pipe()
    inbox = Inbox(reader)
    os.close(reader)
    assert inbox.read() == [] and inbox.closed


def test_nobody_waits_for_a_reader_that_does_not_read():
    reader, writer = os.pipe()
    outbox, inbox = Outbox(writer), Inbox(reader)
    sent = 0
    while outbox.send(b"x" * 1000):
        sent += 1
        assert sent < 1000
    assert not outbox.closed
    found = []
    while more := inbox.read():
        found += more
        outbox.flush()
    assert len(found) == sent and set(found) == {b"x" * 1000}  # none torn, none lost
    assert outbox.send(b"again") and inbox.read() == [b"again"]


def test_a_reader_that_is_gone_closes_the_outbox():
    reader, writer = os.pipe()
    outbox = Outbox(writer)
    os.close(reader)
    assert not outbox.send(b"x") and outbox.closed
    outbox.close()
    outbox.close()
    assert not outbox.send(b"x")
