"""Every event that executor, stub, supervisor and recovery write, whole and in its order, golden.

One session in which everything happens that a session of the rig can meet. Which event belongs
where is shown by the tests of those who write it; here no field, no time and no order moves unseen.
"""

import hashlib
import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from genpolicy.contract.chunk import DiscardReason
from genpolicy.evidence.shadow.rig import Rig, StandInContext, StandInScene, passing_verdict
from genpolicy.execution.journal import EVENT_FIELDS
from genpolicy.execution.recovery import Recovery

sys.path.insert(0, str(Path(__file__).parents[1]))
from held import hold
from playing import fall_back

GOLDEN = Path(__file__).parent / "golden"
OF_OTHERS = {"joined", "force", "push", "outcome", "person", "state", "latency"}
"""Written by those who vote, measure, move the arm or end an episode, and by who has the arm."""
JOINTS = 7
LONG = 200  # signs; what is longer is told by its hash


def told_apart(rig, first=0.0):
    """What a chunk was checked against, no two numbers of it alike."""
    numbers = iter(first + 0.001 * np.arange(200.0))

    def some(*shape):
        return np.array([next(numbers) for _ in range(math.prod(shape))]).reshape(shape)

    place, turn = some(3), some(4)
    rig.poses = {"post": (place, turn / np.linalg.norm(turn))}
    rig.executor.see(rig.now_s, rig.poses)
    return StandInContext(
        q_cmd=some(JOINTS), q_cmd_history=some(2, JOINTS), q_meas=some(JOINTS),
        dq_meas=some(JOINTS), measured_at_s=rig.now_s - 0.01,
        last_action=rig.context().last_action, scene=StandInScene(rig.poses),
    )  # fmt: skip


def drawn(rig, **changes):
    """A chunk with a context of which every part can be told from every other."""
    verdict = replace(passing_verdict(), q_rad=0.01 * np.arange(16.0 * JOINTS).reshape(16, JOINTS))
    return rig.chunk(context=told_apart(rig), verdict=verdict, **changes)


def chunks_come_and_go(rig):
    """In time, twice, too late, ahead, of another chain, too many, of another phase."""
    rig.observe()
    first = drawn(rig)
    rig.deliver(first)
    rig.tick(3)
    rig.deliver(first)
    earlier_s = rig.now_s - 0.65
    for changes in (
        {"policy_checkpoint_hash": "other"}, {"sampler_config_hash": "other"},
        {"predecessor_chunk_id": "ghost"}, {"valid_until_s": rig.now_s - 0.01},
        {"condition_observation_event_time_s": earlier_s}, {"task_phase": "insert"},
        {"condition_observation_event_time_s": rig.now_s + 0.01}, {"session_epoch": 7},
        {"verdict": passing_verdict(failed=2)},
    ):  # fmt: skip
        rig.observe()
        rig.deliver(rig.chunk(**changes))
    rig.deliver(None)
    for ahead in (0.2, 0.4, 0.6):
        rig.observe()
        rig.deliver(rig.chunk(action_start_time_s=rig.now_s + ahead))
        rig.tick()
    rig.executor.write_off(first.metadata, 16, DiscardReason.EXPIRED, rig.now_s)
    unmet = replace(first.metadata, chunk_id="never came")
    rig.executor.write_off(unmet, 9, DiscardReason.INFEASIBLE, rig.now_s)
    rig.observe(age_s=-1.0)
    rig.observe(age_s=0.5)
    rig.tick(20)


def the_world_changes(rig):
    """Force, collision, divergence, calibration, phase, checkpoint, controller."""
    rig.run(2)
    rig.executor.force_event(rig.now_s)
    rig.tick()
    rig.run(2)
    rig.executor.collision_event(rig.now_s)
    rig.run(2)
    rig.observe(divergence_m=0.06)
    rig.observe(divergence_m=0.05)
    rig.run(2)
    rig.epoch = "epoch-2"
    rig.observe()
    rig.run(2)
    rig.phase = "insert"
    rig.observe()
    rig.run(2)
    rig.executor.set_active(rig.now_s, "d" * 64, "6" * 64)
    rig.executor.set_active(rig.now_s, "c" * 64, "5" * 64)
    rig.run(2)
    rig.executor.controller(rig.now_s, "another")
    rig.executor.controller(rig.now_s, rig.cell.controller_mode)
    rig.run(2)


