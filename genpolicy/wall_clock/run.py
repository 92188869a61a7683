"""Starts the two processes of a run, and holds the operator's channel of the supervisor's.

Each process gets the ends of the pipes that it needs and no others: the policy's process cannot
write what only a person may. When this process dies, the supervisor's sees the operator's channel
close, stops and ends.
"""

import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from genpolicy.errors import BadInputError, ConfigError, GenpolicyError
from genpolicy.integrity.documents import read_json
from genpolicy.wall_clock.channel import Outbox
from genpolicy.wall_clock.limits import read_limits
from genpolicy.wall_clock.messages import Operator, Order
from genpolicy.wall_clock.request import OUTCOME, WallClockRequest
from genpolicy.wall_clock.streamed import collect

SUPERVISOR = (sys.executable, "-m", "genpolicy.wall_clock.process")
PROXY = (sys.executable, "-m", "genpolicy.wall_clock.proxy")
POLICY = (sys.executable, "-m", "genpolicy.wall_clock.policy")
LOG = "supervisor.log"
REFUSED = 2


def loading(folder: Path, sha256: str, *, device: str) -> list[str]:
    """Command of a policy's process that loads a checkpoint on a device."""
    return [*POLICY, str(folder), sha256, "--device", device]


@dataclass
class Running:
    """A run that was started.

    Attributes:
        folder: Where it writes.
        supervisor: The supervisor's process.
        policy: The policy's process.
        operator: To the supervisor's process, from a person.
        line: The process between the two, where there is one.
    """

    folder: Path
    supervisor: "subprocess.Popen[bytes]"
    policy: "subprocess.Popen[bytes]"
    operator: Outbox
    line: "subprocess.Popen[bytes] | None" = None

    def say(self, order: Order, person: str = "") -> bool:
        """Whether what a person wants went on its way.

        Args:
            order: E-stop, reset, or end.
            person: Who; a reset without a name is refused.
        """
        return self.operator.send(Operator(order, person).encoded())

    def wait(self, timeout_s: float | None = None) -> dict[str, Any]:
        """Wait for the supervisor's process; the policy's is ended then.

        Returns:
            The outcome, as the supervisor's process wrote it.

        Raises:
            TimeoutExpired: It has not ended in that time; it goes on.
            ConfigError: It refused to begin.
            GenpolicyError: It died. What it left of the journal is whole again (`journal.mcap`),
                and the next run in this folder begins stopped.
        """
        code = self.supervisor.wait(timeout_s)
        for process in (self.policy, self.line):
            if process is not None:
                process.kill()
                process.wait()
        self.operator.close()
        if code == REFUSED:
            raise ConfigError(
                where="the supervisor's process",
                found=f"refusing ({(self.folder / LOG).read_text().strip()})",
                expected="a run that it may supervise",
                action="Do what it says.",
            )
        collect(self.folder)
        if code != 0:
            raise GenpolicyError(
                f"the supervisor's process died with {code}; see {self.folder / LOG}. What it had "
                "written is in journal.mcap. A person looks; the next run here begins stopped."
            )
        outcome: dict[str, Any] = read_json(self.folder / OUTCOME)
        return outcome


def start(
    folder: Path,
    request: WallClockRequest,
    policy: Sequence[str],
    *,
    supervisor: Sequence[str] = SUPERVISOR,
    line: Sequence[str] = (),
    ready: bool = False,
) -> Running:
    """Start a run.

    Args:
        folder: Where journal and outcome go. One that has sessions goes on with the next, which
            begins stopped if a stop stood at the end of the last one, or if it had no end.
        request: What is replayed, and who may command.
        policy: Command of the policy's process; `--asks FD --answers FD` are added.
        supervisor: Command of the supervisor's.
        line: Command of a process between the two, if any.
        ready: Whether the supervisor begins only when the policy says that it has loaded; its
            command gets `--ready FD` then. Otherwise the clock runs while it loads.

    Raises:
        ConfigError: Limits or fixtures are not as pinned.
        BadInputError: The folder cannot be written.
    """
    read_limits(Path(request.root))  # told at once; the supervisor's process asks again by itself
    try:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / OUTCOME).unlink(missing_ok=True)
        log = (folder / LOG).open("wb")
    except OSError as error:
        raise BadInputError(
            where=str(folder),
            found=f"not writable ({error.strerror})",
            expected="a folder for the journal",
            action="Name another folder.",
        ) from error
    request.write(folder)
    (asks_r, asks_w), (answers_r, answers_w), (operator_r, operator_w) = (
        os.pipe() for _ in range(3)
    )
    theirs = {"answers": answers_r, "asks": asks_w, "operator": operator_r}
    between: subprocess.Popen[bytes] | None = None
    with log:
        if line:
            between, asks_r, answers_w = _lay(line, asks_r, answers_w)
        ends = {"asks": asks_r, "answers": answers_w}
        proposing = _loaded(policy, ends) if ready else _begin(policy, ends, None)
        supervising = _begin([*supervisor, str(folder)], theirs, log)
    for descriptor in (*theirs.values(), asks_r, answers_w):
        os.close(descriptor)
    return Running(folder, supervising, proposing, Outbox(operator_w), between)


def _loaded(policy: Sequence[str], ends: dict[str, int]) -> "subprocess.Popen[bytes]":
    """The policy's process, when it has said that it is ready, or has died."""
    ready_r, ready_w = os.pipe()
    process = _begin(policy, {**ends, "ready": ready_w}, None)
    os.close(ready_w)
    os.read(ready_r, 1)  # nothing, of a process that died: the supervisor will see nobody
    os.close(ready_r)
    return process


def _lay(
    line: Sequence[str], asks_r: int, answers_w: int
) -> tuple["subprocess.Popen[bytes]", int, int]:
    """A process between the two, and the ends that the policy gets in the place of these."""
    (asks_out_r, asks_out_w), (answers_in_r, answers_in_w) = os.pipe(), os.pipe()
    ends = {
        "asks": asks_r, "answers": answers_in_r, "ask-out": asks_out_w, "answer-out": answers_w,
    }  # fmt: skip
    process = _begin(line, ends, None)
    for descriptor in ends.values():
        os.close(descriptor)
    return process, asks_out_r, answers_in_w


def _begin(
    command: Sequence[str], descriptors: dict[str, int], log: Any
) -> "subprocess.Popen[bytes]":
    """A process in a session of its own, so that what ends this one does not end it too."""
    words = [word for name, fd in descriptors.items() for word in (f"--{name}", str(fd))]
    return subprocess.Popen(
        [*command, *words],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL if log else None,
        stderr=log,
        pass_fds=tuple(descriptors.values()),
        start_new_session=True,
    )
