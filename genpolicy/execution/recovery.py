"""Recovery: a state machine by task phase over hold, retreat, classical return, human, abort.

Resampling the policy is no recovery. Every phase has its own plan; a stop is reachable from every
state; failures are bounded; every transition is journaled. The trajectory of a primitive comes
from the task and goes through feasibility like any other proposal.
"""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.chunk import ChunkMetadata, Proposal
from genpolicy.contract.names import says
from genpolicy.errors import ContractError
from genpolicy.execution.cell import (
    FALLBACK_HASH,
    PRIMITIVES,
    ExecutionSettings,
    RecoveryState,
)
from genpolicy.execution.executor import Executor
from genpolicy.execution.journal import Journal
from genpolicy.execution.nanoseconds import ns_or_none, to_ns
from genpolicy.execution.observed import name_of

if TYPE_CHECKING:
    from genpolicy.feasibility.admission import Admitted

Array = NDArray[np.float64]


class Recovery:
    """The state machine of one session.

    Attributes:
        state: Where it stands.
        failures: Failed primitives since the last reset.
        attempts: Recoveries begun since the last reset.
        recovered: Recoveries that handed back to the policy without a person.
    """

    def __init__(self, settings: ExecutionSettings, journal: Journal) -> None:
        self.settings = settings
        self.state = RecoveryState.IDLE
        self.failures = self.attempts = self.recovered = 0
        self._journal = journal
        self._phase = ""
        self._since_ns = 0
        self._peak_n = 0.0
        self._hold_ns = to_ns(settings.recovery_hold_s)
        self._primitive_ns = to_ns(settings.primitive_timeout_s)
        self._human_ns = to_ns(settings.human_timeout_s)

    @property
    def active(self) -> bool:
        """Whether recovery, not the policy, is in charge."""
        return self.state is not RecoveryState.IDLE

    def trigger(self, now_s: float, phase: str, cause: str) -> None:
        """Begin, from IDLE only; a trigger during recovery changes nothing."""
        if self.state is not RecoveryState.IDLE:
            return
        self.attempts += 1
        self._phase, self._peak_n = name_of(phase), 0.0
        self._go(now_s, RecoveryState.HOLD, cause)

    def feel(self, now_s: float, force_n: float) -> None:
        """Note a contact force; while it holds or a primitive runs a new peak goes on record.

        It is the peak of this recovery, which may be less than was felt before it. What is no
        finite number goes on record as the largest there is. What is done about a force is the
        supervisor's.
        """
        known = ns_or_none(force_n) is not None  # a number, and no larger than any force is
        size_n = float(force_n) if known else sys.float_info.max
        if self.state in (RecoveryState.HOLD, *PRIMITIVES) and size_n > self._peak_n:
            self._peak_n = size_n
            payload = {"force_n": self._peak_n}
            self._journal.add("recovery_force", self._journal.clock(now_s), payload)

    def advance(self, now_s: float) -> RecoveryState:
        """Let time act: the hold ends, a primitive or a person takes too long."""
        waited_ns = self._journal.clock(now_s) - self._since_ns
        if self.state is RecoveryState.HOLD and waited_ns >= self._hold_ns:
            plan = self._plan()
            exhausted = self.attempts > self.settings.maximum_failures
            nowhere = exhausted or not plan
            following = RecoveryState.ASK_HUMAN if nowhere else plan[0]
            self._go(now_s, following, "attempts exhausted" if exhausted else "hold over")
        elif self.state in PRIMITIVES and waited_ns > self._primitive_ns:
            self.primitive_failed(now_s, "timeout")
        elif self.state is RecoveryState.ASK_HUMAN and waited_ns > self._human_ns:
            self._go(now_s, RecoveryState.ABORT, "no person answered")
        return self.state

    def primitive_succeeded(self, now_s: float) -> None:
        """The primitive reached its goal: the next of the plan, or back to the policy."""
        self._expect(*PRIMITIVES)
        plan = self._plan()
        following = plan.index(self.state) + 1
        if following < len(plan):
            self._go(now_s, plan[following], "primitive reached its goal")
        else:
            self.recovered += 1
            self._go(now_s, RecoveryState.IDLE, "recovered")

    def primitive_failed(self, now_s: float, cause: str) -> None:
        """The primitive was rejected, lost or too slow: hold and try again, or abort."""
        self._expect(*PRIMITIVES)
        self.failures += 1
        last = self.failures >= self.settings.maximum_failures
        self._go(now_s, RecoveryState.ABORT if last else RecoveryState.HOLD, cause)

    def human_resolved(self, now_s: float, person: str) -> None:
        """A person has put things right; the policy may go on.

        Raises:
            ContractError: Nobody was asked, or no person is named.
        """
        self._expect(RecoveryState.ASK_HUMAN)
        if not says(person):
            self._refuse("a resolution without a person", "a person's name")
        self._go(now_s, RecoveryState.IDLE, f"resolved by {person}")

    def person_takes_over(self, now_s: float, person: str) -> None:
        """Who was asked has come and has the arm."""
        self._expect(RecoveryState.ASK_HUMAN)
        self._go(now_s, RecoveryState.PERSON, f"taken over by {person}")

    def person_handed_back(self, now_s: float, person: str) -> None:
        """The person has brought the arm away from what stopped the policy, which may go on.

        It clears nothing: a stop is another state, out of which this does not lead.
        """
        self._expect(RecoveryState.PERSON)
        self._go(now_s, RecoveryState.IDLE, f"handed back by {person}")

    def person_gave_up(self, now_s: float, person: str) -> None:
        """The person has not managed to in the time that there was."""
        self._expect(RecoveryState.PERSON)
        self._go(now_s, RecoveryState.ABORT, f"given up by {person}")

    def stop(self, now_s: float, cause: str) -> None:
        """From every state; stays until `human_reset`."""
        if self.state is not RecoveryState.STOPPED:
            self._go(now_s, RecoveryState.STOPPED, cause)

    def human_reset(self, now_s: float, person: str) -> None:
        """Begin anew after a stop or an abort; counters return to 0.

        Raises:
            ContractError: No person is named.
        """
        if not says(person):
            self._refuse("a reset without a person", "a person's name")
        self.failures = self.attempts = 0
        self._go(now_s, RecoveryState.IDLE, f"reset by {person}")

    def _plan(self) -> tuple[RecoveryState, ...]:
        return self.settings.recovery_plans.get(self._phase, ())

    def _go(self, now_s: float, state: RecoveryState, cause: str) -> None:
        payload = {
            "old": str(self.state), "new": str(state), "cause": name_of(cause),
            "phase": self._phase,
            "failures": self.failures,
        }  # fmt: skip
        self._since_ns = self._journal.clock(now_s)
        self._journal.add("recovery", self._since_ns, payload)
        self.state = state

    def _expect(self, *states: RecoveryState) -> None:
        if self.state not in states:
            self._refuse(f"in state {self.state}", f"one of {', '.join(states)}")

    def _refuse(self, found: str, expected: str) -> None:
        raise ContractError(
            where="recovery", found=found, expected=expected, action="Hold and ask a person."
        )


