"""Actions that were too old when they were executed: a queue filled as LeRobot's, and ours.

LeRobot's asynchronous client asks for the next chunk when half of its queue is left, puts what
comes into the queue by the number of the step, mixes what overlaps (`weighted_average`: .7 of the
new one) or takes the new one (`latest_only`), and executes the front of the queue at every tick,
whatever its age. Ours executes nothing older than `execution.maximum_age_s`, and stands instead.
Both meet the same starts and the same latencies, drawn by the same names: one invocation in ten
takes as long as `TAIL_S`. LeRobot's rule is written here from its documentation (0.6.1), since its
own client needs a robot.

    python -m benchmarks.async_client
"""

from collections import deque
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np

from benchmarks.simulation import HORIZONS, PARAMS, Rehearsed, closed_loop
from genpolicy.contract.latency import DECLARED_TERMS, MEASURED_TERMS, Term
from genpolicy.evidence.admission_context import make_checker
from genpolicy.evidence.stress.latency import DeclaredTerm, LatencyModel, draw_latency
from genpolicy.evidence.stress.perturbations import Nominal
from genpolicy.evidence.stress.state import Setup
from genpolicy.execution.cell import ExecutionSettings
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.tasks.api import load_task
from genpolicy.tasks.tabletop_insertion.episodes import demonstrate

ROLLOUTS, SEED, TAIL_S = 16, 1, 0.6
LEAST_LEFT = 0.5
"""Share of the queue at which LeRobot's client asks again (`chunk_size_threshold`)."""
MODEL = LatencyModel(
    {name: DeclaredTerm(0.001, 0.002) for name in DECLARED_TERMS},
    {name: np.full(10, 0.004) for name in MEASURED_TERMS}
    | {str(Term.SAMPLE): np.append(np.full(9, 0.05), TAIL_S)},
    0.0,
)


def latencies_s(start: int) -> Iterator[float]:
    """End-to-end latency of each invocation of a start, one after the other."""
    number = 0
    while True:
        yield draw_latency(
            MODEL, root_seed=SEED, perturbation="nominal", start=start, invocation=number,
            extra_s={}, compute_factor=1.0,
        ).total_s  # fmt: skip
        number += 1


def as_lerobot(start: int, ticks: int) -> tuple[list[float], int]:
    """Ages, s, of what is executed in so many ticks, and at how many the queue was empty.

    A mean of two predictions is as old as the older one that is in it; `latest_only` keeps the new
    one alone, which is the kinder count, and is what is counted here.
    """
    period_s, rows = HORIZONS.action_period_s, HORIZONS.prediction_horizon
    queue: deque[tuple[int, float]] = deque()  # number of the step, when its observation was seen
    latest, empty, ages = -1, 0, []
    asked: tuple[float, int, float] | None = None
    draws = latencies_s(start)
    for tick in range(ticks):
        now_s = tick * period_s
        if asked is not None and asked[0] <= now_s:
            _, first, seen_s = asked
            came = {step: seen_s for step in range(first, first + rows) if step > latest}
            queue = deque(sorted((dict(queue) | came).items()))
            asked = None
        if asked is None and len(queue) <= LEAST_LEFT * rows:
            asked = now_s + next(draws), latest + 1, now_s
        if queue:
            latest, seen_s = queue.popleft()
            ages.append(now_s - seen_s)
        else:
            empty += 1
    return ages, empty


class Absent:
    """In the place of a network: what is answered is the demonstrated plan."""

    def sample(self, *_: object, **__: object) -> SimpleNamespace:
        """No evaluation."""
        return SimpleNamespace(nfe=1)


def main() -> None:
    """Print both counts."""
    task = load_task(PARAMS["task"]["name"])
    specs = task.episode_specs(3, ROLLOUTS, shares={"nominal": 1.0})
    plans = {number: demonstrate(spec).actions for number, spec in enumerate(specs)}
    execution = ExecutionSettings(**PARAMS["execution"])
    setup = Setup(
        task=task, checker=make_checker(
            task, FeasibilitySettings(**PARAMS["feasibility"]),
            action_period_s=HORIZONS.action_period_s,
        ),
        horizons=HORIZONS, execution=execution, latency=MODEL,
        perturbation="nominal", schedule=Nominal(), root_seed=SEED,
        method="bench", checkpoint="w", sampler="s",
    )  # fmt: skip
    absent: Any = Absent()
    _, rollouts = closed_loop(Rehearsed(absent, plans), setup, [spec.start for spec in specs])
    ours = [
        event.payload["age_ns"] / 1e9
        for rollout in rollouts
        for event in rollout.journal.events()
        if event.kind == "accept"
    ]
    theirs, empty = [], 0
    for number, rollout in enumerate(rollouts):
        ages, starved = as_lerobot(number, rollout.tick)
        theirs += ages
        empty += starved
    ticks = sum(rollout.tick for rollout in rollouts)
    limit_s = max(execution.maximum_age_s.values())
    print(f"{ROLLOUTS} starts, {ticks} ticks; an action may be {limit_s:g} s old")
    print("rule                   executed  too old   share  oldest s  stood")
    for name, ages, stood in (
        ("LeRobot's queue", theirs, empty), ("genpolicy", ours, ticks - len(ours)),
    ):  # fmt: skip
        old = sum(age > limit_s + 1e-9 for age in ages)
        print(
            f"{name:22s} {len(ages):8d} {old:8d} {old / len(ages):7.1%} {max(ages):9.2f} {stood:6d}"
        )


if __name__ == "__main__":
    main()
