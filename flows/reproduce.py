"""One `dvc repro` as a subprocess, with an exit code that says why it ended.

DVC itself ends with 255 whatever a stage did. This reads which stage failed and with which code,
so that a refusal (3), a bad input (2) and a fault (1) stay apart. A whole ladder is also asked for
the verdict of its last gate, behind which no stage could refuse. `python -m flows.reproduce` runs
the whole ladder, or the stages named, without any server.
"""

import contextlib
import os
import re
import signal
import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from flows.beforehand import refused_beforehand
from flows.estimate import estimate
from flows.judged import GOES_ON, judged, last_gate
from genpolicy.cli.shell import INTERRUPTED, run_program
from genpolicy.errors import DEAD_WORKER, BadInputError, GenpolicyError
from genpolicy.outputs import require_own_files

EXIT_DONE, EXIT_FAULT, EXIT_BAD_INPUT, EXIT_REFUSED = 0, 1, 2, 3
KEPT_LINES = 400
FIRST_PAGE = "reports/index.html"
GRACE_S = 5.0
QUICK_DVC = Path(__file__).with_name("quick_dvc.py")

FAILED_STAGE = re.compile(
    r"failed to reproduce '(?P<stage>[^']+)': failed to run: .*exited with (?P<code>-?\d+)"
)
# What can be well again by itself: a lock held by another process, a full disk, a killed process.
INFRASTRUCTURE = re.compile(
    r"Unable to acquire lock|is busy, it is being blocked|No space left on device|Disk quota"
    r"|Cannot allocate memory|Resource temporarily unavailable"
)
# The exception with which a stage ends when a process that it fanned out to died under it: that of
# the local pool, and that of a cluster after its own tries.
WORKER_DIED = re.compile(rf"^(?:\w+\.)*(?:{'|'.join(DEAD_WORKER)})\b")
DIED = (
    "a worker process died under the stage, as one does that is killed where memory runs out. "
    "Nothing half written was left, and the stage begins anew. If one dies again, lower "
    "compute.workers."
)
BROKEN_PIPELINE = re.compile(r"^'.*dvc\.(yaml|lock)' (is invalid|is corrupted|validation failed)")
DVC_REJECTS = re.compile(
    r"is (invalid|corrupted)|validation failed|does not exist|missing data|not found"
    r"|Cyclic|overlaps with"
)

_running: set["subprocess.Popen[str]"] = set()


@dataclass(frozen=True)
class RunEnd:
    """How a `dvc repro` ended.

    Attributes:
        code: 0 done, 1 a fault of ours or of the machine, 2 bad input, 3 refused by a gate.
        stage: Stage that ended it, empty when all went well or DVC itself failed.
        sentence: What the stage (or DVC) said, one line; empty when all went well.
        infrastructure: Whether a second try could help: a lock, a full disk, a killed process.
        duration_s: Wall time.
        verdict: Of the last gate, where all ran and it does not pass; otherwise empty.
        worker_died: Whether it was a process that the stage had fanned out to.
    """

    code: int
    stage: str
    sentence: str
    infrastructure: bool
    duration_s: float
    verdict: str = ""
    worker_died: bool = False


def reproduce(
    workspace: Path,
    *,
    stages: Sequence[str] = (),
    single_item: bool = False,
    force: bool = False,
    echo: Callable[[str], None] = print,
) -> RunEnd:
    """Run `dvc repro` in `workspace` and say how it ended.

    Args:
        workspace: Folder that holds `dvc.yaml`.
        stages: Stages to bring up to date; none means all, and the last gate's verdict counts.
        single_item: Only these stages, without what they depend on.
        force: Run them even where nothing changed.
        echo: Called with every line that DVC and the stages print.

    Returns:
        How it ended. Nothing is raised for a stage that fails: that is an answer.

    Raises:
        BadInputError: All ran, and the last gate left no report, or one without verdict.
    """
    command = [sys.executable, "-P", str(QUICK_DVC), "repro", *stages]
    command += ["--single-item"] if single_item else []
    command += ["--force"] if force else []
    started = time.monotonic()
    if refused := _refused(workspace, stages):
        return refused
    lines: deque[str] = deque(maxlen=KEPT_LINES)
    process = subprocess.Popen(
        command,
        cwd=workspace,
        env=stage_environment(workspace),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        start_new_session=True,
    )
    _running.add(process)
    try:
        assert process.stdout is not None
        for line in process.stdout:
            text = line.rstrip()
            lines.append(text)
            echo(text)
        code = process.wait()
    finally:
        if process.poll() is None:
            stop_group(process)
        _running.discard(process)
    duration_s = time.monotonic() - started
    if code == 0 and not stages:
        _print_first_page(workspace)
        return _of_the_last_gate(workspace, duration_s)
    return _outcome(code, list(lines), duration_s)


def _refused(workspace: Path, stages: Sequence[str]) -> RunEnd | None:
    """Why DVC is not started; None where it is."""
    try:
        require_own_files(workspace)  # DVC would remove the others without a word
    except GenpolicyError as error:
        return RunEnd(error.exit_code, "", str(error), infrastructure=False, duration_s=0.0)
    if not stages and (why := refused_beforehand(workspace)):
        return RunEnd(EXIT_BAD_INPUT, "", why, infrastructure=False, duration_s=0.0)
    return None


def _print_first_page(workspace: Path) -> None:
    """Once more, where there is one: DVC may have brought back what it was printed without.

    Each gate prints it. What stands on a gate that was judged again to the same bytes does not run,
    and is put back behind it. Whether the page is right is told by `genpolicy report status`.
    """
    if (workspace / FIRST_PAGE).is_file():
        command = [sys.executable, "-m", "gates.writing"]
        environment = stage_environment(workspace)
        subprocess.run(command, cwd=workspace, env=environment, check=False, capture_output=True)


