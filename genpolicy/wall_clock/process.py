"""The supervisor's process: `python -m genpolicy.wall_clock.process FOLDER --answers FD …`.

Supervisor, controller stub, executor and admission; no policy, no sampler, no torch, which it
refuses to run beside. It reads its limits by itself from the pinned file, and believes nothing of
who started it. Where a session of the folder left a stop behind, or died, it begins stopped.

Exit codes: 0 the replay ended, 1 a fault of ours, 2 refused before the first tick.
"""

import argparse
import json
import signal
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from genpolicy.errors import BadInputError, ConfigError
from genpolicy.evidence.admission_context import make_checker
from genpolicy.execution.nanoseconds import NEVER_NS
from genpolicy.execution.supervisor import SupervisorState
from genpolicy.feasibility.admission import FeasibilityChecker
from genpolicy.integrity.atomic import write_bytes
from genpolicy.tasks.api import Task, load_task
from genpolicy.wall_clock.admission import AdmissionThread, judge
from genpolicy.wall_clock.channel import Inbox, Outbox
from genpolicy.wall_clock.limits import WallClockLimits, read_limits
from genpolicy.wall_clock.loop import Clock, Loop
from genpolicy.wall_clock.request import OUTCOME, WallClockRequest, read_request
from genpolicy.wall_clock.session import SupervisedSession
from genpolicy.wall_clock.streamed import (
    StreamedJournal,
    session_file,
    sessions_of,
    stop_may_stand,
)

LEARNED = ("torch", "genpolicy.policies", "genpolicy.candidates.judged")
"""What may not be loaded beside a supervisor."""
SWITCH_INTERVAL_S = 0.001
"""How soon a tick gets the interpreter while an answer is judged."""


def main(arguments: Sequence[str] | None = None, *, clock: Clock = time.monotonic) -> int:
    """Run the supervisor's process to its end.

    Args:
        arguments: Folder and descriptors; those of the process if absent.
        clock: Monotonic, s.

    Returns:
        The exit code.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal stops its reader
    parser = argparse.ArgumentParser(prog="genpolicy.wall_clock.process")
    parser.add_argument("folder", type=Path)
    for name in ("answers", "asks", "operator"):
        parser.add_argument(f"--{name}", type=int, required=True, help="file descriptor")
    given = parser.parse_args(arguments)
    try:
        _refuse_learned()
        request = read_request(given.folder)
        limits = read_limits(Path(request.root))
        task, checker = _cell(limits)
        sessions = _sessions(given.folder, request, limits, task)
        session = next(sessions)
    except BadInputError as error:
        print(error, file=sys.stderr)
        return error.exit_code
    sys.setswitchinterval(SWITCH_INTERVAL_S)
    answers, operator, asks = Inbox(given.answers), Inbox(given.operator), Outbox(given.asks)
    admission = AdmissionThread(partial(judge, task, checker))
    while True:
        loop = Loop(
            session, rows=len(session.replay), answers=answers, asks=asks, operator=operator,
            admission=admission, clock=clock,
        )  # fmt: skip
        loop.run()
        _conclude(given.folder, request, loop, {"answers": answers, "operator": operator})
        over = session.ended or operator.closed or bool(session.journal.lost)
        over = over or session.stub.supervisor.state is SupervisorState.EMERGENCY_STOP
        following = None if over else next(sessions, None)
        if following is None:
            return 0
        session = following


def _sessions(
    folder: Path, request: WallClockRequest, limits: WallClockLimits, task: Task
) -> Iterator[SupervisedSession]:
    """A session for each replay; one that goes on in the folder of a stop begins stopped."""
    earlier = sessions_of(folder)
    stands = bool(earlier) and stop_may_stand(earlier[-1])
    for number, replay in enumerate((request.replay, *request.then), start=len(earlier)):
        name = f"{request.method}/wall_clock/{number}"
        labels = {"method": request.method, "episode": replay.episode_uuid}
        journal = StreamedJournal(name, session_file(folder, number), labels)
        one = request.model_copy(update={"replay": replay, "then": ()})
        yield SupervisedSession(task, limits.cell, one, journal, stop_stands=stands)
        stands = False


def _refuse_learned() -> None:
    """A process that has loaded a policy is not the supervisor's."""
    loaded = sorted(set(LEARNED) & set(sys.modules))
    if loaded:
        raise ConfigError(
            where="the supervisor's process",
            found=f"with {', '.join(loaded)} loaded",
            expected="one of its own, without policies",
            action="Start it by `genpolicy shadow`.",
        )


def _cell(limits: WallClockLimits) -> tuple[Task, FeasibilityChecker]:
    """The task and its six layers, where the limits are for it."""
    task = load_task(limits.task)
    limits.cell.require_task(task.phases)
    checker = make_checker(
        task, limits.feasibility, action_period_s=limits.horizons.action_period_s
    )
    checker.cell.require_within(limits.execution.force_limit_n)
    return task, checker


def _conclude(
    folder: Path, request: WallClockRequest, loop: Loop, inboxes: dict[str, Inbox]
) -> None:
    """End the session and write down what was counted."""
    session, journal = loop.session, loop.session.journal
    newest_ns = journal.latest_ns
    balance = session.end(newest_ns / 1e9 if newest_ns != NEVER_NS else 0.0)
    journal.close()
    dropped: Counter[str] = Counter(session.tally.dropped)
    for name, inbox in inboxes.items():
        dropped.update({f"{name}_{why}": count for why, count in inbox.dropped.items() if count})
    stub = session.stub
    outcome: dict[str, Any] = {
        "session": journal.session, "method": request.method, "ticks": loop.ticks,
        "missed": loop.missed, "throttled": loop.throttled,
        "state": str(stub.supervisor.state), "stops": stub.supervisor.stops,
        "arrivals": stub.arrivals, "accepted": stub.accepted, "stale": stub.stale,
        "invalid": stub.invalid, "conservation_error": balance.error, **balance.as_dict(),
        "clock_doubts": journal.doubts, "dropped": dict(sorted(dropped.items())),
        "policy_gone": inboxes["answers"].closed, "journal_lost": journal.lost,
        "learned": sorted(set(LEARNED) & set(sys.modules)),
        "judged_again": session.tally.again,
        "late_s": session.tally.late_s, "decided_s": session.tally.decided_s,
    }  # fmt: skip
    write_bytes(folder / OUTCOME, json.dumps(outcome, sort_keys=True, indent=1).encode())


if __name__ == "__main__":
    sys.exit(main())
