"""What invocations had to take: drawn by the checker, by the virtual clock, and by hand."""

import math
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from pydantic import TypeAdapter

from genpolicy.contract.latency import DECLARED_TERMS, MEASURED_TERMS
from genpolicy.evidence.reproducibility.latency import latency_models
from genpolicy.evidence.stress.exposures import sensor_terms
from genpolicy.evidence.stress.latency import DeclaredTerm, draw_check, draw_latency
from genpolicy.evidence.stress.perturbations import Perturbation, injection
from genpolicy.execution.journal import Journal, write_journal
from genpolicy.verification.owed import Hit, Times, stated_otherwise

SEED = 7
DECLARED = {str(term): (0.001 * n, 0.002 * n) for n, term in enumerate(DECLARED_TERMS)}
PLANNED = {
    "nominal": {"kind": "nominal"},
    "camera": {"kind": "camera_delay", "probability": 1.0, "magnitude_s": 0.08},
    "frames": {"kind": "frame_drop", "probability": 0.4},
    "stall": {"kind": "policy_stall", "probability": 0.3, "magnitude_s": 0.2},
    "load": {"kind": "compute_contention", "probability": 0.5, "factor": 4.0},
    "jitter": {"kind": "network_jitter", "probability": 0.5, "magnitude_s": 0.12},
    "reorder": {"kind": "queue_reorder", "probability": 0.3, "magnitude_s": 0.3},
    "drop": {"kind": "chunk_drop", "probability": 0.4},
    "push": {"kind": "push", "force_n": 15.0, "contact_force_n": 30.0},
}


def measured_rows():
    """Two methods: five cold and thirty warm invocations in each of two runs of two processes."""
    rng = np.random.default_rng(3)
    return [
        {
            "method": method, "run": run, "process": process, "component": str(term),
            "owner": "model", "temperature": how, "repeat": repeat, "source": "measured",
            "seconds": float(rng.gamma(4.0, scale) * (3.0 if how == "cold" else 1.0)),
        }
        for method, scale in (("flow", 0.002), ("bc", 0.0005))
        for run in (1, 2) for process in (1, 2)
        for how, count in (("cold", 5), ("warm", 30)) for repeat in range(count)
        for term in MEASURED_TERMS
    ]  # fmt: skip


ROWS = measured_rows()


def times(rows=ROWS):
    return Times(rows, declared=DECLARED, perturbations=PLANNED, root_seed=SEED)


@pytest.fixture(scope="module")
def clock():
    bounds = {name: DeclaredTerm(*ends) for name, ends in DECLARED.items()}
    return latency_models(pd.DataFrame(ROWS), bounds)


@pytest.mark.parametrize("condition", PLANNED)
@pytest.mark.parametrize("method", ["flow", "bc"])
def test_the_clock_and_the_checker_draw_the_same(clock, method, condition):
    own, perturbation = times(), TypeAdapter(Perturbation).validate_python(PLANNED[condition])
    for start in range(3):
        for number in range(6):
            key = {"root_seed": SEED, "start": start, "invocation": number}
            hit = injection(perturbation, name=condition, **key)
            drawn = {"perturbation": condition, "compute_factor": hit.compute_factor, **key}
            terms_s = draw_latency(clock[method], extra_s=hit.extra_s, **drawn).terms
            setup = SimpleNamespace(
                root_seed=SEED, perturbation=condition, schedule=perturbation, latency=clock[method]
            )
            sensor_s, lost = sensor_terms(setup, start=start, number=number + 5)
            total_s = math.inf if lost else sum({**terms_s, **sensor_s}.values())
            place = (method, condition, start, number)
            assert own.begins_with_s(*place, number + 5) == pytest.approx(total_s, abs=1e-12)
            for candidate in (1, 2):
                check_s = draw_check(clock[method], candidate=candidate, **drawn)
                assert own.check_s(*place, candidate) == check_s
            assert own.hit(condition, start, number).lost == hit.dropped