def stage_environment(workspace: Path) -> dict[str, str]:
    """What stages run with: no telemetry, one thread, AVX2, this interpreter first in PATH."""
    return {
        **os.environ,
        "PATH": os.pathsep.join((str(Path(sys.executable).parent), os.environ.get("PATH", ""))),
        "DVC_NO_ANALYTICS": "1",
        "DO_NOT_TRACK": "1",
        "OMP_NUM_THREADS": "1",
        "ATEN_CPU_CAPABILITY": "avx2",
        "PYTHONHASHSEED": "0",
        "PYTHONUNBUFFERED": "1",
        "MPLBACKEND": "Agg",
        "MPLCONFIGDIR": str(workspace.resolve() / "build" / "matplotlib"),
    }


def stop_group(process: "subprocess.Popen[str]") -> None:
    """End DVC together with the stage that it started; DVC alone would leave a second writer."""
    for sign in (signal.SIGTERM, signal.SIGKILL):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, sign)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(timeout=GRACE_S)
            if sign is signal.SIGKILL:
                return


def stop_all() -> None:
    """End every `dvc repro` that this process has started, with its stages."""
    for process in tuple(_running):
        stop_group(process)


def reproduce_here(
    workspace: Path, *, stages: Sequence[str] = (), single_item: bool = False, force: bool = False
) -> int:
    """`reproduce` for a person at a terminal: prints as it goes, ends with the exit code.

    Once, a stage under which a worker died is run again by itself. A lock, a full disk or a stage
    that somebody ended waits for the person.
    """
    if not (workspace / "dvc.yaml").is_file():
        raise BadInputError(
            where=str(workspace),
            found="a folder without dvc.yaml",
            expected="a workspace of the ladder",
            action="Name one with --workspace.",
        )
    if not stages:
        print(estimate(workspace), flush=True)
    signal.signal(signal.SIGTERM, _interrupt)
    again = partial(
        reproduce,
        workspace,
        stages=stages,
        single_item=single_item,
        force=force,
        echo=lambda line: print(line, flush=True),
    )
    try:
        outcome = again()
        if outcome.worker_died:
            print(f"\n{outcome.sentence} Run again, once.\n", file=sys.stderr, flush=True)
            outcome = again()
    except KeyboardInterrupt:
        print("Interrupted: DVC and its stage were stopped.", file=sys.stderr)
        return INTERRUPTED
    if outcome.code != EXIT_DONE:
        print(f"\nThe ladder stopped: {outcome.sentence}", file=sys.stderr)
    return outcome.code


def _interrupt(number: int, frame: object) -> None:
    raise KeyboardInterrupt


def _of_the_last_gate(workspace: Path, duration_s: float) -> RunEnd:
    """All stages ran: the end is the verdict that no stage has asked for."""
    gate = last_gate(workspace)
    verdict, sentence = judged(workspace, gate) if gate else ("", "")
    if not gate or verdict in GOES_ON:
        return RunEnd(EXIT_DONE, "", "", infrastructure=False, duration_s=duration_s)
    return RunEnd(EXIT_REFUSED, gate, sentence, False, duration_s, verdict)


def _outcome(dvc_code: int, lines: list[str], duration_s: float) -> RunEnd:
    if dvc_code == 0:
        return RunEnd(EXIT_DONE, "", "", infrastructure=False, duration_s=duration_s)
    text = "\n".join(lines)
    match = next(reversed(list(FAILED_STAGE.finditer(text))), None)
    errors = [line.removeprefix("ERROR: ") for line in lines if line.startswith("ERROR: ")]
    errors += [line for line in lines if BROKEN_PIPELINE.search(line)]
    killed = dvc_code < 0
    if match is None:
        transient = killed or INFRASTRUCTURE.search(text) is not None
        rejected = not transient and DVC_REJECTS.search("\n".join(errors)) is not None
        sentence = errors[-1] if errors else f"dvc repro ended with code {dvc_code}"
        code = EXIT_BAD_INPUT if rejected else EXIT_FAULT
        return RunEnd(code, "", sentence, infrastructure=transient, duration_s=duration_s)
    stage, stage_code = match["stage"], int(match["code"])
    said = [line for line in lines if line.startswith(f"{stage}: ")]
    sentence = said[-1] if said else f"{stage} ended with code {stage_code}"
    if stage_code in (EXIT_BAD_INPUT, EXIT_REFUSED):
        full_disk = stage_code == EXIT_BAD_INPUT and INFRASTRUCTURE.search(sentence) is not None
        return RunEnd(stage_code, stage, sentence, full_disk, duration_s)
    if _worker_died(stage, lines):
        said_so = f"{stage}: {DIED}"
        return RunEnd(EXIT_FAULT, stage, said_so, True, duration_s, worker_died=True)
    # A shell reports a process that a signal ended as 128 + signal (137: killed for memory).
    transient = stage_code < 0 or stage_code > 128 or INFRASTRUCTURE.search(text) is not None
    return RunEnd(EXIT_FAULT, stage, sentence, transient, duration_s)


def _worker_died(stage: str, lines: Sequence[str]) -> bool:
    """Whether the last word of the traceback, before the stage's own, is that of a broken pool.

    An exception that such a death only led to is one of ours until somebody has looked.
    """
    own = [place for place, line in enumerate(lines) if line.startswith(f"{stage}: ")]
    before = [line for line in lines[: own[-1]] if line] if own else []
    return bool(before) and WORKER_DIED.match(before[-1]) is not None


if __name__ == "__main__":
    sys.exit(run_program("flows.commands:reproduce", "python -m flows.reproduce"))
