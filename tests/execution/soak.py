"""Random events against executor, stub and supervisor, judged by a model of its own.

    python -m benchmarks.soak events --wanted 20000000      (`make soak`)

The model knows nothing of the table of checks: it says who may command, from when on observations
count, and how far one command may lie from the last. What a session left is judged once more by
the independent checker. Chunks are honest in themselves: each begins one step from the last
command of the moment in which it is made. What happens to them is not.
"""

import math
import random
from dataclasses import dataclass, field, replace

import numpy as np

from genpolicy.contract.action import ACTION_DIM
from genpolicy.contract.chunk import DiscardReason
from genpolicy.evidence.shadow.rig import CHECKPOINT, IMITATED, ROWS, SAMPLER, Rig, passing_verdict
from genpolicy.execution.cell import FALLBACK_HASH
from genpolicy.execution.checks import Checks
from genpolicy.execution.supervisor import Supervisor
from genpolicy.verification.checker import check_messages

PERIOD_NS = 50_000_000
STEP_M = 0.025
"""From a row to the next: half a metre per second."""
NO_TIMES = (math.nan, math.inf, -math.inf, 1e300, 1e12, None, "now")
NO_FORCES = (math.nan, math.inf, -math.inf, -3.0, None, "x")
GARBAGE = (None, 3, object(), "chunk", np.zeros((16, 10)), [], {})
BENT = ({"chunk_id": []}, {"session_epoch": [1]}, {"task_phase": None}, {"valid_until_s": 1e12})
OPERATIONS = {
    "tick": 60, "observe": 8, "repair": 10, "deliver": 6, "make": 3, "deliver_late": 3, "pause": 2,
    "force": 1, "no_force": 1, "collision": 1, "stop": 1, "human_reset": 2, "intervene": 1,
    "hand_back": 2, "reset": 1, "phase": 1, "epoch": 1, "end": 1, "fallback": 1, "end_fallback": 1,
    "deliver_fallback": 2, "weights": 1, "controller": 1, "void": 1, "diverge": 1, "garbage": 1,
    "write_off": 1, "poll": 1, "restart": 1,
}  # fmt: skip
LATEST = 3  # row with which a chunk may begin where a late one is not continued
LASTS = 0.15  # chance that `end` ends


@dataclass
class Model:
    """Who may command what, as far as anybody outside can know it."""

    ended: bool = False
    person: bool = False
    stopped: bool = False
    void_s: float = -math.inf
    seen: tuple[str, str] | None = None
    position_m: np.ndarray = field(default_factory=lambda: np.zeros(3))
    told_m: np.ndarray | None = None
    last_s: float | None = None
    chunk_id: str = ""
    doubted: bool = False

    def saw(self, now_s: float, phase: str, epoch: str, told_m: np.ndarray | None) -> None:
        """An observation was used: another phase or calibration voids what is older."""
        self.told_m = told_m
        if self.seen not in (None, (phase, epoch)):
            self.void(now_s)
        self.seen = (phase, epoch)

    def void(self, now_s: float) -> None:
        """Nothing conditioned before counts any more."""
        self.void_s = max(self.void_s, now_s)

    def objections(self, rig: Rig, metadata, measured_s, command, now_s: float) -> list[str]:
        """What is wrong with a command that was accepted now."""
        action, begins = command.action, command.chunk_id != self.chunk_id
        age_s = now_s - metadata.condition_observation_event_time_s
        limit_s = rig.cell.execution.maximum_age_s.get(self.seen[0] if self.seen else "", -1.0)
        far_m = float(np.linalg.norm(action[:3] - self.position_m))
        near_m = rig.cell.execution.maximum_divergence_m + 1.01 * STEP_M
        here = self.told_m is not None and np.linalg.norm(action[:3] - self.told_m) <= near_m
        early = self.last_s is not None and now_s - self.last_s < 0.9 * PERIOD_NS / 1e9 - 1e-9
        wrongs = {
            "a command after the end": self.ended,
            "a command while a person commands": self.person,
            "a command while stopped": self.stopped,
            "later than its validity": now_s > metadata.valid_until_s + 1e-9,
            "older than allowed": age_s > limit_s + 1e-9,
            "of another phase or calibration": (metadata.task_phase, metadata.calibration_epoch)
            != self.seen,
            "conditioned before a voiding event": metadata.condition_observation_event_time_s
            < self.void_s - 1e-9,
            "checked from an arm before a voiding event": measured_s < self.void_s - 1e-9,
            "where the arm is not": self.last_s is None and not here,
            "begins late in contact": begins
            and command.action_index > LATEST
            and metadata.task_phase != "approach",
            "no number": not np.isfinite(action).all(),
            f"{far_m:.3f} m from the last command": self.last_s is not None
            and not far_m <= 1.01 * STEP_M,
            "too soon after the last command": early,
            "goes on after a hold": not begins
            and (self.doubted or (self.last_s is not None and now_s - self.last_s >= 0.075 - 1e-9)),
        }
        self.position_m, self.last_s = action[:3].copy(), now_s
        self.chunk_id, self.doubted = command.chunk_id, False
        return [name for name, holds in wrongs.items() if holds]


