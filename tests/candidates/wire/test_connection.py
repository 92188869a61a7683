import threading
import time

import numpy as np
import pytest
from websockets.sync.client import ClientConnection, connect
from websockets.sync.server import serve

from genpolicy.candidates.wire import connection
from genpolicy.candidates.wire.connection import Listening, _message, dial, free_port
from genpolicy.candidates.wire.faults import Fault, PolicyError
from genpolicy.candidates.wire.packing import MAXIMUM_MESSAGE_BYTES, pack
from genpolicy.errors import ConfigError

HELLO = {"robot": "planted"}


@pytest.fixture
def raw():
    """A server that does with its line whatever a function wants."""
    running = []

    def start(talk):
        server = serve(talk, "127.0.0.1", 0, compression=None, max_size=None)
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        running.append((server, thread))
        return f"ws://127.0.0.1:{server.socket.getsockname()[1]}"

    yield start
    for server, thread in running:
        server.shutdown()
        thread.join(5)


def asked(address, message=None, timeout_s=60.0):
    line = dial(address, allowed=None, timeout_s=60.0)
    try:
        return line.ask(message or {"o": np.arange(3.0)}, timeout_s=timeout_s)
    finally:
        line.close()


def fault_of(address, **arguments):
    with pytest.raises(PolicyError) as error:
        asked(address, **arguments)
    return error.value.fault


def test_metadata_come_first_and_then_an_answer_to_each_message(serving):
    with serving(lambda message: {"twice": message["o"] * 2}, HELLO) as address:
        line = dial(address, allowed=None, timeout_s=60.0)
        assert line.metadata == HELLO
        for number in range(3):
            answer = line.ask({"o": np.full(2, number)}, timeout_s=60.0)
            assert answer["twice"].tolist() == [2 * number] * 2
        line.close()


def test_what_the_server_raises_is_told_as_text_and_ends_that_line_only(serving):
    def answer(message):
        if "bad" in message:
            raise ValueError("no such phase")
        return {}

    with serving(answer, HELLO) as address:
        with pytest.raises(PolicyError, match="no such phase") as error:
            asked(address, {"bad": 1})
        assert error.value.fault is Fault.REFUSED
        assert asked(address) == {}


@pytest.mark.parametrize(("text", "said"), [
    ("", ": an empty text,"),
    (" \n", ": an empty text,"),
    ("Traceback (most recent call last):\n  ...\nValueError: no such phase\n",
     ": it says 'ValueError: no such phase',"),
    ("no \x1b[31mphase", r": it says 'no \\x1b\[31mphase',"),
])  # fmt: skip
def test_a_text_is_told_by_its_last_line(text, said):
    with pytest.raises(PolicyError, match=said) as error:
        _message(text)
    assert error.value.fault is Fault.REFUSED


def test_nobody_there():
    assert fault_of(f"ws://127.0.0.1:{free_port()}") is Fault.CLOSED


def test_no_answer_in_time_is_late_and_what_comes_then_answers_nothing(serving):
    slow = threading.Event()

    def answer(message):
        if "slow" in message:
            slow.wait(60)
        return dict(message)

    with serving(answer, HELLO) as address:
        line = dial(address, allowed=None, timeout_s=60.0)
        with pytest.raises(PolicyError) as error:
            line.ask({"slow": 1}, timeout_s=0.05)
        assert error.value.fault is Fault.LATE
        slow.set()
        # It comes some time: taken for an answer, it makes the next one come unasked.
        with pytest.raises(PolicyError) as later:
            for _ in range(1000):
                line.ask({"next": 1}, timeout_s=60.0)
        line.close()
        assert later.value.fault is Fault.UNREQUESTED


def test_a_server_that_answers_twice_is_at_fault(raw):
    def talk(line):
        line.send(pack(HELLO))
        for _ in line:
            line.send(pack({}))
            line.send(pack({}))

    line = dial(raw(talk), allowed=None, timeout_s=60.0)
    faults = []
    for _ in range(50):
        try:
            line.ask({}, timeout_s=60.0)
        except PolicyError as error:
            faults.append(error.fault)
            break
    line.close()
    assert faults == [Fault.UNREQUESTED]


def test_a_server_that_hangs_up_in_the_middle_is_closed(raw):
    def talk(line):
        line.send(pack(HELLO))
        line.recv()
        line.socket.shutdown(2)

    assert fault_of(raw(talk)) is Fault.CLOSED


def test_a_message_beyond_the_limit_is_oversize(raw):
    def talk(line):
        line.send(pack(HELLO))
        line.recv()
        try:
            line.send(b"\0" * (MAXIMUM_MESSAGE_BYTES + 1))
        except Exception:  # the reader has hung up
            return

    assert fault_of(raw(talk)) is Fault.OVERSIZE


@pytest.mark.parametrize("said", [b"\xc1", b"", b"\x90", pack({})[:0]])
def test_bytes_that_are_no_message_are_malformed(raw, said):
    def talk(line):
        line.send(pack(HELLO))
        line.recv()
        line.send(said)
        line.recv()

    assert fault_of(raw(talk)) is Fault.MALFORMED


def test_a_server_that_says_nothing_first_is_late(raw):
    with pytest.raises(PolicyError, match="no metadata within") as error:
        dial(raw(lambda line: line.recv()), allowed=None, timeout_s=0.1)
    assert error.value.fault is Fault.LATE


