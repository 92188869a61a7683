"""A test rig: one session on a simulated clock, and chunks that no feasibility module made.

What is built here has the form of an admitted chunk and none of its authority. It exists so that
the executor, the stub and the checker can be tried with chunks of which something is wrong. The
whole table refuses all of them, so a rig has the table minus `issued`, and its journal says so.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import ACTION_DIM, POSITION
from genpolicy.contract.chunk import ChunkMetadata, DiscardReason, actions_sha256, frozen_array
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.execution.arrival import LAYER_COUNT
from genpolicy.execution.cell import PRIMITIVES, Cell, ExecutionSettings, LateChunk
from genpolicy.execution.checks import CHECKS, Checks, without
from genpolicy.execution.command import Command
from genpolicy.execution.executor import Executor
from genpolicy.execution.journal import Event, Journal, decode_actions
from genpolicy.execution.stub import ControllerStub
from genpolicy.execution.supervisor import Supervisor

Array = NDArray[np.float64]

PERIOD_S = 0.05
ROWS = 16
CHECKPOINT, SAMPLER = "c" * 64, "5" * 64
HORIZONS = HorizonConfig(
    observation_horizon=1, prediction_horizon=ROWS, execution_horizon=8, action_period_s=PERIOD_S
)
EXECUTION = ExecutionSettings(
    replan_lead_rows=3,
    late_chunk={LateChunk.CONTINUE: ("approach",), LateChunk.HOLD: ("insert",)},
    deadline_s=0.15,
    watchdog_s=0.1,
    queue_capacity=2,
    maximum_age_s={"approach": 0.6, "insert": 0.5},
    maximum_divergence_m=0.05,
    force_limit_n={"approach": 20.0, "insert": 40.0},
    hold_before_recovery_s=0.6,
    recovery_hold_s=0.2,
    primitive_timeout_s=5.0,
    human_timeout_s=10.0,
    maximum_failures=3,
    recovery_plans={"approach": PRIMITIVES[1:], "insert": PRIMITIVES},
)


IMITATED: Checks = without(CHECKS, "issued")
"""The table minus the one row that no imitation passes."""


@dataclass(frozen=True)
class StandInLayer:
    """Verdict of one layer, as claimed."""

    name: str
    passed: bool


@dataclass(frozen=True)
class StandInVerdict:
    """Verdict of all layers, as claimed."""

    layers: tuple[StandInLayer, ...]
    rows: tuple[int, int]
    q_rad: Array = field(default_factory=lambda: np.zeros((ROWS, 1)), repr=False)


@dataclass(frozen=True)
class StandInScene:
    """A scene without a body, as claimed."""

    bodies: dict[str, tuple[Array, Array]] = field(default_factory=dict)


@dataclass(frozen=True)
class StandInContext:
    """What the chunk was checked against, as claimed."""

    q_cmd: Array = field(default_factory=lambda: np.zeros(1))
    q_cmd_history: Array = field(default_factory=lambda: np.zeros((2, 1)))
    q_meas: Array = field(default_factory=lambda: np.zeros(1))
    dq_meas: Array | None = None
    measured_at_s: float = 0.0
    last_action: Array = field(default_factory=lambda: np.zeros(ACTION_DIM))
    scene: StandInScene = field(default_factory=StandInScene)


@dataclass(frozen=True, eq=False)
class StandIn:
    """Has the attributes of an admitted chunk, true or not."""

    metadata: ChunkMetadata
    actions: Array = field(repr=False)
    actions_sha256: str
    verdict: StandInVerdict
    context: StandInContext | None = field(default_factory=StandInContext, repr=False)

    @property
    def drawn(self) -> Array:
        """Actions before projection; an imitation was not projected."""
        return self.actions


def passing_verdict(
    *, failed: int | None = None, rows: tuple[int, int] = (0, ROWS)
) -> StandInVerdict:
    """Six layers, of which at most one fails; `rows` are those that were checked."""
    layers = (StandInLayer(f"layer_{n}", n != failed) for n in range(LAYER_COUNT))
    return StandInVerdict(tuple(layers), rows)


def rig_cell(*, execution_horizon: int = HORIZONS.execution_horizon, **changes: Any) -> Cell:
    """The cell of a rig, with changes to the settings of execution; its chunks live long."""
    horizons = HorizonConfig(**{**HORIZONS.model_dump(), "execution_horizon": execution_horizon})
    return Cell(horizons, ExecutionSettings(**{**EXECUTION.model_dump(), **changes}))


class Rig:
    """One session: clock, supervisor, stub and executor.

    Args:
        checks: The table of executor, stub and supervisor; the whole one takes no imitation.
        stub_checks: That of the stub, where it is another.
        supervisor: What makes its supervisor; a deaf one only for the evidence on mutants.
        execution_horizon: Actions of a chunk that may be executed.
        session: Name of the session.
        labels: What the session says of itself.
        changes: Of the settings of execution.
    """

    def __init__(
        self,
        *,
        checks: Checks = IMITATED,
        stub_checks: Checks | None = None,
        supervisor: type[Supervisor] = Supervisor,
        session: str = "rig",
        labels: Mapping[str, str] | None = None,
        execution_horizon: int = HORIZONS.execution_horizon,
        **changes: Any,
    ) -> None:
        self.journal = Journal(session, labels)
        self.cell = rig_cell(execution_horizon=execution_horizon, **changes)
        self.supervisor = supervisor(self.cell.execution, self.journal, checks=checks)
        own = checks if stub_checks is None else stub_checks
        self.stub = ControllerStub(self.cell, self.journal, self.supervisor, checks=own)
        self.now_ns = 0
        self.phase, self.epoch = "approach", "epoch-1"
        self.poses: dict[str, tuple[Array, Array]] = {}
        self.made = 0
        self.begin(Executor(self.cell, self.journal, self.stub, checks=checks))

    def begin(self, executor: Executor) -> None:
        """Let this one command; it hears what every session says first."""
        self.executor = executor
        executor.set_active(self.now_s, CHECKPOINT, SAMPLER)
        executor.controller(self.now_s, self.cell.controller_mode)
        executor.see(self.now_s, self.poses)

    @property
    def now_s(self) -> float:
        """Time, s."""
        return self.now_ns / 1e9

    def observe(
        self, age_s: float = 0.0, divergence_m: float | None = None, tcp_m: object = None
    ) -> bool:
        """Hand over an observation of this age, in the rig's phase and epoch.

        Args:
            age_s: Its age, s.
            divergence_m: What it says that the arm is off the last command, if anything, m.
            tcp_m: Where it measured the TCP, m; None: where it was commanded to. Shape (3,).
        """
        return self.executor.observe(
            self.now_s, self.now_s - age_s, self.phase, self.epoch, divergence_m,
            tcp_m=self.tcp_m if tcp_m is None else cast(Array, tcp_m),
        )  # fmt: skip

    @property
    def tcp_m(self) -> Array:
        """Where the arm is, which goes where it is commanded to at once, m. Shape (3,)."""
        return self.context().last_action[POSITION]

    def see(self, **places_m: float) -> None:
        """The bodies of the scene are seen upright, each so far along one axis, m."""
        upright = np.array([1.0, 0.0, 0.0, 0.0])
        self.poses = {name: (np.array([x, 0.0, 0.0]), upright) for name, x in places_m.items()}
        self.executor.see(self.now_s, self.poses)

    def chunk(self, **changes: Any) -> StandIn:
        """A valid chunk from an observation made now, with changes to what it carries.

        Args:
            changes: Fields of the metadata, or `actions`, `actions_sha256`, `verdict`, `context`.
        """
        self.made += 1
        actions = changes.pop("actions", self.actions(self.made))
        sha256 = changes.pop("actions_sha256", None)
        verdict = changes.pop("verdict", passing_verdict())
        context = changes.pop("context", self.context())
        metadata = ChunkMetadata(
            chunk_id=f"chunk-{self.made}",
            condition_observation_event_time_s=self.now_s,
            policy_checkpoint_hash=CHECKPOINT,
            sampler_config_hash=SAMPLER,
            action_start_time_s=self.now_s,
            action_period_s=PERIOD_S,
            valid_until_s=self.now_s + 10.0,
            task_phase=self.phase,
            calibration_epoch=self.epoch,
            predecessor_chunk_id=self.executor.chain_head,
            session_epoch=self.executor.session_epoch,
            method="rig",
            candidate_index=0,
        )
        values = frozen_array(actions)
        return StandIn(
            replace(metadata, **changes), values, sha256 or actions_sha256(values), verdict, context
        )

    @staticmethod
    def remade(chunk: StandIn, metadata: ChunkMetadata, actions: Array) -> StandIn:
        """The same with other metadata and actions."""
        values = frozen_array(actions)
        return replace(
            chunk, metadata=metadata, actions=values, actions_sha256=actions_sha256(values)
        )

    def context(self) -> StandInContext:
        """What an honest chunk would have been checked against now: last command and scene."""
        commanded = self.journal.last("accept", "fallback")
        scene = StandInScene(dict(self.poses))
        seen = StandInContext(scene=scene, measured_at_s=self.now_s)
        if commanded is None:
            return seen
        return replace(seen, last_action=decode_actions(commanded["action"])[0])

    @staticmethod
    def actions(seed: int, rows: int = ROWS) -> Array:
        """Distinct finite actions. Shape (rows, 10)."""
        index = np.arange(rows * ACTION_DIM, dtype=np.float64).reshape(rows, ACTION_DIM)
        return np.sin(index + 1000.0 * seed)

    def deliver(self, chunk: object) -> DiscardReason | None:
        """Deliver whatever this is as the policy's chunk."""
        return self.executor.deliver(cast(Any, chunk), self.now_s)

    def advance(self, duration_s: float, *, poll: bool = True) -> None:
        """Let time pass without ticks; the controller's own clock goes on unless `poll` is off."""
        end_ns = self.now_ns + round(duration_s * 1e9)
        step_ns = round(PERIOD_S * 1e9)
        while self.now_ns < end_ns:
            self.now_ns = min(self.now_ns + step_ns, end_ns)
            if poll:
                self.stub.poll(self.now_s)

    def tick(self, count: int = 1) -> list[Command]:
        """Ticks, one period apart; time stands at the next tick afterwards."""
        commands = []
        for _ in range(count):
            commands.append(self.executor.tick(self.now_s))
            self.now_ns += round(PERIOD_S * 1e9)
        return commands

    def run(self, count: int | None = None, **changes: Any) -> list[Command]:
        """Observe, deliver a (changed) chunk, tick it through, or so many of its actions.

        The arm is seen where the chunk says that it was checked from.
        """
        context = changes.get("context")
        told = isinstance(context, StandInContext)
        self.observe(tcp_m=cast(StandInContext, context).last_action[POSITION] if told else None)
        self.deliver(self.chunk(**changes))
        return self.tick(self.cell.horizons.execution_horizon if count is None else count)

    def end(self) -> list[Event]:
        """End the episode and return the journal's events."""
        self.executor.end_episode(self.now_s)
        return self.journal.events()