class Walk:
    """One session of random events.

    Attributes:
        events: How many there were.
        wrongs: What the model or the checker objects to.
    """

    def __init__(self, rng: random.Random, checks: Checks = IMITATED) -> None:
        self.rng = rng
        self.rig = Rig(checks=checks, queue_capacity=rng.randint(1, 3))
        self.model = Model()
        self.events = self.handed_in = 0
        self.moved_m = np.zeros(3)  # the arm stands so far from where it was commanded to
        self.wrongs: list[str] = []
        self._transit: list = []
        self._made_of: dict = {}
        chosen = rng.random()
        self._names = random.Random(chosen).choices(
            [*OPERATIONS], [*OPERATIONS.values()], k=rng.randint(20, 150)
        )
        self._arm = random.Random(chosen + 1.0)

    def run(self) -> "Walk":
        """Play it to its end, then ask the checker."""
        for name in self._names:
            self.events += 1
            try:
                getattr(self, f"_{name}")()
            except Exception as error:
                self.wrongs.append(f"{name} raised {error!r}")
            balance = self.rig.executor.conservation()
            if balance.error or balance.chunks.generated != self.handed_in:
                self.wrongs.append(f"after {name}: {self.handed_in} handed in, {balance}")
        self.rig.executor.end_episode(self.rig.now_s)
        report = check_messages(
            (e.kind, {"session": e.session, "n": e.n, "t": e.t, **e.payload})
            for e in self.rig.journal.events()
        )
        # Nobody polls in a pause here, and somebody may look on after the end.
        known = ("settings.checks", "P2.watchdog", "journal.after_end")
        self.wrongs += [f"checker: {v.rule}" for v in report.violations if v.rule not in known]
        return self

    def _now(self):
        """The time that somebody gives: right nearly always."""
        lot = self.rng.random()
        if lot < 0.04:
            return self.rng.choice(NO_TIMES)
        if lot < 0.06:
            return self.rig.now_s + self.rng.choice((3600.0, -0.2, -0.01, -3600.0))
        return self.rig.now_s

    def _made(self, first: int = 0, **changes):
        """A chunk whose first checked row goes on from the last command, a step a row."""
        way = np.array([self.rng.gauss(0.0, 1.0) for _ in range(3)])
        steps = np.arange(1 - first, ROWS + 1 - first)[:, None] * STEP_M * way / np.linalg.norm(way)
        begin_m, context = self.model.position_m, self.rig.context()
        if self.model.last_s is None and self._arm.random() < 0.8:  # the arm may be elsewhere
            begin_m = self.model.position_m + self.moved_m
            context = replace(context, last_action=np.append(begin_m, context.last_action[3:]))
        if self._arm.random() < 0.1:
            context = replace(context, measured_at_s=self.rig.now_s - 0.05)
        actions = np.zeros((ROWS, ACTION_DIM))
        actions[:, :3] = begin_m + steps
        actions[:, [3, 7]] = 1.0
        chunk = self.rig.chunk(actions=actions, context=context, **changes)
        self._made_of[chunk.metadata.chunk_id] = chunk.metadata, context.measured_at_s
        return chunk

    def _changed(self):
        changes, now_s = {}, self.rig.now_s
        if self.rng.random() < 0.15:
            changes["valid_until_s"] = now_s + self.rng.choice((-0.01, 0.06, 0.2))
        if self.rng.random() < 0.1:
            changes["action_start_time_s"] = now_s + self.rng.choice(
                (0.05, 0.1, 0.0173, -0.1, -0.3)
            )
        if self.rng.random() < 0.05:
            changes["task_phase"] = self.rng.choice(("insert", "approach"))
        if self.rng.random() < 0.1:
            changes["predecessor_chunk_id"] = ""
        if self.rng.random() < 0.05:
            rows = self.rng.choice(((0, 99), (3, 16), (0, 2)))
            changes |= {"first": rows[0], "verdict": passing_verdict(rows=rows)}
        if self.rng.random() < 0.1:  # it begins at once, with row 4
            changes["action_start_time_s"] = now_s - 0.2
            changes |= {"first": 4, "verdict": passing_verdict(rows=(4, ROWS))}
        return self._made(**changes)

    def _give(self, chunk, now_s, *, fallback: bool = False) -> None:
        self.handed_in += 1
        executor = self.rig.executor
        (executor.deliver_fallback if fallback else executor.deliver)(chunk, now_s)

    # -- what may happen; each is one event ---------------------------------------------------

    def _tick(self) -> None:
        now_s, before = self._now(), self.rig.stub.accepted
        command = self.rig.executor.tick(now_s)
        if self.rig.stub.accepted - before != (command.action is not None):
            self.wrongs.append("a command that the controller did not accept")
        if command.action is not None:
            made_of = self._made_of[command.chunk_id]
            self.wrongs += self.model.objections(self.rig, *made_of, command, now_s)
            self.moved_m = np.zeros(3)
        self.model.doubted |= bool(self.rig.journal.doubt)
        whole = self.rng.random() < 0.9
        self.rig.now_ns += PERIOD_NS if whole else self.rng.choice((1, 17, 33)) * 1_000_000

    def _look(self, event_s, divergence_m=None) -> None:
        rig, now_s = self.rig, self.rig.now_s
        told_m = None if self._arm.random() < 0.05 else self.model.position_m + self.moved_m
        if rig.executor.observe(now_s, event_s, rig.phase, rig.epoch, divergence_m, tcp_m=told_m):
            self.model.saw(event_s, rig.phase, rig.epoch, told_m)

    def _observe(self) -> None:
        lot = self.rng.random()
        age_s = self.rng.choice((0.0, 0.0, 0.0, 0.02, 0.2, -0.01))
        self._look(self.rng.choice(NO_TIMES) if lot < 0.05 else self.rig.now_s - age_s)

    def _diverge(self) -> None:
        self._look(self.rig.now_s, self.rng.choice((0.2, math.nan, math.inf, -1.0, "far")))
        self.model.void(self.rig.now_s)

    def _deliver(self) -> None:
        self._give(self._changed(), self._now())

    def _make(self) -> None:
        self._transit.append(self._changed())

    def _deliver_late(self) -> None:
        if self._transit:
            chunk = self.rng.choice(self._transit)
            if self.rng.random() < 0.7:
                self._transit.remove(chunk)
            self._give(chunk, self.rig.now_s, fallback=self.rng.random() < 0.1)

    def _deliver_fallback(self) -> None:
        own = {"policy_checkpoint_hash": FALLBACK_HASH, "sampler_config_hash": FALLBACK_HASH}
        own["method"] = "fallback"
        self._give(self._made(**own, predecessor_chunk_id=""), self.rig.now_s, fallback=True)

    def _garbage(self) -> None:
        thing = self.rng.choice((*GARBAGE, *BENT))
        if isinstance(thing, dict) and thing:
            chunk = self._made()
            for name, value in thing.items():
                object.__setattr__(chunk.metadata, name, value)
            thing = chunk
        self._give(thing, self.rig.now_s)

    def _write_off(self) -> None:
        self.handed_in += 1
        metadata = self._made().metadata
        self.rig.executor.write_off(metadata, ROWS, DiscardReason.EXPIRED, self.rig.now_s)

    def _pause(self) -> None:
        self.rig.advance(self.rng.choice((0.05, 0.1, 0.15, 0.3, 0.7)), poll=self.rng.random() < 0.7)

    def _poll(self) -> None:
        self.rig.stub.poll(self._now())
        self.model.doubted |= bool(self.rig.journal.doubt)

    def _stopped(self) -> None:
        if not self.rig.supervisor.stopped:
            self.wrongs.append("a stop that did not stop")
        self.model.stopped = True

    def _force(self) -> None:
        force_n = self.rng.choice((1.0, 30.0))
        limit_n = self.rig.cell.execution.force_limit_n.get(self.rig.phase, 0.0)
        self.rig.supervisor.observe_force(self._now(), force_n, self.rig.phase)
        if force_n > limit_n:
            self._stopped()

    def _no_force(self) -> None:
        self.rig.supervisor.observe_force(self._now(), self.rng.choice(NO_FORCES), self.rig.phase)
        self._stopped()

    def _collision(self) -> None:
        self.rig.supervisor.observe_collision(self._now(), self.rng.choice((True, None, 1)))
        self._stopped()

    def _stop(self) -> None:
        self.rig.supervisor.emergency_stop(self._now(), self.rng.choice(("", None, object())))
        self._stopped()

    def _restart(self) -> None:
        rig = self.rig
        rig.supervisor = Supervisor(rig.cell.execution, rig.journal, checks=rig.stub.checks)
        rig.stub.supervisor = rig.supervisor
        self._stopped()

    def _human_reset(self) -> None:
        self.rig.supervisor.human_reset(self.rig.now_s, "spotter")
        self.model.stopped, self.model.last_s = False, None
        self.model.void(self.rig.now_s)

    def _intervene(self) -> None:
        self.rig.executor.intervene(self._now())
        self.model.person = True
        self.model.last_s = None  # the person leaves the arm elsewhere, wherever
        self.moved_m = np.array([self._arm.choice((0.0, 0.03, 0.2)), 0.0, 0.0])

    def _hand_back(self) -> None:
        self.rig.executor.hand_back(self.rig.now_s)
        if self.model.person:
            self.model.person = False
            self.model.void(self.rig.now_s)

    def _reset(self) -> None:
        self.rig.executor.reset(self.rig.now_s)
        self.model.seen = self.model.last_s = self.model.told_m = None
        self.model.void(self.rig.now_s)

    def _phase(self) -> None:
        self.rig.phase = self.rng.choice(("approach", "insert", "unknown"))

    def _epoch(self) -> None:
        self.rig.epoch = self.rng.choice(("epoch-1", "epoch-2"))

    def _end(self) -> None:
        if self.rng.random() < LASTS:
            self.rig.executor.end_episode(self.rig.now_s)
            self.model.ended = True

    def _fallback(self) -> None:
        self.rig.executor.begin_fallback(self.rig.now_s)

    def _end_fallback(self) -> None:
        self.rig.executor.end_fallback(self.rig.now_s)

    def _weights(self) -> None:
        weights = self.rng.choice((CHECKPOINT, CHECKPOINT, "d" * 64))
        self.rig.executor.set_active(self.rig.now_s, weights, SAMPLER)

    def _controller(self) -> None:
        own = self.rig.cell.controller_mode
        self.rig.executor.controller(self.rig.now_s, self.rng.choice((own, own, own, "other")))

    def _void(self) -> None:
        event = self.rng.choice((self.rig.executor.force_event, self.rig.executor.collision_event))
        event(self.rig.now_s)
        self.model.void(self.rig.now_s)

    def _repair(self) -> None:
        """All is well again, and a chunk comes."""
        self.rig.phase, self.rig.epoch = "approach", "epoch-1"
        self._human_reset()
        self._hand_back()
        self.rig.executor.end_fallback(self.rig.now_s)
        self.rig.executor.set_active(self.rig.now_s, CHECKPOINT, SAMPLER)
        self.rig.executor.controller(self.rig.now_s, self.rig.cell.controller_mode)
        self._look(self.rig.now_s)
        self._give(self._made(predecessor_chunk_id=""), self.rig.now_s)


@dataclass
class Soaked:
    """What so many events left."""

    events: int = 0
    sessions: int = 0
    commands: int = 0
    wrongs: list[str] = field(default_factory=list)


def soak(seed: int | str, events: int, checks: Checks = IMITATED) -> Soaked:
    """At least so many events, in sessions named by the seed; stops at the first wrong one."""
    found = Soaked()
    while found.events < events and not found.wrongs:
        walk = Walk(random.Random(f"{seed} {found.sessions}"), checks).run()
        found.events += walk.events
        found.sessions += 1
        found.commands += walk.rig.stub.accepted
        found.wrongs += [f"session {seed} {found.sessions - 1}: {wrong}" for wrong in walk.wrongs]
    return found
