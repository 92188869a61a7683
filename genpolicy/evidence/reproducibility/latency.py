"""Measured latency of every method, twice in fresh processes; and the virtual clock's models.

The unit is the process: invocations of one share its memory layout, its caches and the mood of the
machine. So each of the two measurements takes several processes, in turns, and what a model says is
held against a process that it was not made from.
"""

import functools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd

from genpolicy.candidates.brought import BroughtPolicy
from genpolicy.candidates.contenders import Contender
from genpolicy.candidates.joining import JoiningSettings
from genpolicy.candidates.judged import candidates_of
from genpolicy.candidates.planned import PlannedPolicy
from genpolicy.candidates.wire.policy import running
from genpolicy.contract.chunk import Proposal
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.latency import DECLARED_TERMS, MEASURED_TERMS, OWNERS, Term
from genpolicy.data.dataset import load_dataset
from genpolicy.errors import ContractError
from genpolicy.evidence.admission_context import context_at_rest, make_checker, recorded_proposal
from genpolicy.evidence.reproducibility.benchmark import (
    Measurement,
    measure_loaded,
    measure_policy,
    measure_running,
)
from genpolicy.evidence.reproducibility.measure import in_fresh_process
from genpolicy.evidence.reproducibility.processor import (
    Machine,
    machine_between,
    machine_now,
)
from genpolicy.evidence.rows.reproducibility import LatencyModelRow, LatencyRow, MachineRow
from genpolicy.evidence.stress.latency import DeclaredTerm, LatencyModel, draw_latency
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.policies.fixtures import fixture_observations
from genpolicy.progress import counting
from genpolicy.tasks.api import load_task

RUNS = (1, 2)
PROCESSES = (1, 2, 3)
"""Of each run. Three: processes whose medians differ by a tenth are found alike up to a factor of
1.5 in four of five comparisons (`genpolicy.statistics.equivalence`); two would need .06."""
OBSERVATIONS = 32
DRAWN = 1000
LEVELS = (0.5, 0.95)
INVOCATION = ["run", "process", "repeat"]


@dataclass(frozen=True)
class LatencyPlan:
    """How every method is timed.

    Attributes:
        dataset: Folder of the dataset, for realistic observations.
        task: Registered name of the task.
        feasibility: Thresholds of the six layers; their run time is the term `project`.
        horizons: Common horizons.
        samples: Candidates that an invocation of a stochastic method draws where it is deployed.
        warm: Warm invocations of a process.
        cold: Cold invocations of a process.
        joining: How chunks join where they are deployed.
    """

    dataset: Path
    task: str
    feasibility: FeasibilitySettings
    horizons: HorizonConfig
    samples: int
    warm: int
    cold: int
    joining: JoiningSettings = field(default_factory=JoiningSettings)


@dataclass(frozen=True)
class Taken:
    """What the measurements of all methods found.

    Attributes:
        rows: Terms, with their times.
        machine: What ran beside each of the processes.
    """

    rows: list[LatencyRow]
    machine: list[MachineRow]


def measure_all(plan: LatencyPlan, policies: Sequence[Contender]) -> Taken:
    """Terms measured on this machine: two runs of several processes per method, in turns.

    Methods and runs take turns, so that a machine which grows slower slows all of them. How far it
    is, is said between two processes, while nothing is timed.
    """
    taken = Taken([], [])
    turns = [(*turn, judged) for turn in product(PROCESSES, RUNS) for judged in policies]
    for turn in counting(len(turns), "timed processes"):
        process, run, judged = turns[turn]
        items, beside = in_fresh_process(measure_process, plan, judged)
        taken.rows.extend(_measured_row(judged.name, run, process, item) for item in items)
        taken.machine.append(MachineRow(judged.name, run, process, **vars(beside)))
    return taken


