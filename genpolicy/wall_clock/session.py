"""One replay under supervision: the objects of the virtual mode, told what the wall clock says.

Nothing is decided here. Executor, controller stub and supervisor are those of every rollout and
shadow session, with the whole table of checks; this passes on to them what was recorded, what a
policy answered and what a person wants. Nothing moves: the arm is seen where the stub's commands
lead (`following`), so that a chunk runs on while the policy answers and the next one takes over.
Where a task's arm cannot be followed, each invocation begins with a reset, which clears no stop.
"""

import math
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace

from numpy.typing import ArrayLike

from genpolicy.candidates.selector import propose
from genpolicy.contract.chunk import Candidate, ChunkMetadata, DiscardReason, Proposal
from genpolicy.errors import ContractError
from genpolicy.evidence.admission_context import Session
from genpolicy.execution.cell import Cell
from genpolicy.execution.executor import Executor
from genpolicy.execution.informed import UNKNOWN
from genpolicy.execution.ledger import Conservation
from genpolicy.execution.stub import ControllerStub
from genpolicy.execution.supervisor import DoubtedTimeError, Supervisor
from genpolicy.feasibility.admission import Admitted, Rejected
from genpolicy.feasibility.freshness import REASONS
from genpolicy.feasibility.settings import LAYERS
from genpolicy.tasks.api import Task
from genpolicy.wall_clock.admission import Job, Result
from genpolicy.wall_clock.asked import Asked, Tally
from genpolicy.wall_clock.following import arm_of
from genpolicy.wall_clock.messages import Answer, Ask, Operator, Order
from genpolicy.wall_clock.replay import Replay
from genpolicy.wall_clock.request import WallClockRequest
from genpolicy.wall_clock.streamed import StreamedJournal

Submit = Callable[[Job], bool]
"""Whether a job was taken by who judges."""
ROUNDING = 1e-6
"""Of a period."""


