"""Actions that were too old when they were executed: LeRobot's asynchronous client, and ours.

LeRobot's client executes the front of its queue at every tick, whatever its age, and asks again
when half of the queue is left; what comes is put in by the number of the step, mixed with what
waits there (`weighted_average`: .7 of the new one) or in its place (`latest_only`). Ours executes
nothing older than `execution.maximum_age_s`, and stands instead: what it discards is counted by
reason beside what they execute. Both meet the same starts and the same latencies, drawn by the same
names: one invocation in ten takes as long as `TAIL_S`.

With `--python` LeRobot's own client and server say what is executed (`adapters/lerobot_async.py`);
without it `Theirs` does, which a test holds against a recording of them.

    python -m benchmarks.async_client
    python -m benchmarks.async_client --python build/lerobot/bin/python
"""

import argparse
import json
import subprocess
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
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
from genpolicy.execution.journal import Event
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


RULES = ("latest_only", "weighted_average")
ADAPTER = Path(__file__).parents[1] / "adapters" / "lerobot_async.py"
Executed = list[int | None]
"""By tick, the tick of the oldest observation in what was executed; None where nothing was."""


class Theirs:
    """The queue of LeRobot's client and the one place of its server, by the tick.

    Args:
        asked: As `asked_of` writes it.
        latencies_s: Of each invocation, in the order in which the server begins them.
    """

    def __init__(self, asked: dict[str, Any], latencies_s: Sequence[float]) -> None:
        self._asked, self._latencies_s = asked, iter(latencies_s)
        self._queue: dict[int, int] = {}  # number of the step, tick of the oldest observation
        self._latest, self._must_go, self._any = -1, True, False
        self._predicted: set[int] = set()
        self._waits: tuple[int, int] | None = None  # step and tick of an observation
        self._begun: tuple[float, int, int] | None = None  # when it comes, step, tick

    def tick(self, number: int) -> int | None:
        """What comes is put in; the front is executed; then an observation is sent, or none."""
        now_s, executed = number * self._asked["period_s"], None
        self._arrive(now_s)
        if self._queue:
            self._latest = next(iter(self._queue))
            executed = self._queue.pop(self._latest)
        # The client knows how long a chunk is once it has had one.
        if not self._any or len(self._queue) <= self._asked["threshold"] * self._asked["rows"]:
            self._send(max(self._latest, 0), number)
        if self._begun is None:
            self._begin(now_s)
        return executed

    def _send(self, step: int, number: int) -> None:
        must_go = self._must_go and not self._queue
        seen_before = step in self._predicted or self._asked["still"]
        if must_go or not self._predicted or not seen_before:
            self._waits = step, number
        if must_go:
            self._must_go = False

    def _begin(self, now_s: float) -> None:
        if self._waits is not None:
            step, number = self._waits
            self._waits = None
            self._predicted.add(step)
            self._begun = now_s + next(self._latencies_s), step, number

    def _arrive(self, now_s: float) -> None:
        while self._begun is not None and self._begun[0] <= now_s:
            done_s, first, number = self._begun
            self._begun, self._any, self._must_go = None, True, True
            replaced = self._asked["rule"] == "latest_only"
            # What the new chunk does not reach is gone.
            self._queue = {
                step: number if replaced else min(number, self._queue.get(step, number))
                for step in range(first, first + self._asked["rows"])
                if step > self._latest
            }
            self._begin(done_s)


def asked_of(rule: str, ticks: Sequence[int]) -> dict[str, Any]:
    """What both are asked: the rule of the queue, and ticks and latencies of each start."""
    return {
        "period_s": HORIZONS.action_period_s, "rows": HORIZONS.prediction_horizon,
        "threshold": LEAST_LEFT, "rule": rule, "still": False,
        "runs": [
            {"ticks": count, "latencies_s": list(islice(latencies_s(start), count + 1))}
            for start, count in enumerate(ticks)
        ],
    }  # fmt: skip


def as_lerobot(asked: dict[str, Any], python: Path | None = None) -> list[Executed]:
    """What LeRobot executes in each run: by its own code where its Python is named."""
    if python is None:
        theirs = [Theirs(asked, run["latencies_s"]) for run in asked["runs"]]
        return [
            [one.tick(number) for number in range(run["ticks"])]
            for one, run in zip(theirs, asked["runs"], strict=True)
        ]
    with TemporaryDirectory() as scratch:  # LeRobot writes logs where it is
        done = subprocess.run(
            [python.absolute(), ADAPTER], input=json.dumps(asked), stdout=subprocess.PIPE,
            text=True, check=True, cwd=scratch,
        )  # fmt: skip
    found: list[Executed] = json.loads(done.stdout)
    return found