def test_a_server_that_does_not_read_does_not_hold_us(raw):
    end, rescued = threading.Event(), threading.Event()
    rescue = threading.Timer(30.0, lambda: (rescued.set(), end.set()))
    rescue.start()

    def talk(line):
        line.send(pack(HELLO))
        end.wait()  # nothing is taken out of its queue, which fills, and then the line

    line = dial(raw(talk), allowed=None, timeout_s=60.0)
    large = {"picture": np.zeros(MAXIMUM_MESSAGE_BYTES // 2, dtype=np.uint8)}
    faults = set()
    for _ in range(60):
        try:
            line.ask(large, timeout_s=0.05)
        except PolicyError as error:
            faults.add(error.fault)
    rescue.cancel()
    end.set()
    line.close()
    assert not rescued.is_set()
    assert Fault.LATE in faults
    assert faults <= {Fault.LATE, Fault.CLOSED}


PINGS = bytes([0x89, 125]) + b"x" * 125
"""A ping as a server sends it (RFC 6455, 5.5.2), of the longest text that it may have."""


def test_a_server_that_floods_pings_and_reads_no_answer_does_not_hold_us(raw):
    """Answering them fills the line, behind which our own message waits."""
    rescued = threading.Event()

    def talk(line):
        line.send(pack(HELLO))
        while not rescued.is_set():
            try:
                line.socket.sendall(PINGS * 400)
            except OSError:
                return

    line = dial(raw(talk), allowed=None, timeout_s=60.0)
    rescue = threading.Timer(60.0, lambda: (rescued.set(), line._cut()))
    rescue.start()
    with pytest.raises(PolicyError) as error:
        for _ in range(1000):
            line.ask({"o": np.zeros(100_000)}, timeout_s=0.2)
    line.close()
    rescue.cancel()
    assert not rescued.is_set()
    assert error.value.fault in {Fault.LATE, Fault.CLOSED}


@pytest.mark.parametrize("first", ["no model", b"\xc1", None])
def test_a_line_that_begins_wrongly_is_hung_up_and_leaves_no_thread(raw, first):
    end = threading.Event()

    def talk(line):
        if first is not None:
            line.send(first)
        end.wait(60)

    address = raw(talk)
    before = set(threading.enumerate())
    with pytest.raises(PolicyError) as error:
        dial(address, allowed=None, timeout_s=0.2 if first is None else 60.0)
    assert error.value.fault is {str: Fault.REFUSED, bytes: Fault.MALFORMED}.get(
        type(first), Fault.LATE
    )
    ours = [
        thread for thread in set(threading.enumerate()) - before
        if getattr(thread, "_target", None) is not None
        and isinstance(getattr(thread._target, "__self__", None), ClientConnection)
    ]  # fmt: skip
    for thread in ours:
        thread.join(60)  # far more than the tenth of a second that hanging up takes
    end.set()
    assert not any(thread.is_alive() for thread in ours)


def test_hanging_up_waits_once_and_not_as_long_as_an_answer(raw, monkeypatch):
    opened = []

    def connected(*words, **settings):
        opened.append(settings)
        return connect(*words, **settings)

    monkeypatch.setattr(connection, "connect", connected)
    with pytest.raises(PolicyError, match="no metadata"):
        dial(raw(lambda line: line.recv()), allowed=None, timeout_s=0.2)
    assert [one["close_timeout"] for one in opened] == [connection.HANG_UP_S]


def test_a_round_trip_is_that_of_a_ping(raw, serving):
    ticks = iter(range(10))
    with serving(lambda _: {}, HELLO) as address:
        line = dial(address, allowed=None, timeout_s=60.0)
        assert line.round_trip_s(timeout_s=60.0, clock=lambda: float(next(ticks))) == 1.0
        line.close()
        assert line.round_trip_s(timeout_s=60.0, clock=lambda: float(next(ticks))) is None


def test_who_answers_no_ping_is_not_at_fault(raw):
    deaf, end = threading.Event(), threading.Event()

    def talk(line):
        line.send(pack(HELLO))
        line.protocol_mutex.acquire()  # its library answers nothing any more
        deaf.set()
        end.wait(60)
        line.protocol_mutex.release()

    line = dial(raw(talk), allowed=None, timeout_s=60.0)
    assert deaf.wait(60)  # before, a ping may still be answered
    assert line.round_trip_s(timeout_s=0.2, clock=time.monotonic) is None
    end.set()
    line.close()


def test_no_line_is_opened_to_another_machine(monkeypatch):
    monkeypatch.setattr(connection, "connect", lambda *_, **__: pytest.fail("it dialled"))
    with pytest.raises(ConfigError, match="another machine"):
        dial("ws://192.0.2.1:80", allowed=None, timeout_s=0.1)


def test_no_proxy_is_asked(monkeypatch, serving):
    monkeypatch.setenv("http_proxy", "http://192.0.2.1:3128")
    monkeypatch.setenv("all_proxy", "http://192.0.2.1:3128")
    with serving(lambda _: {}, HELLO) as address:
        assert asked(address) == {}


def test_a_server_listens_on_this_machine_only():
    with Listening(lambda message: message, {}, port=0) as listening:
        assert listening._server.socket.getsockname()[0] == "127.0.0.1"
