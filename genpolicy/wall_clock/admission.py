"""Admission beside the ticks: an answer is judged in a thread, so that no tick waits for it.

Chunks are admitted where they are used, in the supervisor's process: an admitted chunk can be
neither sent nor copied. One job at a time; one that never ends keeps the policy from commanding,
and the watchdog from nothing.
"""

import os
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from queue import SimpleQueue

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.chunk import Proposal
from genpolicy.evidence.admission_context import Moment, Session, context_of
from genpolicy.feasibility.admission import Admitted, FeasibilityChecker, Rejected
from genpolicy.tasks.api import Task

Array = NDArray[np.float64]

REMEMBERED, MOST_SHARE = 64, 0.9
"""Jobs that are remembered, and the share of them that the usual time covers."""


@dataclass(frozen=True)
class Job:
    """One chunk, and what was seen when it was asked for.

    Attributes:
        proposal: The chunk.
        history: The last two observations or fewer, newest last. Shape (n, D_o).
        commanded: The last commands before the chunk's first row, oldest first. Shape (m, 10).
        session: What is in force.
        event_s: When the newest observation was exposed, s.
        now_s: When the answer came, s.
        phase: Task phase of the newest observation.
        late_rows: Rows that are late and will never be executed.
    """

    proposal: Proposal
    history: Array
    commanded: Array
    session: Session
    event_s: float
    now_s: float
    phase: str
    late_rows: int


Result = Admitted | Rejected | None
"""None where judging failed: what could not be judged is not admitted."""


def judge(task: Task, checker: FeasibilityChecker, job: Job) -> Admitted | Rejected:
    """Projection and the six layers, as in shadow evidence: the arm is where it is observed."""
    q, _ = checker.ik_chunk(task.action_at(job.history[-1])[None], task.posture_rad)
    before = None
    if len(job.history) > 1:
        found, reached = checker.ik_chunk(task.action_at(job.history[-2])[None], q[0])
        before = found[0] if reached[0] else None
    moment = Moment(
        job.history[-1], q[0], list(job.commanded), now_s=job.now_s, phase=job.phase,
        q_before=before, measured_at_s=job.event_s,
    )  # fmt: skip
    context = context_of(task, checker, moment, session=job.session, late_rows=job.late_rows)
    return checker.admit(job.proposal, context=context)


class AdmissionThread:
    """One judge, one job at a time.

    Args:
        judged: What is asked of a job.

    Attributes:
        descriptor: Readable when a result waits.
        failures: Jobs that could not be judged.
    """

    def __init__(self, judged: Callable[[Job], Admitted | Rejected]) -> None:
        self.descriptor, self._wake = os.pipe()
        self.failures = 0
        self._judged = judged
        self._jobs: SimpleQueue[Job] = SimpleQueue()
        self._results: SimpleQueue[tuple[Job, Result]] = SimpleQueue()
        self._busy = False
        self._lasted_s: deque[float] = deque(maxlen=REMEMBERED)
        threading.Thread(target=self._work, name="admission", daemon=True).start()

    @property
    def usual_s(self) -> float:
        """How long most of the last jobs took, s; 0 before the first."""
        known = sorted(self._lasted_s)
        return known[int(MOST_SHARE * len(known))] if known else 0.0

    def submit(self, job: Job) -> bool:
        """Whether the job was taken; not while another one is judged."""
        if self._busy:
            return False
        self._busy = True
        self._jobs.put(job)
        return True

    def result(self) -> tuple[Job, Result] | None:
        """What was judged since the last call; never waits."""
        if self._results.empty():
            return None
        os.read(self.descriptor, 1)
        self._busy = False
        return self._results.get()

    def _work(self) -> None:
        while True:
            job = self._jobs.get()
            begun_s = time.monotonic()
            found: Result = None
            try:
                found = self._judged(job)
            except Exception:  # whatever a policy answered, the thread goes on
                self.failures += 1
            self._lasted_s.append(time.monotonic() - begun_s)
            self._results.put((job, found))
            os.write(self._wake, b".")
