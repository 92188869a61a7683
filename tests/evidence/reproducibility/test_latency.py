"""From the measured table to the virtual clock's models."""

from dataclasses import fields
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from genpolicy.candidates.planned import planned
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.latency import DECLARED_TERMS, MEASURED_TERMS, OWNERS
from genpolicy.errors import ConfigError, ContractError
from genpolicy.evidence.reproducibility import latency
from genpolicy.evidence.reproducibility.latency import (
    DRAWN,
    LEVELS,
    PROCESSES,
    RUNS,
    LatencyPlan,
    declared_rows,
    latency_models,
    measure_all,
    measure_terms,
    model_rows,
)
from genpolicy.evidence.reproducibility.processor import Machine
from genpolicy.evidence.rows.reproducibility import LatencyRow
from genpolicy.evidence.stress.latency import DeclaredTerm
from genpolicy.feasibility.admission import Admitted, FeasibilityChecker
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.seeds import stream

DECLARED = {name: DeclaredTerm(0.001, 0.002) for name in DECLARED_TERMS}


def table(methods=("a", "b"), *, warm=20, cold=2):
    rows = []
    for method in methods:
        for run in (1, 2):
            for temperature, repeats, scale in (("warm", warm, 1.0), ("cold", cold, 50.0)):
                rows += [
                    {
                        "method": method, "run": run, "process": 1, "component": name,
                        "temperature": temperature, "repeat": repeat,
                        "seconds": scale * 1e-3 * (1 + (7 * repeat) % 5), "source": "measured",
                    }
                    for name in MEASURED_TERMS
                    for repeat in range(repeats)
                ]  # fmt: skip
        rows.append(
            {
                "method": method, "run": 1, "process": 1, "component": "network",
                "temperature": "warm", "repeat": 0, "seconds": 9.0, "source": "declared",
            }
        )  # fmt: skip
    return pd.DataFrame(rows)


def test_methods_and_runs_take_turns_and_how_far_it_is_is_said_between_two(monkeypatch):
    happened = []

    def in_fresh_process(work, plan, judged):
        happened.append(judged.name)
        return [], Machine(**dict.fromkeys([field.name for field in fields(Machine)], 0))

    def counting(total, what):
        for done in range(total):
            happened.append((done, total))
            yield done

    monkeypatch.setattr(latency, "in_fresh_process", in_fresh_process)
    monkeypatch.setattr(latency, "counting", counting)
    taken = measure_all(None, [SimpleNamespace(name="a"), SimpleNamespace(name="b")])
    turns = [(row.process, row.run, row.method) for row in taken.machine]
    assert turns == [(process, run, name) for process in PROCESSES for run in RUNS for name in "ab"]
    assert happened == [
        said for done, (*_, name) in enumerate(turns) for said in ((done, len(turns)), name)
    ]


def test_models_hold_the_sorted_warm_times_of_both_runs():
    models = latency_models(table(), DECLARED)
    assert sorted(models) == ["a", "b"]
    for model in models.values():
        for name in MEASURED_TERMS:
            values = model.measured[name]
            assert len(values) == 40
            assert np.all(np.diff(values) >= 0)
            assert values.max() == pytest.approx(5e-3)  # no cold time among them
        assert model.declared["network"].maximum_s == 0.002  # bounds, not the drawn 9 s


def test_the_cold_extra_is_the_worst_first_invocation_beyond_a_typical_one():
    (model,) = latency_models(table(("a",)), DECLARED).values()
    # By hand: five components. Cold repeats 0 and 1 take 5 * 50 * 1 ms and 5 * 50 * 3 ms; warm
    # sums are 5 ms times 1, 3, 5, 2, 4 in equal shares, median 15 ms.
    assert model.cold_extra_s == pytest.approx(0.750 - 0.015)