def test_by_hand():
    """One invocation was measured of each kind, so that nothing is left to a draw."""
    rows = [
        {**row, "seconds": 0.002 if row["temperature"] == "warm" else 0.005}
        for row in ROWS
        if (row["method"], row["run"], row["process"], row["repeat"]) == ("flow", 1, 1, 0)
    ]
    fixed = {name: (0.001, 0.001) for name in DECLARED}
    own = Times(rows, declared=fixed, perturbations=PLANNED, root_seed=SEED)
    # Six declared terms, five measured ones; the first call costs 5 * 3 ms more.
    assert own.begins_with_s("flow", "nominal", 0, 1, 4) == pytest.approx(0.016)
    assert own.begins_with_s("flow", "nominal", 0, 0, 4) == pytest.approx(0.031)
    assert own.begins_with_s("flow", "camera", 0, 1, 4) == pytest.approx(0.096)
    assert own.check_s("flow", "nominal", 0, 1, 1) == 0.002
    assert own.hit("nominal", 0, 0) == Hit()


def test_what_was_not_measured_owes_no_number():
    own = times([row for row in ROWS if row["temperature"] == "warm"])
    assert math.isnan(own.begins_with_s("flow", "nominal", 0, 0, 4))
    assert not math.isnan(own.begins_with_s("flow", "nominal", 0, 1, 4))
    for other in (
        own.begins_with_s("act", "nominal", 0, 1, 4),
        own.check_s("act", "load", 0, 1, 1),
    ):
        assert math.isnan(other)


def test_a_declared_row_is_no_measured_one():
    declared = {**ROWS[0], "source": "declared", "temperature": "warm", "seconds": 9.0}
    own, other = times(), times([*ROWS, declared])
    for number in range(40):
        place = ("flow", "nominal", 0, number)
        assert own.begins_with_s(*place, 4) == other.begins_with_s(*place, 4)


def a_journal(path, *, condition="reorder", changed=None, judged=True):
    """Two rollouts of three invocations of two candidates, each with what it owes."""
    own, journals = times(), []
    for start in (0, 4):
        labels = {"method": "flow", "perturbation": condition, "start": str(start)}
        journal = Journal(f"flow/{condition}/{start}", labels)
        journal.add("session", 0, {"labels": labels, "period_ns": 50_000_000})
        for number in range(3):
            name = f"{journal.session}/{number}"
            place = ("flow", condition, start, number)
            sensed_s = sum(own.sensed_s(condition, start, number).values())
            journal.exposure(number, np.zeros(3))
            journal.arrived(number + sensed_s, exposed_s=number)
            for stage, owed_s in (
                ("begin", own.begins_with_s(*place, number)),
                ("check", own.check_s(*place, 1)),
                ("check", own.check_s(*place, 2)),
            ):
                stated_s = (changed or {}).get((start, number, stage), 1.0) * owed_s
                journal.invocation(0.1, invocation_id=name, stage=stage, detail=repr(stated_s))
                if judged:
                    journal.candidate(
                        0.1, chunk_id=name, method="flow", index=0, layers={}, first_reason=None
                    )
            journal.invocation(0.1, invocation_id=name, stage="end", detail="answered")
        journals.append(journal)
    write_journal(path, journals)
    return path


def test_a_journal_that_states_what_is_owed(tmp_path):
    assert list(stated_otherwise(a_journal(tmp_path / "j.mcap"), times())) == []


@pytest.mark.parametrize(
    ("place", "said"),
    [
        ((0, 0, "begin"), "invocation 'flow/reorder/0/0' states"),
        ((4, 2, "begin"), "invocation 'flow/reorder/4/2' states"),
        ((4, 1, "check"), "invocation 'flow/reorder/4/1', candidate 1 states"),
    ],
)
@pytest.mark.parametrize("factor", [0.9, 1.1, math.nan])
def test_a_clock_that_is_faster_or_slower_on_paper(tmp_path, place, said, factor):
    found = list(stated_otherwise(a_journal(tmp_path / "j.mcap", changed={place: factor}), times()))
    assert found[0].startswith(said) and "by the measured times" in found[0]


def test_an_answer_that_was_to_be_lost(tmp_path):
    lost = [
        f"flow/drop/{start}/{number}"
        for start in (0, 4)
        for number in range(3)
        if times().hit("drop", start, number).lost
    ]
    assert 0 < len(lost) < 6
    found = list(stated_otherwise(a_journal(tmp_path / "j.mcap", condition="drop"), times()))
    assert {text.split("'")[1] for text in found} == set(lost)
    quiet = a_journal(tmp_path / "q.mcap", condition="drop", judged=False)
    assert list(stated_otherwise(quiet, times())) == []
