"""Any order of anything, judged by the independent checker and by conservation.

The policy here is adversarial: it delivers valid, forged, late, reordered, repeated and malformed
chunks at any time, between phase changes, forces, stops, resets, interventions and pauses.
"""

import math

import numpy as np
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from genpolicy.evidence.shadow.rig import CHECKPOINT, ROWS, SAMPLER, Rig, passing_verdict
from genpolicy.execution.cell import FALLBACK_HASH
from genpolicy.verification.checker import check_messages

FORGERIES = {
    "hash": lambda rig: {"actions_sha256": "0" * 64},
    "layer": lambda rig: {"verdict": passing_verdict(failed=4)},
    "rows": lambda rig: {"verdict": passing_verdict(rows=(2, 5))},
    "nan": lambda rig: {"actions": np.full((ROWS, 10), math.nan)},
    "shape": lambda rig: {"actions": np.zeros((ROWS, 9))},
    "empty": lambda rig: {"actions": np.zeros((0, 10))},
    "long": lambda rig: {"actions": rig.actions(7, rows=40)},
    "period": lambda rig: {"action_period_s": 0.1},
    "future": lambda rig: {"condition_observation_event_time_s": rig.now_s + 0.01},
    "old": lambda rig: {"condition_observation_event_time_s": rig.now_s - 5.0},
    "expired": lambda rig: {"valid_until_s": rig.now_s - 0.01},
    "forever": lambda rig: {"valid_until_s": 1e300},
    "past start": lambda rig: {"action_start_time_s": rig.now_s - 1.0},
    "far start": lambda rig: {"action_start_time_s": rig.now_s + 100.0},
    "late start": lambda rig: {"action_start_time_s": rig.now_s - 0.12},
    "next start": lambda rig: {"action_start_time_s": rig.now_s + 0.11},
    "off grid": lambda rig: {"action_start_time_s": rig.now_s + 0.0173},
    "phase": lambda rig: {"task_phase": "insert"},
    "epoch": lambda rig: {"calibration_epoch": "epoch-2"},
    "weights": lambda rig: {"policy_checkpoint_hash": "e" * 64},
    "sampler": lambda rig: {"sampler_config_hash": "e" * 64},
    "session": lambda rig: {"session_epoch": 1},
    "ghost": lambda rig: {"predecessor_chunk_id": "ghost"},
    "replan": lambda rig: {"predecessor_chunk_id": ""},
    "id": lambda rig: {"chunk_id": "chunk-1"},
    "fallback": lambda rig: {"method": "fallback", "policy_checkpoint_hash": FALLBACK_HASH,
                             "sampler_config_hash": FALLBACK_HASH},
}  # fmt: skip
MALFORMED = (None, 3, "chunk", object(), np.zeros((16, 10)))