@pytest.mark.parametrize("term", MEASURED_TERMS)
def test_a_missing_term_is_refused_by_method_and_name(term):
    rows = table()
    rows = rows[(rows["method"] != "b") | (rows["component"] != term)]
    with pytest.raises(ContractError, match=rf"latency of b .*{term}"):
        latency_models(rows, DECLARED)


def test_a_missing_declared_term_is_refused():
    short = {name: item for name, item in DECLARED.items() if name != "queue"}
    with pytest.raises(ContractError, match="queue"):
        latency_models(table(), short)


def test_no_cold_invocation_is_refused():
    with pytest.raises(ContractError, match="cold invocations"):
        latency_models(table(cold=0), DECLARED)


def test_declared_terms_are_drawn_within_their_bounds_alike_for_all_methods_with_an_owner():
    rows = declared_rows(["a", "b"], DECLARED, draws=30, generator=stream(1, "declared"))
    assert {row.component for row in rows} == set(DECLARED_TERMS)
    assert all(row.owner == OWNERS[row.component] and row.source == "declared" for row in rows)
    assert all(0.001 <= row.seconds <= 0.002 for row in rows)
    own = {name: [r.seconds for r in rows if r.method == name] for name in ("a", "b")}
    assert own["a"] == own["b"] and len(own["a"]) == 30 * len(DECLARED_TERMS)


def test_a_term_without_bounds_or_bounds_of_no_term_are_refused():
    short = {name: item for name, item in DECLARED.items() if name != "queue"}
    more = {**DECLARED, "sample": DECLARED["queue"]}
    for declared in (short, more):
        with pytest.raises(ContractError, match=r"latency\.declared is bounds of"):
            declared_rows(["a"], declared, draws=1, generator=stream(1, "declared"))


@pytest.mark.parametrize("bounds", [(-0.001, 0.1), (0.2, 0.1), (0.0, np.nan), (0.0, np.inf)])
def test_bounds_that_are_no_times_are_refused(bounds):
    with pytest.raises(ConfigError, match=r"latency\.declared"):
        DeclaredTerm(*bounds)


def measured(spans, *, processes=3, waits=lambda *_: 0.0):
    """Rows of method `a`: `spans(run, process, repeat, term)` seconds; cold as warm."""
    return [
        LatencyRow(
            method="a", run=run, process=process, component=str(name), owner=str(OWNERS[name]),
            temperature=temperature, repeat=repeat, seconds=spans(run, process, repeat, str(name)),
            source="measured", waited_s=waits(run, process, repeat, str(name)),
        )
        for run in (1, 2)
        for process in range(1, processes + 1)
        for temperature in ("cold", "warm")
        for repeat in range(40)
        for name in MEASURED_TERMS
    ]  # fmt: skip


def test_a_model_of_independent_terms_says_what_the_other_run_takes():
    times = stream(3, "latency").uniform(1e-3, 2e-3, size=(3, 4, 40, 5))
    order = {str(name): index for index, name in enumerate(MEASURED_TERMS)}
    rows = model_rows(
        measured(lambda run, process, repeat, name: times[run, process, repeat, order[name]]),
        DECLARED, root_seed=1,
    )  # fmt: skip
    assert [(r.run, r.process, r.level) for r in rows] == [
        (run, process, level) for run in (1, 2) for process in (1, 2, 3) for level in LEVELS
    ]
    assert all(row.measured_s == pytest.approx(row.drawn_s, rel=0.1) for row in rows)


def test_slow_terms_that_coincide_are_more_than_the_model_draws():
    """The model draws terms apart: a machine that stalls as a whole is beyond it."""
    rows = model_rows(
        measured(lambda run, process, repeat, name: 0.02 if repeat % 10 == 0 else 0.001),
        DECLARED, root_seed=1,
    )  # fmt: skip
    high = [row for row in rows if row.level == 0.95]
    assert all(row.measured_s == pytest.approx(0.1) for row in high)
    # Two of five slow at once are drawn in one of ten, all five in one of a hundred thousand.
    assert all(row.drawn_s == pytest.approx(0.043) for row in high)
    assert DRAWN >= 1000


