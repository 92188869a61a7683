"""The same session on the virtual clock: ticks are exact, and an answer takes what was drawn.

The law of Gate D's rollouts: an answer is delivered at the first tick after its latency has passed,
its check included, and is judged for the row of that tick. Everything else is the session that the
wall clock drives: the same executor, queue, stub and supervisor, on the same recorded rows.
"""

from collections.abc import Callable
from dataclasses import dataclass

from genpolicy.feasibility.admission import Admitted, Rejected
from genpolicy.wall_clock.admission import Job
from genpolicy.wall_clock.messages import Answer, Ask
from genpolicy.wall_clock.session import SupervisedSession

ROUNDING_S = 1e-9


@dataclass(frozen=True)
class Flying:
    """An answer that is on its way.

    Attributes:
        arrival_s: When it has come and is judged, s.
        answer: What it will say.
    """

    arrival_s: float
    answer: Answer


def run_virtually(
    session: SupervisedSession,
    *,
    sample: Callable[[Ask], Answer | None],
    latency_s: Callable[[int], float],
    judged: Callable[[Job], Admitted | Rejected],
) -> None:
    """Replay a session from its first row to its last.

    Args:
        session: What is ticked; its journal is closed at the end.
        sample: What the policy answers, nothing if it failed; it takes no virtual time.
        latency_s: From observation to verdict, by number of the invocation, s.
        judged: The six layers.
    """
    period_s = session.cell.horizons.action_period_s
    flying: list[Flying] = []
    taken: list[Job] = []

    def submit(job: Job) -> bool:
        taken.append(job)
        return True

    asked, now_s = 0, 0.0
    for row in range(len(session.replay)):
        now_s = row * period_s
        due = [one for one in flying if one.arrival_s <= now_s + ROUNDING_S]
        for one in sorted(due, key=lambda item: item.arrival_s):
            flying.remove(one)
            taken.clear()
            session.answer(one.answer, now_s, submit)
            for job in taken:
                session.decide(job, judged(job), now_s, submit)
        ask = session.tick(now_s, row)
        if ask is not None:
            if (answer := sample(ask)) is not None:
                flying.append(Flying(now_s + latency_s(asked), answer))
            asked += 1
    session.end(now_s)
    session.journal.close()