class SupervisedSession:
    """Supervisor, controller stub and executor of one replay.

    Args:
        task: The task.
        cell: What they are held to.
        request: What is replayed, and who may command.
        journal: Where every event goes.
        stop_stands: A session before this one left a stop, or died: this one begins stopped.

    Attributes:
        ended: A person wants the end.
        tally: What is counted.
        replay: What is replayed.
        arm: Where the arm is that is observed.
    """

    def __init__(
        self,
        task: Task,
        cell: Cell,
        request: WallClockRequest,
        journal: StreamedJournal,
        *,
        stop_stands: bool,
    ) -> None:
        self.journal, self.cell, self.tally, self.ended = journal, cell, Tally(), False
        self._task, self._request = task, request
        self.replay: Replay = request.replay
        self.arm = arm_of(task, request.replay, horizon=cell.horizons.execution_horizon)
        self.stub = ControllerStub(cell, journal, Supervisor(cell.execution, journal))
        self.executor = Executor(cell, journal, self.stub)
        self.executor.set_active(0.0, request.checkpoint, request.sampler)
        self.executor.controller(0.0, cell.controller_mode)
        if stop_stands:  # one that takes over in a session that runs begins stopped
            self.stub.supervisor = Supervisor(cell.execution, journal)
        self._asked: Asked | None = None
        self._row = self._asks = 0
        self._seen = (0, 0.0)

    def tick(self, now_s: float, row: int) -> Ask | None:
        """One control period: what was recorded at a row is seen now, and a command is decided.

        Args:
            now_s: Time, s; NaN where the clock tells none.
            row: Row of the replay.

        Returns:
            What the policy is asked next, if anything.
        """
        self._row, replay, executor = row, self.replay, self.executor
        self.arm.reach(row)
        phase = replay.phases[row]
        executor.observe(now_s, now_s, phase, replay.calibration_epoch, tcp_m=self.arm.tcp_m(row))
        if self.stub.supervisor.observe_force(now_s, replay.forces_n[row], phase):
            executor.force_event(now_s)
        self._see(now_s, row)
        if not self.journal.doubt:
            self._seen = row, now_s
        self.arm.given(row, executor.tick(now_s))
        self._deliver(now_s)
        asked = self._asked
        if asked is not None and self._overdue(asked, now_s):
            self._give_up(asked, now_s)
        if self.journal.doubt or self._asked is not None or not executor.needs_invocation(now_s):
            return None
        return self._ask(now_s, row)

    def _see(self, now_s: float, row: int) -> None:
        """Say where bodies are seen; where the task cannot tell, nobody knows, and that holds."""
        poses: Mapping[str, tuple[ArrayLike, ArrayLike]] = UNKNOWN
        with suppress(Exception):  # whatever a task raises, the tick goes on to what stops
            poses = self._task.scene_poses(self.arm.at(row))
        self.executor.see(now_s, poses)

    def _ask(self, now_s: float, row: int) -> Ask:
        executor, replay, horizons = self.executor, self.replay, self.cell.horizons
        phase, start_s = replay.phases[row], row * horizons.action_period_s
        if self._asks and not self.arm.follows:  # it is where the operator brought it
            executor.reset(now_s)
            tcp_m = self.arm.tcp_m(row)
            executor.observe(now_s, now_s, phase, replay.calibration_epoch, tcp_m=tcp_m)
        metadata = ChunkMetadata(
            chunk_id=f"{self.journal.session}/{self._asks}",
            condition_observation_event_time_s=now_s,
            policy_checkpoint_hash=self._request.checkpoint,
            sampler_config_hash=self._request.sampler,
            action_start_time_s=start_s,
            action_period_s=horizons.action_period_s,
            valid_until_s=start_s + horizons.execution_horizon * horizons.action_period_s,
            task_phase=phase,
            calibration_epoch=replay.calibration_epoch,
            predecessor_chunk_id=executor.chain_head,
            session_epoch=executor.session_epoch,
            method=self._request.method,
            candidate_index=0,
        )
        self._asks += 1
        executor.begin_invocation(now_s, metadata.chunk_id)
        self._asked = Asked(metadata, row, now_s)
        return Ask(
            metadata.chunk_id,
            self.arm.history(row, horizons.observation_horizon),
            (replay.episode_uuid, str(row)),
        )

    def answer(
        self,
        answer: Answer,
        now_s: float,
        submit: Submit,
        *,
        judging_s: float = 0.0,
    ) -> None:
        """A policy answers; only the first answer to what was asked is taken.

        Args:
            answer: What it says.
            now_s: Time, s.
            submit: Takes it to be judged.
            judging_s: How long a verdict usually takes, s.
        """
        asked = self._asked
        if asked is None or asked.answered_s is not None:
            self.tally.dropped["unsolicited"] += 1
            return
        if answer.invocation != asked.metadata.chunk_id:
            self.tally.dropped["unsolicited"] += 1
            return
        asked.answered_s = now_s
        asked.metadata = replace(
            asked.metadata, policy_checkpoint_hash=answer.checkpoint,
            sampler_config_hash=answer.sampler, method=answer.method,
        )  # fmt: skip
        self.executor.end_invocation(now_s, asked.metadata.chunk_id, "answered")
        if self._next_row(now_s, 0.0) > self._last_row(asked):
            self._write_off(asked, DiscardReason.EXPIRED, now_s, dropped="too_late")
            return
        proposal = propose([Candidate(asked.metadata, answer.actions)])
        self._look(asked, proposal, now_s, submit, judging_s=judging_s)

    def _look(
        self, asked: Asked, proposal: Proposal, now_s: float, submit: Submit, *, judging_s: float
    ) -> None:
        """Have an answer judged for the first row that its verdict can be in time for."""
        # One verdict that took too long must not keep all that follow from being judged.
        asked.first_row = min(self._next_row(now_s, judging_s), self._last_row(asked))
        # The scene is that of the question: it stands on record, whatever ticks by until delivery.
        row, seen_s = self._seen if self.arm.follows else (asked.row, asked.asked_s)
        taken = submit(
            Job(
                proposal=proposal,
                history=self.arm.history(row, min(row + 1, 2), scene=asked.row),
                commanded=self.arm.commanded(asked.row, asked.first_row),
                session=self._in_force(),
                event_s=seen_s,
                now_s=now_s,
                phase=self.replay.phases[row],
                late_rows=asked.first_row - asked.row,
            )
        )
        if not taken:
            self._write_off(asked, DiscardReason.EXPIRED, now_s, dropped="admission_busy")

    def decide(
        self,
        job: Job,
        result: Result,
        now_s: float,
        submit: Submit,
        *,
        judging_s: float = 0.0,
    ) -> None:
        """What became of an answer: it is enqueued, judged anew, or counted under one reason.

        Args:
            job: What was judged.
            result: What was found.
            now_s: Time, s.
            submit: Takes it to be judged for a later row, where its own has gone by.
            judging_s: How long a verdict usually takes, s.
        """
        asked, metadata = self._asked, job.proposal.metadata
        if asked is None or asked.metadata.chunk_id != metadata.chunk_id:
            self.tally.dropped["late_verdict"] += 1  # it was given up, and is accounted for
            return
        missed = isinstance(result, Admitted) and asked.first_row <= self._row
        if missed and self._next_row(now_s, 0.0) <= self._last_row(asked):
            self.tally.again += 1
            self._look(asked, job.proposal, now_s, submit, judging_s=judging_s)
            return
        if result is not None:
            verdict = result.verdict
            self.journal.candidate(
                now_s,
                chunk_id=metadata.chunk_id,
                method=metadata.method,
                index=metadata.candidate_index,
                layers={layer.name: layer.passed for layer in verdict.layers},
                first_reason=verdict.first_reason or None,
            )
        if isinstance(result, Admitted):
            asked.admitted = result
            self._deliver(now_s)
        else:
            self._write_off(asked, _reason(result), now_s)
        assert asked.answered_s is not None, "what is decided was answered"
        self.tally.decided_s.append(now_s - asked.answered_s)

    def obey(self, operator: Operator, now_s: float) -> None:
        """What a person wants; the only way back from a stop, and it needs a name."""
        if operator.order is Order.EMERGENCY_STOP:
            self.stub.supervisor.emergency_stop(now_s, operator.person)
        elif operator.order is Order.END:
            self.ended = True
        else:
            try:
                self.stub.supervisor.human_reset(now_s, operator.person)
            except DoubtedTimeError as error:
                with suppress(OSError, ValueError):  # of a log that is full or closed
                    print(error, file=sys.stderr, flush=True)
                self.tally.dropped[f"reset_{self.journal.doubt}"] += 1
            except ContractError:
                self.tally.dropped["reset_without_a_person"] += 1

    def fail(self, now_s: float, cause: str) -> None:
        """Something that supervision rests on is gone: E-stop."""
        self.stub.supervisor.emergency_stop(now_s, cause)

    def end(self, now_s: float) -> Conservation:
        """What is open is given up, the balance is written down."""
        if self._asked is not None:
            self._give_up(self._asked, now_s)
        return self.executor.end_episode(now_s)

    def _deliver(self, now_s: float) -> None:
        """What was admitted takes over at the very row that it was judged for, or never.

        Sooner the rows of the chunk before would be lost, and later nobody checked the way.
        """
        asked = self._asked
        if asked is None or asked.admitted is None or asked.first_row > self._row + 1:
            return
        if asked.first_row <= self._row:
            self._write_off(asked, DiscardReason.EXPIRED, now_s, dropped="late_verdict")
            return
        self._asked = None
        if self.executor.deliver(asked.admitted, now_s) is None:
            self.arm.runs(asked.admitted)

    def _overdue(self, asked: Asked, now_s: float) -> bool:
        """Whether its deadline is over, in whole periods: a tick is late by less than one."""
        period_s = self.cell.horizons.action_period_s
        waited = (now_s - asked.asked_s) / period_s
        if not math.isfinite(waited):
            return True
        return round(waited) >= self.cell.execution.deadline_s / period_s - ROUNDING

    def _last_row(self, asked: Asked) -> int:
        """Of the rows that a chunk may be executed in."""
        return asked.row + self.cell.horizons.execution_horizon - 1

    def _next_row(self, now_s: float, judging_s: float) -> int:
        """The first row for which a verdict is in time: a chunk cannot begin behind its first."""
        period_s = self.cell.horizons.action_period_s
        next_s = (self._row + 1) * period_s
        beyond = (min(now_s, next_s) + judging_s - next_s) / period_s
        return self._row + 1 + max(0, math.ceil(beyond - ROUNDING))

    def _give_up(self, asked: Asked, now_s: float) -> None:
        if asked.answered_s is None:
            self.executor.end_invocation(now_s, asked.metadata.chunk_id, "deadline")
        self._write_off(asked, DiscardReason.EXPIRED, now_s, dropped="deadline")

    def _write_off(
        self, asked: Asked, reason: DiscardReason, now_s: float, *, dropped: str = ""
    ) -> None:
        self._asked = None
        rows = self.cell.horizons.prediction_horizon
        self.executor.write_off(asked.metadata, rows, reason, now_s)
        if dropped:
            self.tally.dropped[dropped] += 1

    def _in_force(self) -> Session:
        return Session(
            calibration_epoch=self.replay.calibration_epoch,
            session_epoch=self.executor.session_epoch,
            checkpoint=self._request.checkpoint,
            sampler=self._request.sampler,
            maximum_age_s=self.cell.execution.maximum_age_s,
            controller_mode=self.cell.controller_mode,
        )


def _reason(result: Rejected | None) -> DiscardReason:
    """Why a chunk is not delivered: a layer rejected it, or it could not be judged."""
    if result is not None and result.verdict.first_layer == LAYERS[-1]:
        return REASONS[result.reason]
    return DiscardReason.INFEASIBLE
