"""Candidates against time, alone and beside a load: every combination, and a load that ends."""

import multiprocessing

import pytest

from genpolicy.candidates.judged import trained
from genpolicy.evidence.reproducibility import load
from genpolicy.evidence.reproducibility.latency import LatencyPlan


@pytest.fixture
def few(monkeypatch):
    monkeypatch.setattr(load, "COUNTS", (1, 3))
    monkeypatch.setattr(load, "REPEATS", 2)
    monkeypatch.setattr(load, "in_fresh_process", lambda work, *a, **k: work(*a, **k))


def test_each_count_is_timed_alone_and_beside_a_load(few, fleet, dataset, kit):
    plan = LatencyPlan(
        dataset=dataset, task="tabletop_insertion", feasibility=kit.FEASIBILITY,
        horizons=kit.HORIZONS, samples=4, warm=2, cold=2,
    )  # fmt: skip
    rows = load.candidates_rows(plan, trained(fleet[0], ["bc", "flow"], seeds=[0], device="cpu"))
    assert [(row.method, row.candidates, row.load, row.repeat) for row in rows] == [
        ("flow", count, beside, repeat)
        for beside in (load.QUIET, load.BUSY) for count in (1, 3) for repeat in (0, 1)
    ]  # fmt: skip
    assert all(row.seconds > 0 for row in rows)


def test_the_load_runs_inside_the_block_and_ends_with_it():
    with load.competing() as count:
        burning = multiprocessing.active_children()
        assert len(burning) == count > 0 and all(burner.is_alive() for burner in burning)
    assert multiprocessing.active_children() == []


def test_the_load_ends_with_an_error_as_well():
    with pytest.raises(KeyError), load.competing():
        raise KeyError
    assert multiprocessing.active_children() == []