class Session(RuleBasedStateMachine):
    def __init__(self):
        super().__init__()
        self.rig = Rig()
        self.in_transit = []

    @initialize(queue_capacity=st.integers(1, 3), execution_horizon=st.sampled_from([1, 8, 16]))
    def begin(self, queue_capacity, execution_horizon):
        limits = {"queue_capacity": queue_capacity, "execution_horizon": execution_horizon}
        self.rig = Rig(**limits)

    @rule(age_s=st.sampled_from([0.0, 0.0, 0.03, 0.2, -0.01]))
    def observe(self, age_s):
        self.rig.observe(age_s)

    @rule(kinds=st.lists(st.sampled_from(sorted(FORGERIES)), max_size=2))
    def make_forged(self, kinds):
        changes = {}
        for kind in kinds:
            changes |= FORGERIES[kind](self.rig)
        self.in_transit.append(self.rig.chunk(**changes))

    @rule()
    def observe_and_deliver(self):
        self.rig.observe()
        self.rig.deliver(self.rig.chunk())

    @rule(data=st.data(), keep=st.booleans(), fallback=st.booleans())
    def deliver_from_transit(self, data, keep, fallback):
        if self.in_transit:
            chunk = data.draw(st.sampled_from(self.in_transit))
            if not keep:
                self.in_transit.remove(chunk)
            to = self.rig.executor.deliver_fallback if fallback else self.rig.executor.deliver
            to(chunk, self.rig.now_s)

    @rule(thing=st.sampled_from(MALFORMED))
    def deliver_malformed(self, thing):
        self.rig.deliver(thing)

    @rule(count=st.integers(1, 6))
    def tick(self, count):
        self.rig.tick(count)

    @rule(duration_s=st.sampled_from([0.001, 0.0173, 0.05, 0.3, 0.7]))
    def pause(self, duration_s):
        self.rig.advance(duration_s)

    @rule(back_s=st.sampled_from([0.01, 1.0]))
    def tick_with_a_clock_that_went_back(self, back_s):
        faults = self.rig.journal.doubts
        command = self.rig.executor.tick(self.rig.now_s - back_s)
        assert command.kind in ("hold", "stop") or self.rig.journal.doubts == faults

    @rule(phase=st.sampled_from(["approach", "approach", "insert", "unknown"]))
    def change_phase(self, phase):
        self.rig.phase = phase

    @rule(epoch=st.sampled_from(["epoch-1", "epoch-1", "epoch-2"]))
    def change_calibration(self, epoch):
        self.rig.epoch = epoch

    @rule(divergence_m=st.sampled_from([0.0, 0.2, math.nan]))
    def diverge(self, divergence_m):
        self.rig.observe(divergence_m=divergence_m)

    @rule(ticks=st.integers(0, 5), lead_s=st.sampled_from([0.0, 0.0, 0.1, 0.15]))
    def all_is_well(self, ticks, lead_s):
        rig = self.rig
        if rig.supervisor.stopped:
            rig.supervisor.human_reset(rig.now_s, "spotter")
        rig.executor.hand_back(rig.now_s)
        rig.executor.end_fallback(rig.now_s)
        rig.executor.set_active(rig.now_s, CHECKPOINT, SAMPLER)
        rig.phase, rig.epoch = "approach", "epoch-1"
        rig.observe()
        rig.deliver(rig.chunk(action_start_time_s=rig.now_s + lead_s))
        rig.tick(ticks)

    @rule()
    def the_fallback_commands(self):
        rig = self.rig
        rig.executor.begin_fallback(rig.now_s)
        rig.observe()
        chunk = rig.chunk(**FORGERIES["fallback"](rig), predecessor_chunk_id="")
        rig.executor.deliver_fallback(chunk, rig.now_s)
        rig.tick(2)

    @rule(event=st.sampled_from(["", "", "", "force_event", "collision_event", "reset", "intervene",
                                 "hand_back", "begin_fallback", "end_fallback"]))  # fmt: skip
    def happen(self, event):
        if event:
            getattr(self.rig.executor, event)(self.rig.now_s)

    @rule(checkpoint=st.sampled_from([CHECKPOINT, CHECKPOINT, "d" * 64]))
    def swap_checkpoint(self, checkpoint):
        self.rig.executor.set_active(self.rig.now_s, checkpoint, SAMPLER)

    @rule(force_n=st.sampled_from([1.0, 1.0, 1.0, 30.0, math.nan]), collision=st.booleans())
    def feel(self, force_n, collision):
        self.rig.supervisor.observe_force(self.rig.now_s, force_n, self.rig.phase)
        self.rig.supervisor.observe_collision(self.rig.now_s, collision and force_n > 20.0)

    @rule()
    def human_reset(self):
        self.rig.supervisor.human_reset(self.rig.now_s, "spotter")

    @invariant()
    def nothing_is_lost_or_counted_twice(self):
        balance = self.rig.executor.conservation()
        assert balance.error == 0
        assert balance.chunks.queued <= self.rig.cell.execution.queue_capacity

    @invariant()
    def the_stub_never_had_to_refuse(self):
        assert self.rig.stub.stale == 0 and self.rig.stub.invalid == 0

    def teardown(self):
        events = self.rig.end()
        report = check_messages(
            (e.kind, {"session": e.session, "n": e.n, "t": e.t, **e.payload}) for e in events
        )
        assert {v.rule for v in report.violations} == {"settings.checks"}  # `issued` is missing
        executed = self.rig.executor.conservation().actions.executed
        assert report.checked_actions + report.checked_fallback_actions == executed


TestSession = Session.TestCase
TestSession.settings = settings(
    max_examples=100,
    stateful_step_count=40,
    deadline=None,
    derandomize=True,
    suppress_health_check=list(HealthCheck),
)