def test_a_process_is_no_part_of_the_model_that_it_is_held_against():
    """One slow process of six: the model of the others does not know it."""
    slow = (2, 3)
    rows = model_rows(
        measured(lambda run, process, repeat, name: 0.02 if (run, process) == slow else 0.001),
        DECLARED, root_seed=1,
    )  # fmt: skip
    for row in rows:
        own = (row.run, row.process) == slow
        assert row.measured_s == pytest.approx(0.1 if own else 0.005)
        assert not own or row.drawn_s == pytest.approx(0.005)
    (high,) = [r for r in rows if (r.run, r.process) == slow and r.level == 0.95]
    assert high.measured_s / high.drawn_s == pytest.approx(20.0)


def test_the_time_waited_is_in_the_model_on_the_wall_and_not_in_the_one_beside_it():
    """One process of six waited for nine tenths of its time."""
    busy = (2, 3)
    rows = model_rows(
        measured(
            lambda run, process, repeat, name: 0.01 if (run, process) == busy else 0.001,
            waits=lambda run, process, repeat, name: 0.009 if (run, process) == busy else 0.0,
        ),
        DECLARED, root_seed=1,
    )  # fmt: skip
    for row in rows:
        own = (row.run, row.process) == busy
        assert row.measured_s == pytest.approx(0.05 if own else 0.005)
        assert row.measured_running_s == pytest.approx(0.005)
        assert row.drawn_running_s == pytest.approx(0.005)


def test_of_a_method_with_one_unknown_wait_nothing_is_said_without_it():
    def some(run, process, repeat, name):
        return None if (run, process, repeat, name) == (1, 1, 0, "encode") else 0.0

    rows = model_rows(measured(lambda *_: 0.001, waits=some), DECLARED, root_seed=1)
    assert len(rows) == 12
    assert all(row.measured_running_s is None and row.drawn_running_s is None for row in rows)


def test_a_planner_is_timed_like_everybody_and_what_it_does_not_do_takes_hardly_any_time(dataset):
    horizons = HorizonConfig(
        observation_horizon=2, prediction_horizon=16, execution_horizon=8, action_period_s=0.05
    )
    plan = LatencyPlan(
        dataset=dataset, task="tabletop_insertion", feasibility=FeasibilitySettings(),
        horizons=horizons, samples=4, warm=3, cold=2,
    )  # fmt: skip
    rows = measure_terms(plan, planned(plan.task, horizons, seed=0))
    found = {(row.component, row.temperature, row.repeat) for row in rows}
    repeats = [("cold", 0), ("cold", 1), ("warm", 0), ("warm", 1), ("warm", 2)]
    asked = {(str(term), *repeat) for term in MEASURED_TERMS for repeat in repeats}
    assert found == asked and len(rows) == len(asked) and all(row.seconds > 0 for row in rows)
    took = {
        name: sum(row.seconds for row in rows if row.component == name)
        for name in ("encode", "sample")
    }
    assert took["encode"] < took["sample"]


def test_a_chunk_is_judged_from_the_arm_that_it_was_planned_for(dataset, monkeypatch):
    """In another one's place it is refused by the first layers, which takes half of the time."""
    found, plain = [], FeasibilityChecker.admit

    def spied(self, proposal, *, context):
        found.append(plain(self, proposal, context=context))
        return found[-1]

    monkeypatch.setattr(FeasibilityChecker, "admit", spied)
    horizons = HorizonConfig(
        observation_horizon=2, prediction_horizon=16, execution_horizon=8, action_period_s=0.05
    )
    plan = LatencyPlan(
        dataset=dataset, task="tabletop_insertion", feasibility=FeasibilitySettings(),
        horizons=horizons, samples=4, warm=20, cold=3,
    )  # fmt: skip
    measure_terms(plan, planned(plan.task, horizons, seed=0))
    assert len(found) == 33
    assert sum(isinstance(one, Admitted) for one in found) == 33
