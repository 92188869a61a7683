"""Latency against the number of candidates, on a quiet machine and beside a competing load."""

import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager

import numpy as np

from genpolicy.candidates.brought import BroughtPolicy
from genpolicy.candidates.contenders import Contender, Running, joining_of, opened
from genpolicy.data.dataset import Dataset, load_dataset
from genpolicy.evidence.reproducibility import burning
from genpolicy.evidence.reproducibility.benchmark import invoke
from genpolicy.evidence.reproducibility.latency import OBSERVATIONS, LatencyPlan
from genpolicy.evidence.reproducibility.measure import in_fresh_process
from genpolicy.evidence.rows.reproducibility import CandidatesRow
from genpolicy.policies.fixtures import fixture_observations
from genpolicy.tasks.api import load_task

COUNTS = (1, 4, 8, 32)
REPEATS = 20
DISCARDED = 3
QUIET, BUSY = "none", "every core"


def candidates_rows(plan: LatencyPlan, policies: Sequence[Contender]) -> list[CandidatesRow]:
    """What an invocation costs that draws several candidates, without the checks of them.

    Args:
        plan: How methods are timed.
        policies: Those of them that draw; the others always draw the same.
    """
    return [
        row
        for judged in policies
        if _draws(judged)
        for row in in_fresh_process(measure_counts, plan, judged)
    ]


def _draws(judged: Contender) -> bool:
    if isinstance(judged, BroughtPolicy):
        return judged.entry.stochastic
    return judged.load().stochastic


def measure_counts(plan: LatencyPlan, judged: Contender) -> list[CandidatesRow]:
    """Rows of one method, measured in this process."""
    data = load_dataset(plan.dataset)
    scene = load_task(plan.task).scene_path
    with opened(judged, data.observation_contract, scene=scene) as policy:
        rows = _measured(plan, policy, data, judged.name, QUIET)
        with competing():
            return rows + _measured(plan, policy, data, judged.name, BUSY)


@contextmanager
def competing() -> Iterator[list[subprocess.Popen[bytes]]]:
    """A process on every core that multiplies matrices inside the block; yields them.

    Raises:
        RuntimeError: One of them ended before it had begun.
    """
    with ExitStack() as burners:
        started = [burners.enter_context(_burner()) for _ in os.sched_getaffinity(0)]
        for burner in started:
            assert burner.stdout is not None
            if burner.stdout.readline() != burning.READY:
                raise RuntimeError("a competing process ended before it had begun")
        yield started


@contextmanager
def _burner() -> Iterator[subprocess.Popen[bytes]]:
    """Popen waits for it at the end of the block, with its input closed."""
    with subprocess.Popen(
        [sys.executable, burning.__file__], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as burner:
        yield burner


def _measured(
    plan: LatencyPlan, policy: Running, data: Dataset, name: str, load: str
) -> list[CandidatesRow]:
    seen = fixture_observations(data, horizons=plan.horizons, count=OBSERVATIONS)
    rows = []
    joining = joining_of(plan.joining, policy)
    for count in COUNTS:
        for repeat in range(-DISCARDED, REPEATS):
            row = seen[repeat % len(seen)][None]
            spans = invoke(policy, row, repeat=repeat, candidates=count, joining=joining)
            if repeat >= 0:
                rows.append(
                    CandidatesRow(
                        method=name, candidates=count, load=load, repeat=repeat,
                        seconds=float(np.nansum(list(spans.values()))),
                    )
                )  # fmt: skip
    return rows
