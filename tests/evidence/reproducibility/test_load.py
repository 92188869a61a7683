"""Candidates against time, alone and beside a load: every combination, and a load that ends."""

import os
import time
from pathlib import Path

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
    with load.competing() as burners:
        assert len(burners) == len(os.sched_getaffinity(0))
        before = [_seconds_of(burner) for burner in burners]
        time.sleep(1.0)
        after = [_seconds_of(burner) for burner in burners]
        assert all(late > early for early, late in zip(before, after, strict=True))
    assert [burner.returncode for burner in burners] == [0] * len(burners)


def test_the_load_ends_with_an_error_as_well():
    with pytest.raises(KeyError), load.competing() as burners:
        raise KeyError
    assert all(burner.returncode == 0 for burner in burners)


def test_a_load_that_does_not_begin_is_none(monkeypatch, tmp_path):
    broken = tmp_path / "broken.py"
    broken.write_text("raise SystemExit(3)")
    monkeypatch.setattr(load.burning, "__file__", str(broken))
    with pytest.raises(RuntimeError, match="before it had begun"), load.competing():
        pass


def _seconds_of(process):
    """Of the processor, in the user's mode; field 14 of proc(5)."""
    fields = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()
    return int(fields[11])
