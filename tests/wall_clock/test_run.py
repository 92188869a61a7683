"""Incidents through real processes: what is injected, what is expected, what is seen.

Nothing is judged by how long it took: events, counts and their order decide.
"""

import contextlib
import json
import os
import signal
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import pytest
from arranged import (
    HERE,
    SLOW,
    answered,
    begun,
    broken_clock,
    ended,
    events,
    has,
    lasting,
    violations,
    wait_for,
    workspace,
)
from together import together

from genpolicy.errors import ConfigError, GenpolicyError
from genpolicy.wall_clock.messages import Order
from genpolicy.wall_clock.process import LEARNED
from genpolicy.wall_clock.run import SUPERVISOR

RUN, PROTECTIVE, EMERGENCY = "run", "protective_stop", "emergency_stop"


@dataclass(frozen=True)
class Incident:
    """One row of the table.

    Attributes:
        injected: Behaviour of the policy's process; the first invocation is answered well.
        dropped: What must be counted, at least once each.
        discarded: Reasons that chunks must be discarded by; no others may be.
        stops: It must come to hold, then stop for silence.
    """

    injected: str
    dropped: tuple[str, ...] = ()
    discarded: tuple[str, ...] = ("expired",)
    stops: bool = True


TABLE = (
    Incident("hang", ("deadline",)),
    Incident("die", ("deadline", "ask_not_sent")),
    Incident("die_in_a_frame", ("answers_truncated", "deadline")),
    Incident("garbage", ("answers_garbage_bytes", "deadline")),
    Incident("no_json", ("malformed", "deadline")),
    Incident("oversize", ("answers_oversize", "answers_garbage_bytes", "deadline")),
    Incident("late", ("unsolicited", "deadline")),
    Incident("nan", (), ("infeasible",)),
    Incident("one_row", (), ("infeasible",)),
    Incident("other_weights", (), ("checkpoint_mismatch",)),
)


@together
def test_a_supervisor_that_is_killed_leaves_a_journal_and_begins_stopped(root, standing):
    running = begun(root, root / "run", standing, "good")
    wait_for(lambda: has(events(running.folder), "accept"))
    running.supervisor.kill()
    with pytest.raises(GenpolicyError, match="died with -9"):
        running.wait(60.0)
    assert running.policy.returncode is not None
    left = events(running.folder)
    assert has(left, "accept") and not has(left, "end")
    assert violations(running.folder) == {"journal.no_end"}  # whole, but for its end

    brief = lasting(standing, 15)
    again = ended(begun(root, root / "run", brief, "good"), number=1)
    assert again.supervisor() == ["restarted"]
    assert (again.outcome["accepted"], again.outcome["state"]) == (0, PROTECTIVE)
    assert again.violations == {"journal.no_end"}  # of the session before

    after = ended(begun(root, root / "run", brief, "good"), number=2)
    assert (after.supervisor(), after.outcome["accepted"]) == (["restarted"], 0)  # still stopped

    cleared = begun(root, root / "run", lasting(standing, 45), "good")
    wait_for(lambda: has(events(running.folder, 3), "supervisor"))
    cleared.say(Order.RESET, "spotter")
    seen = ended(cleared, number=3)
    assert seen.supervisor() == ["restarted", "human_reset"]
    assert seen.outcome["accepted"] > 0
    fresh = ended(begun(root, root / "run", brief, "good"), number=4)
    assert fresh.supervisor() == []  # a person has looked


@pytest.mark.parametrize("incident", TABLE, ids=lambda row: row.injected)
@together
def test_a_policy_that_fails_is_held_then_stopped_for(incident, root, standing):
    seen = answered(root, standing, incident.injected)
    outcome = seen.outcome
    assert seen.violations == set()
    assert seen.kinds().count("accept") == outcome["accepted"] > 0
    assert (outcome["stale"], outcome["invalid"], outcome["conservation_error"]) == (0, 0, 0)
    assert set(incident.dropped) <= set(outcome["dropped"])
    # The stop takes away what it finds; an interrupted chunk counts as executed.
    assert set(incident.discarded) <= set(outcome["chunks"]["discarded"])
    assert set(outcome["chunks"]["discarded"]) <= {*incident.discarded, "stopped"}
    assert seen.supervisor() == ["watchdog", "silence"]
    assert outcome["state"] == PROTECTIVE
    assert seen.accepted_after("watchdog") == seen.accepted_after("silence") == 0
    assert outcome["ticks"] + outcome["missed"] == len(standing)


