"""A server of somebody's policy: its files verified, started on a free port, watched, ended."""

import errno
import os
import secrets
import shutil
import signal
import subprocess
import time
from collections.abc import Mapping
from contextlib import AbstractContextManager, suppress
from pathlib import Path
from types import MappingProxyType

from genpolicy.candidates.wire.connection import LOOPBACK, dial, free_port
from genpolicy.candidates.wire.entry import PORT, ServerEntry
from genpolicy.candidates.wire.faults import Fault, PolicyError
from genpolicy.candidates.wire.printed import Printed
from genpolicy.candidates.wire.processes import listens, marked
from genpolicy.errors import ConfigError

LOOK_S = 0.05
END_S = 5.0
LAST_WORDS = 300
END_ROUNDS = 20
PORTS = 3
"""Free ports that are tried: between the choice of one and the server, somebody may take it."""
IN_USE = os.strerror(errno.EADDRINUSE).lower()
"""What a server says last that could not listen."""
MARK = "GENPOLICY_LAUNCH"
"""In the environment of a server, so that what it starts is found whatever session it is in."""
NOTHING: Mapping[str, str] = MappingProxyType({})


def require_program(entry: ServerEntry, folder: Path) -> None:
    """Refuse an entry whose command cannot be run on this machine, before anything runs.

    Args:
        entry: What it is.
        folder: Of the entry's file; the command runs there.

    Raises:
        ConfigError: There is no such program.
    """
    if entry.command is None:
        return
    program = entry.command[0]
    if shutil.which(program if "/" not in program else str(folder / program)) is None:
        raise ConfigError(
            where=f"command of the candidate {entry.name}",
            found=f"{program!r}, which is no program of this machine",
            expected="one that can be run",
            action="Install it, or name its full path.",
        )


class PortTakenError(Exception):
    """Somebody else listens where a server was told to."""


class Launched(AbstractContextManager["Launched"]):
    """A server that runs; to be used in a `with`.

    Args:
        entry: What it is.
        folder: Of the entry's file; the command runs there.
        environment: Variables that it is given besides.

    Attributes:
        address: Where it listens.

    Raises:
        ConfigError: There is no such program.
        PolicyError: It ended, or did not listen in time.
    """

    def __init__(
        self, entry: ServerEntry, folder: Path, *, environment: Mapping[str, str] = NOTHING
    ) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._printed: Printed | None = None
        self._mark = secrets.token_hex(16)
        self._environment = {**environment, MARK: self._mark}
        if entry.command is None:
            assert entry.address is not None  # an entry has one of the two
            self.address = entry.address
            return
        until = time.monotonic() + entry.start_timeout_s
        seen = ""
        for _ in range(PORTS):
            try:
                self._start(entry, entry.command, folder, until)
            except PortTakenError as taken:
                seen = str(taken)
                continue
            return
        raise PolicyError(
            Fault.CLOSED,
            f"who listens is no process of its command, on each of {PORTS} ports; start it, and "
            "name its address" + (f" ({seen})" if seen else ""),
        )

    def died(self) -> str | None:
        """Why it is not there any more; None while it is, or where somebody else runs it."""
        code = self._process.poll() if self._process else None
        if code is None:
            return None
        assert self._printed is not None  # a process prints
        self._printed.drained(LOOK_S)
        lines = self._printed.last_words(LAST_WORDS).splitlines()
        return f"it ended with {code}; " + (
            f"its last words: {lines[-1]}" if lines else "it had said nothing"
        )

    def end(self) -> None:
        """End what was started here, with all that it started; no other server is touched."""
        if self._process is None:
            return
        for order, patience_s in ((signal.SIGTERM, END_S), (signal.SIGKILL, END_S)):
            try:
                os.killpg(self._process.pid, order)
                self._process.wait(patience_s)
            except ProcessLookupError:
                break
            except subprocess.TimeoutExpired:
                continue
        # Who has left the group is still marked; who is started meanwhile, the next time round.
        for _ in range(END_ROUNDS):
            left = [pid for pid in marked(MARK, self._mark) if pid != self._process.pid]
            for pid in left:
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
            if not left:
                break
        self._process.wait()
        self._process = None
        if self._printed is not None:
            self._printed.close()

    def _start(self, entry: ServerEntry, command: list[str], folder: Path, until: float) -> None:
        port = free_port()
        self.address = f"ws://{LOOPBACK}:{port}"
        words = [word.replace(PORT, str(port)) for word in command]
        self._printed = Printed()
        try:
            self._process = _begin(
                words, folder, self._printed.write_end, self._environment, entry.name
            )
        except BaseException:
            self._printed.close()
            raise
        finally:
            os.close(self._printed.write_end)
        try:
            self._await(entry, port, until)
        except BaseException:
            self.end()
            raise

    def _await(self, entry: ServerEntry, port: int, until: float) -> None:
        answered = False
        while True:
            if ended := self.died():
                if _taken(port, ended):
                    raise PortTakenError(ended)
                raise PolicyError(Fault.CLOSED, ended)
            left = until - time.monotonic()
            try:
                dial(self.address, allowed=None, timeout_s=max(left, LOOK_S)).close()
            except PolicyError as fault:
                if fault.fault is not Fault.CLOSED:
                    raise
                answered = False
            else:
                known = listens(port, marked(MARK, self._mark))
                if known is False:
                    raise PortTakenError
                # Who listened and is not there now was somebody on the way through (`free_port`
                # of another process holds a port for a moment); where nothing is ever known of
                # sockets, whoever answers twice is taken for ours.
                if known or answered:
                    return
                answered = True
            if left <= 0.0:
                raise PolicyError(
                    Fault.LATE, f"it does not listen after {entry.start_timeout_s:g} s"
                )
            time.sleep(LOOK_S)

    def __exit__(self, *_: object) -> None:
        self.end()


def _taken(port: int, ended: str) -> bool:
    """Whether somebody listens there after a server of ours has ended, or did when it began."""
    return listens(port, []) is not None or IN_USE in ended.lower()


def _begin(
    words: list[str], folder: Path, printed: int, environment: dict[str, str], name: str
) -> "subprocess.Popen[bytes]":
    """In a session of its own, so that an interrupt here lets us end it in order."""
    try:
        return subprocess.Popen(
            words, cwd=folder, stdin=subprocess.DEVNULL, stdout=printed, stderr=printed,
            env={**os.environ, **environment}, start_new_session=True,
        )  # fmt: skip
    except OSError as error:
        raise ConfigError(
            where=f"command of the candidate {name}",
            found=f"{words[0]!r}, which does not start ({error.strerror})",
            expected="a program of this machine",
            action="Name its full path.",
        ) from error