def somebody_else_commands(rig):
    """A recovery by the fallback, a person, a reset; offers that are no row of a chunk."""
    recovery = Recovery(rig.cell.execution, rig.journal)
    recovery.trigger(rig.now_s, rig.phase, "divergence")
    recovery.feel(rig.now_s, 4.5)
    recovery.feel(rig.now_s, 4.25)
    fall_back(rig, recovery, ticks=3)
    recovery.primitive_failed(rig.now_s, "lost")
    recovery.stop(rig.now_s, "force")
    recovery.human_reset(rig.now_s, "Ann")
    rig.executor.end_fallback(rig.now_s)
    rig.run(2)
    rig.executor.intervene(rig.now_s)
    rig.tick()
    rig.executor.hand_back(rig.now_s)
    rig.run(2)
    rig.executor.reset(rig.now_s)
    rig.run(3)
    offered = {"row": 0, "source": "policy", "arrival": 90, "now_ns": rig.now_ns}
    rig.stub.offer(None, np.zeros(10), sequence=900, **offered)
    rig.stub.offer(rig.chunk(), np.zeros(10), sequence=901, **offered)


def it_stops(rig):
    """Silence, a clock that nobody believes, force, a person, the switch."""
    rig.run(2)
    rig.advance(0.3)
    rig.run(2)
    rig.executor.tick(math.nan)
    rig.executor.tick(rig.now_s + 3600.0)
    rig.executor.tick(0.0)
    rig.supervisor.observe_force(rig.now_s, 40.0, "insert")
    rig.supervisor.observe_force(rig.now_s, 40.5, "insert")
    rig.tick()
    rig.supervisor.human_reset(rig.now_s, "Ann")
    rig.run(2)
    rig.supervisor.observe_collision(rig.now_s, True)
    rig.supervisor.human_reset(rig.now_s, "Ann")
    rig.supervisor.emergency_stop(rig.now_s, "the red one")
    rig.supervisor.observe_force(rig.now_s, math.nan, "insert")
    rig.tick()
    rig.supervisor.human_reset(rig.now_s, "Ann")
    rig.tick()
    rig.run(2)


def told_to_the_journal(rig):
    """What policies and feasibility have it write down."""
    history = np.arange(20.0).reshape(2, 10)
    rig.journal.exposure(rig.now_s, history[-1])
    rig.journal.arrived(rig.now_s, exposed_s=rig.now_s)
    rig.executor.begin_invocation(rig.now_s, "i-1", "asked")
    key = ("drawn", 3)
    rig.journal.conditioning(
        rig.now_s, invocation_id="i-1", exposed_s=rig.now_s, key=key, history=history
    )
    rig.journal.candidate(
        rig.now_s, chunk_id="x", method="flow", index=2, layers={"representation": True},
        first_reason="workspace", measures={"votes": 3},
    )  # fmt: skip
    rig.see(post=0.1)
    rig.executor.end_invocation(rig.now_s, "i-1", "answered")


def shortened(value):
    """A payload whose long texts, rows of numbers in hex, are told by their hash."""
    if isinstance(value, dict):
        return {key: shortened(item) for key, item in value.items()}
    if isinstance(value, str) and len(value) > LONG:
        return f"{len(value)} signs, {hashlib.sha256(value.encode()).hexdigest()[:16]}"
    return str(value) if isinstance(value, str) else value


def test_a_session_writes_the_events_that_it_wrote():
    rig = Rig(session="golden", labels={"method": "rig"})
    told_to_the_journal(rig)
    for part in (chunks_come_and_go, the_world_changes, somebody_else_commands, it_stops):
        rig.observe()
        part(rig)
    events = rig.end()
    assert {event.kind for event in events} == set(EVENT_FIELDS) - OF_OTHERS
    assert rig.executor.conservation().error == 0
    reasons = {e.payload["reason"] for e in events if e.kind in ("discard", "refuse")}
    assert reasons == set(DiscardReason) - {DiscardReason.OUT_OF_ORDER}
    counted = {
        name: getattr(rig.stub, name) for name in ("arrivals", "accepted", "stale", "invalid")
    }
    found = {f"{e.n:03d} {e.kind} {e.t}": shortened(e.payload) for e in events}
    hold(GOLDEN / "journal.json", found | {"counted": counted})