@together
def test_a_policy_that_answers_is_executed(root, standing):
    seen = answered(root, standing, "good")
    assert seen.violations == set()
    assert (seen.outcome["state"], seen.outcome["dropped"]) == (RUN, {})
    assert seen.outcome["accepted"] > 0 and seen.outcome["chunks"]["executed"] > 1


@together
def test_a_flood_stays_in_its_pipe(root, standing):
    """It may keep the policy's own answers from coming in time, and the supervisor from nothing."""
    seen = ended(begun(root, root / "run", standing, "flood"))
    assert seen.violations == set()
    assert seen.outcome["ticks"] + seen.outcome["missed"] == len(standing)
    assert seen.outcome["dropped"]["malformed"] > 0
    assert seen.outcome["dropped"]["unsolicited"] > 0
    assert seen.outcome["throttled"] > 0
    assert seen.kinds().count("observation") < 3 * len(standing)  # the flood is in no journal


@together
def test_words_of_a_person_from_the_policy_are_no_words_of_a_person(root, standing):
    """The policy resets, after the operator has stopped: nothing moves any more."""
    running = begun(root, root / "run", standing, "operator")
    wait_for(lambda: has(events(running.folder), "accept"))
    assert running.say(Order.EMERGENCY_STOP, "spotter")
    seen = ended(running)
    assert seen.outcome["state"] == EMERGENCY
    assert seen.supervisor() == ["emergency_stop"]
    assert seen.accepted_after("emergency_stop") == 0
    assert seen.violations == set()


@together
def test_a_stop_outlives_the_policy_and_ends_with_a_person(root, standing):
    running = begun(root, root / "run", lasting(standing, 60), "good")
    wait_for(lambda: has(events(running.folder), "accept"))
    running.say(Order.EMERGENCY_STOP, "spotter")
    wait_for(lambda: has(events(running.folder), "supervisor"))
    running.say(Order.RESET, "  ")  # a reset without a person
    running.say(Order.RESET, "spotter")
    wait_for(lambda: has(events(running.folder), "supervisor", 2))
    at = len(events(running.folder))
    wait_for(lambda: has(events(running.folder)[at:], "accept"))
    running.say(Order.EMERGENCY_STOP, "spotter")
    wait_for(lambda: has(events(running.folder), "supervisor", 3))
    running.policy.kill()
    seen = ended(running)
    assert seen.outcome["state"] == EMERGENCY and seen.outcome["policy_gone"]
    assert seen.supervisor() == ["emergency_stop", "human_reset", "emergency_stop"]
    assert seen.outcome["dropped"]["reset_without_a_person"] == 1
    assert seen.violations == set()


@together
def test_where_nobody_can_stop_it_any_more_it_stops(root, standing):
    running = begun(root, root / "run", lasting(standing, 20 * len(standing)), "good", ready=False)
    wait_for(lambda: has(events(running.folder), "accept"))
    running.operator.close()
    seen = ended(running)
    assert seen.outcome["state"] == EMERGENCY
    assert seen.outcome["ticks"] < 20 * len(standing)
    assert seen.violations == set()


@pytest.mark.parametrize("fault", ["stands", "back", "ahead", "nan"])
@together
def test_a_clock_that_is_not_believed_holds_then_stops(fault, root, standing):
    running = begun(root, root / "run", lasting(standing, 45), "good", broken_clock(fault))
    seen = ended(running)
    held = {"stands": "no_time", "nan": "no_time", "back": "clock_backwards", "ahead": "stopped"}
    reasons = [e.payload["reason"] for e in seen.events if e.kind == "hold"]
    assert held[fault] in reasons
    assert seen.outcome["state"] == EMERGENCY and seen.outcome["clock_doubts"] > 0
    assert seen.supervisor()[0] == ("silence" if fault == "ahead" else "watchdog")
    assert seen.supervisor()[-1] == "emergency_stop"
    assert seen.accepted_after(seen.supervisor()[0]) == 0
    assert seen.violations == set()