def _measured_row(method: str, run: int, process: int, item: Measurement) -> LatencyRow:
    return LatencyRow(
        method=method,
        run=run,
        process=process,
        component=item.component,
        owner=str(OWNERS[Term(item.component)]),
        temperature=item.temperature,
        repeat=item.repeat,
        seconds=item.seconds,
        source="measured",
        waited_s=item.waited_s,
    )


def declared_rows(
    names: Sequence[str],
    declared: Mapping[str, DeclaredTerm],
    *,
    draws: int,
    generator: np.random.Generator,
) -> list[LatencyRow]:
    """Terms that this machine cannot measure, drawn between their bounds, equal for all methods.

    Args:
        names: Methods.
        declared: Bounds of every such term.
        draws: Values drawn of each.
        generator: Draws them.

    Raises:
        ContractError: A term without bounds, or bounds of no term.
    """
    if set(declared) != set(DECLARED_TERMS):
        raise ContractError(
            where="latency.declared",
            found=f"bounds of {', '.join(sorted(declared))}",
            expected=f"of {', '.join(DECLARED_TERMS)}",
            action="Declare each term that no benchmark here can measure; unknown is not zero.",
        )
    rows = []
    for term in DECLARED_TERMS:
        bounds = declared[term]
        drawn = generator.uniform(bounds.minimum_s, bounds.maximum_s, size=draws)
        rows += [
            LatencyRow(
                method=name,
                run=RUNS[0],
                process=PROCESSES[0],
                component=str(term),
                owner=str(OWNERS[term]),
                temperature="warm",
                repeat=repeat,
                seconds=float(value),
                source="declared",
                waited_s=None,
            )
            for name in names
            for repeat, value in enumerate(drawn)
        ]
    return rows


def measure_process(plan: LatencyPlan, judged: Contender) -> tuple[list[Measurement], Machine]:
    """Spans of one method in this process, and what ran on the machine meanwhile."""
    before = machine_now()
    items = measure_terms(plan, judged)
    return items, machine_between(before, machine_now())


def measure_terms(plan: LatencyPlan, judged: Contender) -> list[Measurement]:
    """Cold and warm spans of one method, with the six layers timed as `project`.

    Of a policy that was brought, the first answer of a server that was started for it is the cold
    one: how long it loads is nobody's latency.
    """
    data, task = load_dataset(plan.dataset), load_task(plan.task)
    observations = fixture_observations(data, horizons=plan.horizons, count=OBSERVATIONS)
    checker = make_checker(task, plan.feasibility, action_period_s=plan.horizons.action_period_s)
    period_s = plan.horizons.action_period_s

    def project(proposal: Proposal, place: int) -> object:
        """All that is done before an answer may be used: the state of the arm is found, too."""
        seen = observations[place][-1]
        recorded = recorded_proposal(
            task,
            proposal.actions,
            seen,
            action_period_s=period_s,
            chunk_id=proposal.metadata.chunk_id,
        )
        return checker.admit(recorded, context=context_at_rest(task, checker, seen))

    if isinstance(judged, BroughtPolicy):
        return measure_running(
            functools.partial(running, judged, data.observation_contract, scene=task.scene_path),
            observations,
            warm_repeats=plan.warm,
            candidates=plan.samples if judged.entry.stochastic else 1,
            project=project,
            joining=plan.joining,
        )
    policy = judged.load()
    if isinstance(judged, PlannedPolicy):
        return measure_loaded(
            judged.load,
            observations,
            cold_repeats=plan.cold,
            warm_repeats=plan.warm,
            candidates=candidates_of(policy, plan.samples),
            project=project,
            joining=plan.joining.of(judged.name, guided=policy.guided),
        )
    return measure_policy(
        judged.folder,
        observations,
        expected_sha256=judged.sha256,
        device=judged.device,
        cold_repeats=plan.cold,
        warm_repeats=plan.warm,
        candidates=candidates_of(policy, plan.samples),
        project=project,
        joining=plan.joining.of(judged.name, guided=policy.guided),
    )


