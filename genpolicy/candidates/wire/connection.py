"""The wire to a policy in a process of its own, and the only module that opens a socket.

The protocol is that of openpi's clients and servers: WebSocket without compression; the server
speaks first, a map of metadata; then one message up, one down; a text instead of bytes says what
went wrong. Nothing but a policy is reached through it: see the test of safety.
"""

import logging
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, suppress
from threading import Timer
from typing import Any

from websockets.exceptions import ConnectionClosed, InvalidHandshake, PayloadTooBig
from websockets.sync.client import ClientConnection, connect
from websockets.sync.server import Server, ServerConnection, serve

from genpolicy.candidates.wire.address import check_address
from genpolicy.candidates.wire.faults import Fault, PolicyError
from genpolicy.candidates.wire.packing import MAXIMUM_MESSAGE_BYTES, pack, unpack
from genpolicy.errors import IntegrityError

LOOPBACK = "127.0.0.1"
HEALTH_PATH = "/healthz"
PING_S = None
"""No pings: openpi's server answers none while it infers, which is no fault of it."""
SHORTEST_WAIT_S = 1e-3
HANG_UP_S = 0.1
QUIET = logging.getLogger(f"{__name__}.quiet")
"""The library tells of a stranger's bytes with a traceback of its own; ours is `PolicyError`."""
QUIET.addHandler(logging.NullHandler())
QUIET.propagate = False
Clock = Callable[[], float]
"""Seconds of a clock that only goes forward."""
SHUT_BOTH = 2
"""`socket.SHUT_RDWR`: neither side reads or writes any more."""


class Connection:
    """A client's end: metadata at first, then one answer to one message.

    Attributes:
        metadata: What the server said of itself.
    """

    def __init__(self, socket: ClientConnection, metadata: dict[str, Any]) -> None:
        self._socket = socket
        self.metadata = metadata

    def ask(self, message: dict[str, Any], *, timeout_s: float) -> dict[str, Any]:
        """The answer to a message.

        After a fault the line is of no use: what comes late would answer the next message.

        Raises:
            PolicyError: None in time, one that nobody asked for, a closed or flooded line, a
                text, or no message at all.
        """
        late = PolicyError(Fault.LATE, f"no answer within {timeout_s:.3g} s")
        packed = pack(message)
        # Sending waits for a server that does not read, or for the library that answers its pings,
        # unless somebody hangs up meanwhile.
        watch = Timer(timeout_s, self._cut)
        watch.daemon = True
        begun = time.monotonic()
        try:
            self._refuse_unrequested()
            watch.start()
            self._socket.send(packed)
            watch.cancel()
            left = timeout_s - (time.monotonic() - begun)
            return _message(self._socket.recv(timeout=max(left, SHORTEST_WAIT_S)))
        except TimeoutError as error:
            raise late from error
        except ConnectionClosed as error:
            raise (late if time.monotonic() - begun >= timeout_s else _closed(error)) from error
        finally:
            watch.cancel()

    def _cut(self) -> None:
        with suppress(OSError):  # it may be closed already
            self._socket.socket.shutdown(SHUT_BOTH)

    def _refuse_unrequested(self) -> None:
        try:
            self._socket.recv(timeout=0)
        except TimeoutError:
            return
        raise PolicyError(Fault.UNREQUESTED, "a message that nothing was asked for")

    def round_trip_s(self, *, timeout_s: float, clock: Clock) -> float | None:
        """How long a ping and its answer take, s; None where none comes, which is no fault."""
        begun = clock()
        try:
            answered = self._socket.ping()
        except ConnectionClosed:
            return None
        return clock() - begun if answered.wait(timeout_s) else None

    def close(self) -> None:
        """Hang up, without waiting for somebody who does not listen."""
        self._cut()
        self._socket.close()


