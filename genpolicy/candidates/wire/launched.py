"""A server of somebody's policy: its files verified, started on a free port, watched, ended."""

import os
import signal
import subprocess
import time
from contextlib import AbstractContextManager
from pathlib import Path

from genpolicy.candidates.wire.connection import LOOPBACK, dial, free_port
from genpolicy.candidates.wire.entry import PORT, ServerEntry
from genpolicy.candidates.wire.faults import Fault, PolicyError
from genpolicy.errors import ConfigError
from genpolicy.integrity.hashing import read_verified

LOOK_S = 0.05
END_S = 5.0
LAST_WORDS = 300


def verify_files(entry: ServerEntry, folder: Path) -> None:
    """Hold every file that is the candidate against its hash.

    Args:
        entry: What it is.
        folder: Of the entry's file; paths in it start there.

    Raises:
        IntegrityError: A file is missing, or is another one.
    """
    for name, digest in sorted(entry.files.items()):
        read_verified(folder / name, sha256=digest, named_by=f"the entry of {entry.name}")


class Launched(AbstractContextManager["Launched"]):
    """A server that runs; to be used in a `with`.

    Args:
        entry: What it is.
        folder: Of the entry's file; the command runs there.
        log: File for what it prints.

    Attributes:
        address: Where it listens.

    Raises:
        ConfigError: There is no such program.
        PolicyError: It ended, or did not listen in time.
    """

    def __init__(self, entry: ServerEntry, folder: Path, log: Path) -> None:
        self._log = log
        self._process: subprocess.Popen[bytes] | None = None
        if entry.command is None:
            assert entry.address is not None  # an entry has one of the two
            self.address = entry.address
            return
        port = free_port()
        self.address = f"ws://{LOOPBACK}:{port}"
        words = [word.replace(PORT, str(port)) for word in entry.command]
        with log.open("ab") as printed:
            self._process = _begin(words, folder, printed.fileno(), entry.name)
        try:
            self._await(entry)
        except BaseException:
            self.end()
            raise

    def died(self) -> str | None:
        """Why it is not there any more; None while it is, or where somebody else runs it."""
        code = self._process.poll() if self._process else None
        if code is None:
            return None
        said = self._log.read_bytes()[-LAST_WORDS:].decode(errors="replace").strip()
        return f"it ended with {code}; its last words: {said.splitlines()[-1:]}"

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
        self._process.wait()
        self._process = None

    def _await(self, entry: ServerEntry) -> None:
        until = time.monotonic() + entry.start_timeout_s
        while True:
            if ended := self.died():
                raise PolicyError(Fault.CLOSED, ended)
            left = until - time.monotonic()
            try:
                dial(self.address, allowed=None, timeout_s=max(left, LOOK_S)).close()
                return
            except PolicyError as fault:
                if fault.fault is not Fault.CLOSED:
                    raise
            if left <= 0.0:
                raise PolicyError(
                    Fault.LATE, f"it does not listen after {entry.start_timeout_s:g} s"
                )
            time.sleep(LOOK_S)

    def __exit__(self, *_: object) -> None:
        self.end()


def _begin(words: list[str], folder: Path, log: int, name: str) -> "subprocess.Popen[bytes]":
    """In a session of its own, so that an interrupt here lets us end it in order."""
    try:
        return subprocess.Popen(
            words, cwd=folder, stdin=subprocess.DEVNULL, stdout=log, stderr=log,
            start_new_session=True,
        )  # fmt: skip
    except OSError as error:
        raise ConfigError(
            where=f"command of the candidate {name}",
            found=f"{words[0]!r}, which does not start ({error.strerror})",
            expected="a program of this machine",
            action="Name its full path.",
        ) from error