@dataclass(frozen=True)
class Primitive:
    """What the task plans for a state: the next actions, or that the goal is reached.

    Attributes:
        actions: Actions from now on. Shape (N, 10); ignored once reached.
        reached: Whether the primitive's goal is reached.
    """

    actions: Array
    reached: bool = False


Plan = Callable[[RecoveryState], Primitive]
Admit = Callable[[Proposal], "Admitted | None"]


def fallback_metadata(
    executor: Executor, *, now_s: float, chunk_id: str, event_time_s: float, phase: str, epoch: str
) -> ChunkMetadata:
    """Metadata of a chunk of the task's fallback, starting now, as an explicit re-plan."""
    horizons = executor.cell.horizons
    return ChunkMetadata(
        chunk_id=chunk_id,
        condition_observation_event_time_s=event_time_s,
        policy_checkpoint_hash=FALLBACK_HASH,
        sampler_config_hash=FALLBACK_HASH,
        action_start_time_s=now_s,
        action_period_s=horizons.action_period_s,
        valid_until_s=now_s + horizons.execution_horizon * horizons.action_period_s,
        task_phase=phase,
        calibration_epoch=epoch,
        predecessor_chunk_id="",
        session_epoch=executor.session_epoch,
        method="fallback",
        candidate_index=0,
    )


def step(
    recovery: Recovery,
    executor: Executor,
    *,
    now_s: float,
    metadata: Callable[[], ChunkMetadata],
    plan: Plan,
    admit: Admit,
) -> RecoveryState:
    """One control step of recovery, before `Executor.tick`: plan, admit, deliver, hand back.

    While recovery is active the policy does not command: its chunks are discarded as `stopped`.
    What is left of a primitive that ended is discarded too.

    Args:
        recovery: The state machine, already triggered.
        executor: Where admitted fallback chunks go.
        now_s: Time, s.
        metadata: Makes the metadata of a new fallback chunk (`fallback_metadata`).
        plan: The task's fallback.
        admit: Feasibility; None when it rejects.

    Returns:
        The state after this step.
    """
    if executor.stub.supervisor.stopped:
        recovery.stop(now_s, "supervisor")
    before = recovery.state
    if recovery.advance(now_s) in PRIMITIVES:
        executor.begin_fallback(now_s)
        if executor.needs_invocation(now_s):
            _plan_primitive(recovery, executor, now_s, metadata, plan, admit)
    over = before in PRIMITIVES and recovery.state not in PRIMITIVES
    if over or not recovery.active:
        executor.end_fallback(now_s)
    if recovery.active:
        executor.begin_fallback(now_s)
    return recovery.state


def _plan_primitive(  # noqa: PLR0917
    recovery: Recovery,
    executor: Executor,
    now_s: float,
    metadata: Callable[[], ChunkMetadata],
    plan: Plan,
    admit: Admit,
) -> None:
    primitive = plan(recovery.state)
    if primitive.reached:
        recovery.primitive_succeeded(now_s)
        return
    admitted = admit(Proposal(metadata(), primitive.actions, selected_by=str(recovery.state)))
    reason = executor.deliver_fallback(admitted, now_s) if admitted is not None else "rejected"
    if reason is not None:
        recovery.primitive_failed(now_s, f"fallback {reason}")
