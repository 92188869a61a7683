"""One closed-loop rollout on the virtual clock: world, executor, stub, supervisor, recovery.

The world goes on while observations travel and the policy thinks. An invocation that is wanted
begins when the next observation arrives, is conditioned on it, and is delivered at the first tick
after its latency has passed, which counts from the exposure. Its candidates are checked one after
the other, and each check takes its time. A rollout is advanced tick by tick from outside, so that
many of them run in lockstep and share the network's batches; it never sees the others.
"""

from collections import deque
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from genpolicy.candidates.selector import tries_another
from genpolicy.contract.chunk import Candidate, DiscardReason, Proposal
from genpolicy.errors import ContractError
from genpolicy.evidence.admission_context import (
    COMMANDS_AT_THE_BOUNDARY,
    Moment,
    Session,
    context_of,
)
from genpolicy.evidence.stress.deliveries import Deliveries
from genpolicy.evidence.stress.disturbance import Disturbance
from genpolicy.evidence.stress.exposures import Exposure, Exposures, conditioned_on
from genpolicy.evidence.stress.fallback import Fallback
from genpolicy.evidence.stress.joined import Joined
from genpolicy.evidence.stress.measured import Measured
from genpolicy.evidence.stress.refused import Refused, measures_of
from genpolicy.evidence.stress.splices import Splice, splice_of
from genpolicy.evidence.stress.state import InFlight, Outcome, Setup, Tally, in_flight
from genpolicy.execution.attended import AttendedExecutor
from genpolicy.execution.cell import FALLBACK_HASH, Cell, RecoveryState
from genpolicy.execution.command import Command
from genpolicy.execution.recovery import Recovery, step
from genpolicy.execution.stub import ControllerStub
from genpolicy.execution.supervisor import Supervisor
from genpolicy.feasibility.admission import Admitted, Rejected
from genpolicy.feasibility.context import Context
from genpolicy.feasibility.freshness import REASONS
from genpolicy.feasibility.settings import LAYERS
from genpolicy.tasks.api import Start, World, WorldSettings

Array = NDArray[np.float64]

FRESH = LAYERS[-1]
CALLED = (RecoveryState.ASK_HUMAN, RecoveryState.PERSON, RecoveryState.ABORT)


