"""What a process of its own costs: ticks and decisions by the wall clock, against direct calls.

A policy that answers at once keeps the arm where it stands, once through the two processes of
`genpolicy shadow` and once by calling the same objects of the virtual mode directly, in this
process, with nothing in between. Printed are p50, p95 and the maximum of how late a tick is, of
the time from an answer to the decision on it, and of the latter the ratio to the direct call.

    python -m benchmarks.wall_clock
"""

import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from genpolicy.evidence.admission_context import make_checker
from genpolicy.evidence.shadow.rig import CHECKPOINT, SAMPLER
from genpolicy.tasks.api import Task, WorldSettings, load_task
from genpolicy.wall_clock.admission import Job, judge
from genpolicy.wall_clock.limits import WallClockLimits, read_limits
from genpolicy.wall_clock.messages import Answer
from genpolicy.wall_clock.replay import Replay
from genpolicy.wall_clock.request import WallClockRequest
from genpolicy.wall_clock.run import start
from genpolicy.wall_clock.session import SupervisedSession
from genpolicy.wall_clock.streamed import StreamedJournal

ROOT = Path(__file__).parents[1]
POLICY = ROOT / "tests" / "wall_clock" / "scripted_policy.py"
ROWS = 200
PERCENTILES = (50, 95, 100)


def still(task: Task, rows: int) -> Replay:
    world = task.make_world(
        task.sample_start(np.random.default_rng(0)),
        settings=WorldSettings(task.calibration_epochs[0]),
    )
    seen = world.observe()
    return Replay(
        episode_uuid="still", calibration_epoch=task.calibration_epochs[0],
        phases=(world.phase,) * rows, observations=(tuple(seen.tolist()),) * rows,
        actions=(tuple(task.action_at(seen).tolist()),) * rows, forces_n=(0.0,) * rows,
    )  # fmt: skip


def direct(request: WallClockRequest, limits: WallClockLimits, task: Task, folder: Path):
    """Seconds of each decision and each tick, by direct calls on a clock that is told."""
    period_s = limits.horizons.action_period_s
    checker = make_checker(task, limits.feasibility, action_period_s=period_s)
    journal = StreamedJournal("direct", folder / "direct.mcap")
    session = SupervisedSession(task, limits.cell, request, journal, stop_stands=False)
    actions = np.tile(request.replay.action_rows[0], (limits.horizons.prediction_horizon, 1))
    jobs: list[Job] = []

    def take(job: Job) -> bool:
        jobs.append(job)
        return True

    decisions, ticks = [], []
    for row in range(ROWS):
        now_s = row * period_s
        begin = time.perf_counter()
        ask = session.tick(now_s, row)
        ticks.append(time.perf_counter() - begin)
        if ask is None:
            continue
        answer = Answer(ask.invocation, CHECKPOINT, SAMPLER, "scripted", actions)
        begin = time.perf_counter()
        session.answer(answer, now_s, take)
        session.decide(jobs[-1], judge(task, checker, jobs[-1]), now_s, take)
        decisions.append(time.perf_counter() - begin)
    session.end(ROWS * period_s)
    return decisions, ticks, session.stub.accepted


def told(name: str, seconds: list[float]) -> list[float]:
    found = np.percentile(seconds, PERCENTILES)
    print(f"{name:<38}" + "".join(f"{1e3 * value:10.3f}" for value in found) + f"{len(seconds):8}")
    return found.tolist()


def main() -> None:
    task, limits = load_task("tabletop_insertion"), read_limits(ROOT)
    request = WallClockRequest(
        root=str(ROOT), method="scripted", checkpoint=CHECKPOINT, sampler=SAMPLER,
        replay=still(task, ROWS),
    )  # fmt: skip
    with TemporaryDirectory() as scratch:
        folder = Path(scratch)
        running = start(folder / "run", request, [sys.executable, str(POLICY), "good"])
        outcome = running.wait()
        decisions, ticks, accepted = direct(request, limits, task, folder)
    print(f"{'ms':<38}{'p50':>10}{'p95':>10}{'max':>10}{'n':>8}")
    told("two processes: a tick is late by", outcome["late_s"])
    ours = told("two processes: answer to decision", outcome["decided_s"])
    theirs = told("direct calls: answer to decision", decisions)
    told("direct calls: a tick", ticks)
    ratios = ", ".join(f"{a / b:.2f}" for a, b in zip(ours, theirs, strict=True))
    print(f"ratio of the decisions, two processes to direct calls: {ratios}")
    missed = outcome["missed"]
    print(f"accepted {outcome['accepted']} of {accepted}, {missed} rows missed, {outcome['state']}")


if __name__ == "__main__":
    main()
