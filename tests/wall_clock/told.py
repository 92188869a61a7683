"""One session without a process, told what happens to it in the order of a test."""

import numpy as np
from arranged import request_of

from genpolicy.execution.cell import Cell
from genpolicy.verification.checker import check_messages
from genpolicy.wall_clock.admission import judge
from genpolicy.wall_clock.messages import Answer
from genpolicy.wall_clock.session import SupervisedSession
from genpolicy.wall_clock.streamed import StreamedJournal

PERIOD_S = 0.05
STEP_M = np.array([0.0, 2e-4, 0.0])


class Told:
    """A session, and a judge that answers at once or when it is asked to."""

    def __init__(self, session, task, checker):
        self.session, self.task, self.checker, self.jobs = session, task, checker, []
        self.row = -1

    def tick(self, now_s=None):
        self.row += 1
        return self.session.tick(self.row * PERIOD_S if now_s is None else now_s, self.row)

    def answer(self, ask, *, at=0.01, **changes):
        actions = np.tile(self.task.action_at(ask.observations[-1]), (16, 1))
        said = {"invocation": ask.invocation, "checkpoint": "c" * 64, "sampler": "5" * 64,
                "method": "m", "actions": actions}  # fmt: skip
        now_s = self.row * PERIOD_S + at
        self.session.answer(Answer(**(said | changes)), now_s, self.take)

    def take(self, job):
        self.jobs.append(job)
        return True

    def decide(self, at=0.02):
        job = self.jobs.pop(0)
        result = judge(self.task, self.checker, job)
        self.session.decide(job, result, self.row * PERIOD_S + at, self.take)
        return result

    def count(self, kind):
        return sum(event.kind == kind for event in self.session.journal.events())

    def end(self):
        return self.session.end((self.row + 1) * PERIOD_S)

    def checked(self):
        events = self.session.journal.events()
        report = check_messages(
            (e.kind, {"session": e.session, "n": e.n, "t": e.t, **e.payload}) for e in events
        )
        return {violation.rule for violation in report.violations}


def begin(kit, task, checker, standing, tmp_path, *, stop_stands=False, **changes):
    tmp_path.mkdir(exist_ok=True)
    execution = kit.EXECUTION.model_copy(update={"silence_stop_s": 0.6} | changes)
    session = SupervisedSession(
        task, Cell(kit.HORIZONS, execution), request_of(tmp_path, standing),
        StreamedJournal("m/0", tmp_path / "session_0.mcap"), stop_stands=stop_stands,
    )  # fmt: skip
    return Told(session, task, checker)


def onward(task, ask, *, rows=16):
    """A chunk that goes on from what is seen, sideways by a little a row."""
    actions = np.tile(task.action_at(ask.observations[-1]), (rows, 1))
    actions[:, :3] += STEP_M * np.arange(1.0, rows + 1)[:, None]
    return actions