class Rollout:
    """One world under one policy, advanced from outside, tick by tick, until `outcome`.

    A tick is: `sense`; while `pending` names a chunk, judge it and `settle` it; `decide`, up to the
    last observation that arrives before the next tick; fill the `wanted` invocation with samples;
    `act`.

    Args:
        setup: What it shares with the others.
        start: Initial state.
        start_index: Its number; keys of all draws.
        calibration_epoch: Calibration in force.

    Attributes:
        conditioning: What the invocation that began last sees, oldest first. Shape (H_o, D_o).
    """

    def __init__(
        self, setup: Setup, start: Start, start_index: int, *, calibration_epoch: str
    ) -> None:
        self.setup = setup
        self.start_index = start_index
        settings = WorldSettings(calibration_epoch, setup.probe, seed=start_index)
        self.world: World = setup.task.make_world(start, settings=settings)
        self.start_sha256 = self.world.state_sha256()
        self.journal = setup.journal(start_index, self.start_sha256)
        cell = Cell(setup.horizons, setup.execution)
        cell.require_task(setup.task.phases)
        self.supervisor = Supervisor(cell.execution, self.journal)
        self.stub = ControllerStub(cell, self.journal, self.supervisor)
        self.executor = AttendedExecutor(cell, self.journal, self.stub)
        self.recovery = Recovery(cell.execution, self.journal)
        self.outcome: Outcome | None = None
        self.tally = Tally()
        self.splices: list[Splice] = []
        self.refused: list[Refused] = []
        self.tick = self.invocations = 0
        self.wanted: InFlight | None = None
        shared = setup, self.executor, self.journal, self.tally
        self._deliveries = Deliveries(*shared, start=start_index)
        self._joined = Joined(setup, self.journal)
        self._fallback = Fallback(setup, self.world, self.executor, self.recovery)
        self.person = setup.attendance(self.world, self.executor, self.recovery, start_index)
        self._newest_accepted_s: float | None = None
        self._last_command_s: float | None = None
        before = [self.world.last_action] * COMMANDS_AT_THE_BOUNDARY
        self._commanded: deque[Array] = deque(before, maxlen=COMMANDS_AT_THE_BOUNDARY)
        self._seen = self.conditioning = np.zeros(0)
        self._exposures = Exposures(setup, self.journal, start=start_index)
        self._command = Command("hold", "empty")
        self._measured = Measured(setup.task, self.world, self.journal)
        self._disturbance = Disturbance(setup, self.world, start=start_index)
        self.executor.set_active(0.0, setup.checkpoint, setup.sampler)
        self.executor.controller(0.0, cell.controller_mode)  # the simulated one has no other

    @property
    def now_s(self) -> float:
        """Virtual time, s."""
        return self.tick * self.setup.horizons.action_period_s

    @property
    def done(self) -> bool:
        """Whether the rollout has ended."""
        return self.outcome is not None

    @property
    def noise_name(self) -> tuple[str, str, int, int]:
        """Names of the noise of the invocation that began last."""
        return "stress", self.setup.perturbation, self.start_index, self.invocations

    def sense(self) -> None:
        """Observe, supervise, and collect what has been delivered by now."""
        now_s, world = self.now_s, self.world
        self._seen = observation = world.observe()
        self.tally.feel(self.journal, now_s, world.contact_force_n)  # new at the start only
        self._measured.note(now_s, observation)
        self.executor.see(now_s, self.setup.task.scene_poses(observation))
        position, _ = world.tcp_pose
        self.tally.path_m.append(np.array(position))
        self._exposures.expose(now_s, observation, world.phase, world.calibration_epoch)
        divergence_m = float(np.linalg.norm(position - world.last_action[:3]))
        told = now_s, world.phase, world.calibration_epoch, divergence_m
        self.executor.observe(now_s, *told, tcp_m=position)
        self._supervise(now_s)
        if not self.done:
            self._deliveries.collect(now_s)

    def pending(self) -> tuple[Proposal, Context] | None:
        """The next delivered candidate to be judged, or None if there is none (left)."""
        flying = None if self.done else self._deliveries.first()
        if flying is None:
            return None
        if flying.chunks is None:
            raise ContractError(
                where=f"chunk {flying.metadata.chunk_id}",
                found="delivered before it was sampled",
                expected="the batch to fill in its candidates",
                action="Sample every wanted invocation before `act`.",
            )
        drawn = [
            Candidate(replace(flying.metadata, candidate_index=index), actions)
            for index, actions in enumerate(flying.chunks)
        ]
        late = self._deliveries.late_rows(flying, self.now_s)
        proposal = self._joined.propose(flying, drawn, late_rows=late)
        return proposal, self._delivery_context(late)

    def settle(self, result: Admitted | Rejected, context: Context) -> None:
        """Take the verdict on `pending`, in its context: the first that passes is taken."""
        flying = self._deliveries.take()
        verdict, now_s = result.verdict, self.now_s
        self._joined.record(flying, result.metadata.chunk_id, now_s)
        self.journal.candidate(
            now_s,
            chunk_id=result.metadata.chunk_id,
            method=self.setup.method,
            index=flying.candidate,
            layers={layer.name: layer.passed for layer in verdict.layers},
            first_reason=verdict.first_reason or None,
            measures=measures_of(flying, result),
        )
        if isinstance(result, Admitted):
            self.tally.refused.discard(flying.metadata.chunk_id)
            self._deliveries.answered(flying, now_s)
            if self.executor.deliver(result, now_s) is None:
                self._newest_accepted_s = flying.metadata.condition_observation_event_time_s
                self._joined.entered(flying, result)
                self.splices.append(splice_of(self.setup.checker, flying, result))
            return
        self.tally.refused.add(flying.metadata.chunk_id)
        self.refused.append(Refused(flying.candidate, result, context))
        counts = self.tally.rejected_by
        counts[result.reason] = counts.get(result.reason, 0) + 1
        # What made one candidate late or void holds for all of its invocation. It is known where
        # the other layers passed: freshness is asked last.
        stale = verdict.first_layer == FRESH
        if tries_another(flying.candidate, flying.candidates, stale=stale):
            self._deliveries.try_another(flying, now_s)
            return
        self._deliveries.answered(flying, now_s)
        reason = REASONS[result.reason] if stale else DiscardReason.INFEASIBLE
        self._deliveries.write_off(flying, reason, now_s)

    def decide(self) -> None:
        """Recover, command, look at what arrives before the next tick; may set `wanted`."""
        now_s, self.wanted = self.now_s, None
        self._recover(now_s)
        if self.done:
            return
        idle = self.recovery.state is RecoveryState.IDLE
        asks = idle and self.executor.needs_invocation(now_s)
        self._command = self.executor.tick(now_s)
        self._disturbance.push(self.journal, now_s)
        next_s = (self.tick + 1) * self.setup.horizons.action_period_s
        for exposure in self._exposures.arriving(next_s):
            if asks and self.wanted is None:
                self.wanted = self._begin_invocation(exposure)

    def act(self) -> None:
        """One action period of the world."""
        if self.wanted is not None:
            self._deliveries.add(self.wanted)
            self.wanted = None
        self._apply(self._command, self.now_s)
        self.world.advance()
        self.tick += 1
        self.tally.feel(self.journal, self.now_s, self.world.contact_force_n)
        self.recovery.feel(self.now_s, self.world.contact_force_n)
        if self.world.success:
            self.end(Outcome.ASSISTED if self.person.calls else Outcome.SUCCESS)

    def end(self, outcome: Outcome) -> None:
        """End a rollout that has not ended, unless its last period brought a stop instead."""
        if not self.done:
            self._supervise(self.now_s)
        if not self.done:
            self._end(outcome)

    def _end(self, outcome: Outcome) -> None:
        self.outcome = outcome
        self._measured.note(self.now_s)
        self._deliveries.end(self.now_s)
        self.tally.conclude(self.journal, self.setup.task, outcome, self._seen)
        self.executor.end_episode(self.now_s)

    def _supervise(self, now_s: float) -> None:
        world = self.world
        if self.supervisor.observe_collision(now_s, world.collision):
            self.executor.collision_event(now_s)
            self.recovery.stop(now_s, "collision")
            self._end(Outcome.COLLISION)
        elif self.supervisor.observe_force(now_s, world.contact_force_n, world.phase):
            self.executor.force_event(now_s)
            self.recovery.stop(now_s, "force")
            self._end(Outcome.FORCE_STOP)

    def _begin_invocation(self, exposure: Exposure) -> InFlight:
        now_s, number = exposure.arrival_s, self.invocations
        self.invocations += 1
        name = f"{self.journal.session}/{number}"
        metadata = conditioned_on(exposure, self.setup, self.executor, chunk_id=name)
        self.conditioning = self._exposures.conditioning()
        flying = in_flight(
            self.setup,
            metadata,
            exposure.observation,
            sensor_s=exposure.terms_s,
            start=self.start_index,
            number=number,
        )
        self._joined.begin(flying)
        self.executor.begin_invocation(now_s, metadata.chunk_id, repr(flying.total_s))
        flying.tell(self.journal, now_s)
        self.journal.conditioning(
            now_s,
            invocation_id=metadata.chunk_id,
            exposed_s=exposure.exposed_s,
            key=self.noise_name,
            history=self.conditioning,
        )
        self.tally.latencies_s.append(flying.total_s)
        return flying

    def _delivery_context(self, late: int) -> Context:
        return context_of(
            self.setup.task,
            self.setup.checker,
            self._moment(),
            session=self._session(self.setup.checkpoint, self.setup.sampler),
            late_rows=late,
            newest_accepted_observation_s=self._newest_accepted_s,
        )

    def _recover(self, now_s: float) -> None:
        last_s = self._last_command_s if self._last_command_s is not None else 0.0
        silent = now_s - last_s >= self.setup.execution.hold_before_recovery_s - 1e-9
        late = self._deliveries.late_in == self.world.phase
        if not self.recovery.active and (silent or late or self._disturbance.drill(now_s)):
            cause = "silence" if silent else self._deliveries.late_cause if late else "drill"
            self.recovery.trigger(now_s, self.world.phase, cause)
        if not self.recovery.active:
            return
        ticks, admit = self.tally.fallback_ticks, self._admit_fallback
        metadata = lambda: self._fallback.metadata(self.journal.session, now_s)  # noqa: E731
        state = step(
            self.recovery,
            self.executor,
            now_s=now_s,
            metadata=metadata,
            plan=lambda state: self._fallback.plan(state, ticks=ticks),
            admit=admit,
        )
        if state in CALLED and not self.person.attend(now_s, ticks, metadata, admit):
            self._end(Outcome.INTERVENTION)
        elif self.recovery.state is RecoveryState.IDLE:
            self._last_command_s = now_s  # the silence is over; the policy gets its time

    def _admit_fallback(self, proposal: Proposal) -> Admitted | None:
        context = context_of(
            self.setup.task,
            self.setup.checker,
            self._moment(),
            session=self._session(FALLBACK_HASH, FALLBACK_HASH),
        )
        result = self.setup.checker.admit(proposal, context=context)
        return result if isinstance(result, Admitted) else None

    def _moment(self) -> Moment:
        return Moment(
            observation=self._seen,
            q_meas=self._measured.q_rad,
            commanded=list(self._commanded),
            now_s=self.now_s,
            phase=self.world.phase,
            q_before=self._measured.q_before_rad,
        )

    def _session(self, checkpoint: str, sampler: str) -> Session:
        return Session(
            calibration_epoch=self.world.calibration_epoch,
            session_epoch=self.executor.session_epoch,
            checkpoint=checkpoint,
            sampler=sampler,
            maximum_age_s=self.setup.execution.maximum_age_s,
            controller_mode=self.executor.cell.controller_mode,
        )

    def _apply(self, command: Command, now_s: float) -> None:
        if command.action is None:
            self.world.hold()
            self.tally.hold_ticks += 1
            self._commanded.append(self._commanded[-1])
            return
        self.world.command(command.action)
        self._commanded.append(np.array(command.action))
        self._last_command_s = now_s
        self.tally.fallback_ticks += command.kind == "fallback"
        self.tally.action_ticks += command.kind != "fallback"