@together
def test_a_supervisor_that_was_paused_stops_before_anything_moves(root, standing):
    """What it slept through is late and silent; the checker sees that nobody was there to hold."""
    running = begun(root, root / "run", lasting(standing, 60), "good")
    wait_for(lambda: has(events(running.folder), "accept"))
    running.supervisor.send_signal(signal.SIGSTOP)
    time.sleep(1.5 * SLOW["silence_stop_s"])
    running.supervisor.send_signal(signal.SIGCONT)
    seen = ended(running)
    assert seen.supervisor()[-1] == "silence" and seen.outcome["state"] == PROTECTIVE
    assert seen.accepted_after("silence") == 0 and seen.outcome["missed"] > 0
    assert seen.violations == {"P2.watchdog"}


@pytest.mark.parametrize("changed", ["limits.yaml", "fixtures.yaml"])
def test_a_changed_byte_refuses_the_run_before_the_first_tick(changed, standing, tmp_path):
    root = workspace(tmp_path)
    data = bytearray((root / changed).read_bytes())
    at = data.rindex(b"2.0") if changed == "limits.yaml" else data.rindex(b":") + 8
    data[at] = ord("9") if data[at] != ord("9") else ord("8")
    (root / changed).write_bytes(bytes(data))
    with pytest.raises(ConfigError, match="as pinned"):
        begun(root, root / "run", standing, "good")
    assert not (root / "run").exists()


def test_a_byte_that_changes_after_the_start_is_refused_by_the_supervisor_itself(
    standing, tmp_path, monkeypatch
):
    root = workspace(tmp_path)
    (root / "limits.yaml").write_bytes((root / "limits.yaml").read_bytes() + b"\n")
    monkeypatch.setattr("genpolicy.wall_clock.run.read_limits", lambda root: None)
    running = begun(root, root / "run", standing, "good", ready=False)
    with pytest.raises(ConfigError, match=r"limits\.yaml is .* as pinned"):
        running.wait(60.0)
    assert not list((root / "run").glob("*.mcap"))


@together
def test_the_supervisor_loads_no_policy(root, standing):
    """Read from the process itself, at its end."""
    report = root / "modules.json"
    wrapped = [sys.executable, str(HERE / "supervisor_that_tells_its_modules.py"), str(report)]
    seen = ended(begun(root, root / "run", standing, "good", wrapped))
    assert seen.outcome["accepted"] > 0 and seen.outcome["learned"] == []
    loaded = set(json.loads(report.read_text()))
    assert "genpolicy.execution.supervisor" in loaded
    words = ("torch", "policies", "samplers", "diffusers", "torchdiffeq", "pandas", "sklearn")
    assert not [name for name in loaded if set(name.split(".")) & set(words)]


@together
def test_a_supervisor_beside_a_policy_refuses(root, standing):
    code = "import sys, torch; from genpolicy.wall_clock.process import main; sys.exit(main())"
    running = begun(root, root / "run", standing, "good", [sys.executable, "-c", code], ready=False)
    with pytest.raises(ConfigError, match="torch loaded"):
        running.wait(60.0)
    assert "torch" in LEARNED and SUPERVISOR[-1].endswith("wall_clock.process")


@together
def test_the_policy_holds_no_end_of_the_operators_channel(root, standing):
    running = begun(root, root / "run", standing, "good", ready=False)
    try:
        theirs = pipes(running.policy.pid)
        operator = os.fstat(running.operator._descriptor).st_ino
        assert operator in pipes(os.getpid()) and operator not in theirs
    finally:
        os.killpg(running.supervisor.pid, signal.SIGKILL)
        with pytest.raises(GenpolicyError):
            running.wait(60.0)


def pipes(pid: int) -> set[int]:
    """Inodes of the pipes that a process has open."""
    names = []
    for path in Path(f"/proc/{pid}/fd").iterdir():
        with contextlib.suppress(FileNotFoundError):  # the folder's own, while it is read
            names.append(os.readlink(path))
    return {int(name[6:-1]) for name in names if name.startswith("pipe:")}
