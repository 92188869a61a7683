"""What the tests of the wall clock share: a workspace, a replay, a run, and what became of it."""

import json
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from genpolicy.evidence.admission_context import make_checker
from genpolicy.evidence.shadow.rig import CHECKPOINT, SAMPLER
from genpolicy.evidence.shadow.tables import checker_document
from genpolicy.tasks.api import WorldSettings, load_task
from genpolicy.wall_clock.limits import LIMITS, pin_limits, read_limits
from genpolicy.wall_clock.replay import Replay
from genpolicy.wall_clock.request import WallClockRequest
from genpolicy.wall_clock.run import SUPERVISOR, start
from genpolicy.wall_clock.streamed import JOURNAL, recovered, session_file, sessions_of

ROOT = Path(__file__).parents[2]
HERE = Path(__file__).parent
GUARD_S = 120.0
"""After so long something hangs; nothing is judged by how long it took, s."""
PERIOD_S = 0.2
POLL_S = 0.1
SLOW = {"deadline_s": 1.2, "watchdog_s": 2.0, "maximum_age_s": 1.3, "silence_stop_s": 4.0}


def workspace(root: Path, **changes: Any) -> Path:
    """A workspace with the limits of the checkout, slower, and pins."""
    limits = yaml.safe_load((ROOT / LIMITS).read_text())
    limits["horizons"]["action_period_s"] = PERIOD_S
    limits["execution"].update(SLOW | changes)
    (root / LIMITS).write_text(yaml.safe_dump(limits))
    (root / "fixtures.yaml").write_bytes((ROOT / "fixtures.yaml").read_bytes())
    pin_limits(root)
    return root


def still_replay(task: Any, *, rows: int) -> Replay:
    """An arm that stands where a world begins."""
    world = task.make_world(
        task.sample_start(np.random.default_rng(0)),
        settings=WorldSettings(task.calibration_epochs[0]),
    )
    seen = world.observe()
    return Replay(
        episode_uuid="still",
        calibration_epoch=task.calibration_epochs[0],
        phases=(world.phase,) * rows,
        observations=(tuple(seen.tolist()),) * rows,
        actions=(tuple(task.action_at(seen).tolist()),) * rows,
        forces_n=(0.0,) * rows,
    )


def request_of(root: Path, replay: Replay) -> WallClockRequest:
    return WallClockRequest(
        root=str(root), method="scripted", checkpoint=CHECKPOINT, sampler=SAMPLER, replay=replay
    )


def scripted(behaviour: str, replay: Replay) -> list[str]:
    """Command of a policy's process that behaves so, and keeps the arm where the replay begins."""
    told = {"checkpoint": CHECKPOINT, "sampler": SAMPLER, "method": "scripted",
            "action": replay.actions[0]}  # fmt: skip
    return [sys.executable, str(HERE / "scripted_policy.py"), behaviour, json.dumps(told)]


def broken_clock(fault: str) -> list[str]:
    """Command of the supervisor's process on a clock with a fault."""
    return [sys.executable, str(HERE / "supervisor_on_a_broken_clock.py"), fault]


def begun(root, folder, replay, behaviour, supervisor=SUPERVISOR, *, ready=True):
    """A run whose clock begins when the policy's process has loaded, or, not `ready`, at once."""
    return start(
        folder,
        request_of(root, replay),
        scripted(behaviour, replay),
        supervisor=supervisor,
        ready=ready,
    )


def linked(pinned: Path, root: Path) -> Path:
    """The pinned workspace; a folder of runs of its own."""
    for name in (LIMITS, "fixtures.yaml"):
        (root / name).write_bytes((pinned / name).read_bytes())
    return root


def lasting(replay: Replay, rows: int) -> Replay:
    """The replay again and again, until it has so many rows."""
    times = -(-rows // len(replay))
    many = {name: (getattr(replay, name) * times)[:rows]
            for name in ("phases", "observations", "actions", "forces_n")}  # fmt: skip
    return replay.model_copy(update=many)


def has(found: list[Any], kind: str, times: int = 1) -> bool:
    return sum(event.kind == kind for event in found) >= times


def events(folder: Path, number: int = 0) -> list[Any]:
    path = session_file(folder, number)
    return recovered(path) if path.exists() else []


def wait_for(happened) -> Any:
    """The first answer that is not empty; what never comes is ended as a test that hangs."""
    while not (found := happened()):
        time.sleep(POLL_S)
    return found


@dataclass(frozen=True)
class Ended:
    """What a run left: outcome, events of its session, rules that the checker found broken."""

    outcome: dict[str, Any]
    events: list[Any]
    violations: set[str]

    def supervisor(self) -> list[str]:
        return [e.payload["event"] for e in self.events if e.kind == "supervisor"]

    def kinds(self) -> list[str]:
        return [e.kind for e in self.events]

    def accepted_after(self, event: str) -> int:
        """Commands behind the first event of the supervisor of that name."""
        at = next(e.n for e in self.events
                  if e.kind == "supervisor" and e.payload["event"] == event)  # fmt: skip
        return sum(e.kind in ("accept", "fallback") for e in self.events if e.n > at)


def ended(running, number: int = 0) -> Ended:
    outcome = running.wait(GUARD_S)
    return Ended(outcome, events(running.folder, number), violations(running.folder))


def answered(root: Path, replay: Replay, behaviour: str) -> Ended:
    """A run in which the first answer came in time, the third at the latest.

    On a machine that is busy with something else it may not, and then there is nothing to stop.
    """
    for attempt in range(3):
        seen = ended(begun(root, root / f"run_{attempt}", replay, behaviour))
        if seen.outcome["accepted"]:
            break
    return seen


def violations(folder: Path) -> set[str]:
    """Rules that the independent checker finds broken, the motion proved again by MuJoCo."""
    limits = read_limits(folder.parent)
    checker = make_checker(load_task(limits.task), limits.feasibility, action_period_s=PERIOD_S)
    found = checker_document([folder / JOURNAL], cell=limits.cell, robot=checker.cell)
    accepted = sum(e.kind == "accept" for events in sessions_of(folder) for e in events)
    assert found.reproved_actions == accepted
    return {violation.rule for violation in found.violations}