def dial(address: str, *, allowed: str | None, timeout_s: float) -> Connection:
    """A connection to a server that listens already.

    Raises:
        ConfigError: See `check_address`.
        PolicyError: Nobody listens, or what it says first is no metadata.
    """
    check_address(address, allowed)
    try:
        socket = connect(
            address, compression=None, max_size=MAXIMUM_MESSAGE_BYTES, proxy=None,
            open_timeout=timeout_s, ping_interval=PING_S, close_timeout=HANG_UP_S, logger=QUIET,
        )  # fmt: skip
    # A time-out is an OSError too; who hangs up in the handshake may be any of the three.
    except (OSError, InvalidHandshake, ConnectionClosed) as error:
        raise PolicyError(Fault.CLOSED, f"nobody answers at {address} ({error})") from error
    line = Connection(socket, {})
    try:
        line.metadata = _first(socket, timeout_s)
    except BaseException:
        line.close()  # whatever came instead: nobody else holds this line
        raise
    return line


def _first(socket: ClientConnection, timeout_s: float) -> dict[str, Any]:
    try:
        return _message(socket.recv(timeout=timeout_s))
    except TimeoutError as error:
        raise PolicyError(Fault.LATE, f"no metadata within {timeout_s:.3g} s") from error
    except ConnectionClosed as error:
        raise _closed(error) from error


def _message(data: str | bytes) -> dict[str, Any]:
    if isinstance(data, str):
        # The last line of a traceback is its reason; quoted, since it is a stranger's text.
        last = data.strip().rpartition("\n")[2].strip()
        raise PolicyError(Fault.REFUSED, f"it says {last!r}"[:300] if last else "an empty text")
    try:
        return unpack(data)
    except IntegrityError as error:
        raise PolicyError(Fault.MALFORMED, error.found) from error


def _closed(error: ConnectionClosed) -> PolicyError:
    if isinstance(error.__cause__, PayloadTooBig) or (error.sent and error.sent.code == 1009):
        found = f"a message of more than {MAXIMUM_MESSAGE_BYTES} bytes"
        return PolicyError(Fault.OVERSIZE, found)
    return PolicyError(Fault.CLOSED, f"it hung up ({error})")


class Listening(AbstractContextManager["Listening"]):
    """A server's end on this machine: who connects gets the metadata, then answers.

    Args:
        answer: Message to answer; what it raises is told as text, and ends that connection.
        metadata: Said first.
        port: Port, or 0 for a free one.
    """

    def __init__(
        self, answer: Callable[[dict[str, Any]], dict[str, Any]], metadata: dict[str, Any],
        *, port: int,
    ) -> None:  # fmt: skip
        self._answer = answer
        self._metadata = metadata
        self._server: Server = serve(
            self._talk, LOOPBACK, port, compression=None, max_size=MAXIMUM_MESSAGE_BYTES,
            ping_interval=PING_S, process_request=_health, logger=QUIET,
        )  # fmt: skip
        self.port: int = self._server.socket.getsockname()[1]

    def serve_forever(self) -> None:
        """Answer until `close`, or an interrupt."""
        self._server.serve_forever()

    def close(self) -> None:
        """Listen no more."""
        self._server.shutdown()

    def __exit__(self, *_: object) -> None:
        self.close()

    def _talk(self, line: ServerConnection) -> None:
        try:
            line.send(pack(self._metadata))
            for data in line:
                try:
                    said = pack(self._answer(_message(data)))
                except Exception as error:  # whatever it is, the client is told, as openpi does
                    line.send(f"{type(error).__name__}: {error}")
                    line.close(1011)
                    return
                line.send(said)
        except ConnectionClosed:
            return


def free_port() -> int:
    """A port of this machine on which nobody listens now."""
    with Listening(lambda message: message, {}, port=0) as listening:
        return listening.port


def _health(line: ServerConnection, request: Any) -> Any:
    """Whoever watches asks with plain HTTP whether it stands, as with openpi's server."""
    return line.respond(200, "OK\n") if request.path == HEALTH_PATH else None