def latency_models(
    table: pd.DataFrame, declared: Mapping[str, DeclaredTerm]
) -> dict[str, LatencyModel]:
    """The virtual clock's model of each method, from `latency.parquet`.

    A term that a policy behind the wire does not measure is NaN: its time is in its term `sample`.

    Raises:
        ContractError: A method lacks a measured term.
    """
    models = {}
    measured = table[table["source"] == "measured"]
    for method, rows in measured.groupby("method", sort=True):
        warm, cold = rows[rows["temperature"] == "warm"], rows[rows["temperature"] == "cold"]
        terms = {
            str(name): np.sort(part["seconds"].to_numpy(dtype=np.float64))
            for name, part in warm.fillna({"seconds": 0.0}).groupby("component", sort=True)
        }
        missing = [str(name) for name in MEASURED_TERMS if name not in terms]
        if missing or len(cold) == 0:
            raise ContractError(
                where=f"latency of {method}",
                found=f"without {missing or 'cold invocations'}",
                expected="every measured term, cold and warm",
                action="Run the latency stage again (`dvc repro latency`).",
            )
        first = float(cold.groupby(INVOCATION)["seconds"].sum().max())
        typical = float(warm.groupby(INVOCATION)["seconds"].sum().median())
        models[str(method)] = LatencyModel(declared, terms, max(0.0, first - typical))
    return models


def model_rows(
    rows: Sequence[LatencyRow], declared: Mapping[str, DeclaredTerm], *, root_seed: int
) -> list[LatencyModelRow]:
    """What the model made from all other processes says of each process.

    Only measured terms are summed: nothing here can contradict a declared one. The same is said
    without the time that was waited for a processor, of methods of which all of it is known.

    Args:
        rows: Measured rows of both runs.
        declared: Bounds of the terms that this machine cannot measure.
        root_seed: Root seed of the ladder.
    """
    table = pd.DataFrame([vars(row) for row in rows])
    waited = table["waited_s"].astype(float)
    unknown = set(table.loc[waited.isna(), "method"])
    known = ~table["method"].isin(unknown)
    running = table.assign(seconds=table["seconds"] - waited)[known]
    ran = _held_out(running, declared, root_seed) if known.any() else {}
    return [
        LatencyModelRow(*place, *quantiles, *ran.get(place, (None, None)))
        for place, quantiles in _held_out(table, declared, root_seed).items()
    ]


def _held_out(
    table: pd.DataFrame, declared: Mapping[str, DeclaredTerm], root_seed: int
) -> dict[tuple[str, int, int, float], tuple[float, float]]:
    """Quantiles of each process, measured and drawn, s, by method, run, process and level."""
    warm = table[table["temperature"] == "warm"]
    found = {}
    for run, process in warm[["run", "process"]].drop_duplicates().itertuples(index=False):
        part = warm[(warm["run"] == run) & (warm["process"] == process)]
        others = table[(table["run"] != run) | (table["process"] != process)]
        spans = part.groupby(["method", "repeat"])["seconds"].sum()
        for method, model in latency_models(others, declared).items():
            drawn = np.fromiter(_drawn_spans(model, root_seed), dtype=np.float64)
            measured = spans.loc[method].to_numpy()
            for level in LEVELS:
                found[method, int(run), int(process), level] = (
                    float(np.quantile(measured, level, method="higher")),
                    float(np.quantile(drawn, level, method="higher")),
                )
    return found


def _drawn_spans(model: LatencyModel, root_seed: int) -> Iterator[float]:
    """Measured terms of drawn invocations, summed, s; none of them is the first of a session."""
    for invocation in range(1, DRAWN + 1):
        draw = draw_latency(
            model,
            root_seed=root_seed,
            perturbation="latency/model",
            start=0,
            invocation=invocation,
            extra_s={},
            compute_factor=1.0,
        )
        yield sum(draw.terms[str(name)] for name in MEASURED_TERMS)