def ages_s(executed: Sequence[Executed]) -> list[float]:
    """How old each executed action was."""
    period_s = HORIZONS.action_period_s
    return [
        (tick - seen) * period_s
        for run in executed
        for tick, seen in enumerate(run)
        if seen is not None
    ]


class Absent:
    """In the place of a network: what is answered is the demonstrated plan."""

    def sample(self, *_: object, **__: object) -> SimpleNamespace:
        """No evaluation."""
        return SimpleNamespace(nfe=1)


@dataclass(frozen=True)
class Ours:
    """What our executor did with the actions of all starts.

    Attributes:
        ages_s: How old each action was that it let by, s.
        ticks: Of each start.
        generated: Actions of all chunks that arrived.
        ended: What became of those that were not executed, by reason.
    """

    ages_s: list[float]
    ticks: list[int]
    generated: int
    ended: Counter[str]


def ended_otherwise(events: Iterable[Event]) -> Counter[str]:
    """Actions of chunks that are over and were not executed, by the reason in the journal."""
    counts: Counter[str] = Counter()
    for event in events:
        if event.kind in ("discard", "finish"):
            counts.update(event.payload["rows"])
    del counts["executed"]
    return counts


def ours(rollouts: int = ROLLOUTS) -> Ours:
    """Our executor on the first starts, to the end of each."""
    task = load_task(PARAMS["task"]["name"])
    specs = task.episode_specs(3, rollouts, shares={"nominal": 1.0})
    plans = {number: demonstrate(spec).actions for number, spec in enumerate(specs)}
    setup = Setup(
        task=task, checker=make_checker(
            task, FeasibilitySettings(**PARAMS["feasibility"]),
            action_period_s=HORIZONS.action_period_s,
        ),
        horizons=HORIZONS, execution=ExecutionSettings(**PARAMS["execution"]), latency=MODEL,
        perturbation="nominal", schedule=Nominal(), root_seed=SEED,
        method="bench", checkpoint="w", sampler="s",
    )  # fmt: skip
    absent: Any = Absent()
    _, run = closed_loop(Rehearsed(absent, plans), setup, [spec.start for spec in specs])
    events = [event for rollout in run for event in rollout.journal.events()]
    return Ours(
        [event.payload["age_ns"] / 1e9 for event in events if event.kind == "accept"],
        [rollout.tick for rollout in run],
        sum(rollout.executor.conservation().actions.generated for rollout in run),
        ended_otherwise(events),
    )


def main(argv: Sequence[str] | None = None) -> int:
    """Print both counts."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.async_client")
    parser.add_argument("--python", type=Path, help="that has LeRobot: its own code is asked")
    python = parser.parse_args(argv).python
    mine = ours()
    ticks = mine.ticks
    rows = {f"LeRobot, {rule}": ages_s(as_lerobot(asked_of(rule, ticks), python)) for rule in RULES}
    limit_s = max(ExecutionSettings(**PARAMS["execution"]).maximum_age_s.values())
    print(f"{ROLLOUTS} starts, {sum(ticks)} ticks; an action may be {limit_s:g} s old")
    print(f"LeRobot's queue by {'its own code' if python else 'our words for it'}")
    print("rule                       executed  too old   share  oldest s  stood")
    for name, ages in {**rows, "genpolicy": mine.ages_s}.items():
        old = sum(age > limit_s + 1e-9 for age in ages)
        print(
            f"{name:26s} {len(ages):8d} {old:8d} {old / len(ages):7.1%} {max(ages):9.2f} "
            f"{sum(ticks) - len(ages):6d}"
        )
    print(f"genpolicy, of {mine.generated} actions that came:")
    for reason, count in mine.ended.most_common():
        print(f"  {reason:26s} {count:6d} {count / mine.generated:7.1%}")
    left = mine.generated - len(mine.ages_s) - mine.ended.total()
    print(f"  {'executed':26s} {len(mine.ages_s):6d} {len(mine.ages_s) / mine.generated:7.1%}")
    print(f"  {'in the queue at the end':26s} {left:6d} {left / mine.generated:7.1%}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
