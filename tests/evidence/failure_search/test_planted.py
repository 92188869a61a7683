"""A region in which a candidate fails, planted where the fixed grid does not look, is found."""

import numpy as np
import pytest

from genpolicy.evidence.failure_search.conditions import Condition
from genpolicy.evidence.failure_search.rollouts import generator_of, search_with
from genpolicy.evidence.failure_search.worth import worth
from genpolicy.evidence.stress.matched import matched_starts
from genpolicy.evidence.stress.perturbations import CameraDelay
from genpolicy.tasks.api import load_task
from genpolicy.tasks.tabletop_insertion.start import RANGES

JUDGED_S, ROOT_SEED = 0.08, 7
DELAY = Condition("camera_delay", CameraDelay(magnitude_s=JUDGED_S), "magnitude_s", JUDGED_S)
CORNER = {"hole_x_m": 0.9, "hole_yaw_rad": -0.9, "post_y_m": 0.9}
"""Where it fails: three numbers of the start near an end of their ranges, of -1 to 1."""
NEAR, LEAST_S = 0.3, 0.03


def away(start):
    """How far a start is from the planted corner, in half ranges."""
    at = {name: (getattr(start, name) - RANGES[name][0]) / RANGES[name][1] for name in CORNER}
    return float(np.linalg.norm([at[name] - CORNER[name] for name in CORNER]))


def fake(start, severity_s):
    """A rollout that costs nothing: slower towards the corner, and a failure in it."""
    failed = away(start) < NEAR and severity_s > LEAST_S
    return {"success": not failed, "duration_s": 12.0 - 2.0 * min(away(start), 3.0),
            "force_peak_n": 0.0}  # fmt: skip


@pytest.fixture(scope="module")
def insertion():
    return load_task("tabletop_insertion")


def found_by_search(task, *, evaluations=240, root_seed=ROOT_SEED, method="flow"):
    rows = []

    def evaluate(asked):
        ended = [fake(task.start_from_json(one.start), one.severity) for one in asked]
        rows.extend(zip(asked, ended, strict=True))
        return [
            worth(row, share=DELAY.share(one.severity), episode_limit_s=12.0, force_limit_n=40.0)
            for one, row in zip(asked, ended, strict=True)
        ]

    search_with(task, DELAY, evaluate, method=method, evaluations=evaluations, root_seed=root_seed)
    return rows


def test_the_search_finds_what_the_grid_misses_and_goes_down_to_the_boundary(insertion):
    grid = [fake(start, JUDGED_S) for start in matched_starts(insertion, root_seed=7, count=90)]
    assert all(row["success"] for row in grid), "no planned start lies in the region"
    rows = found_by_search(insertion)
    failed = [one.severity for one, row in rows if not row["success"]]
    assert len(rows) == 240 and len(failed) >= 10
    assert LEAST_S < min(failed) < 1.3 * LEAST_S


def test_searching_is_a_function_of_seed_method_and_condition(insertion):
    first = [one for one, _ in found_by_search(insertion, evaluations=30)]
    assert [one for one, _ in found_by_search(insertion, evaluations=30)] == first
    assert [one.number for one in first] == list(range(30))
    for other in ({"root_seed": 8}, {"method": "diffusion"}):
        rows = found_by_search(insertion, evaluations=30, **other)
        assert {one.start for one, _ in rows}.isdisjoint({one.start for one in first})


def test_no_start_that_judges_is_asked_for(insertion):
    asked = {one.start for one, _ in found_by_search(insertion)}
    judging = {start.to_json() for start in matched_starts(insertion, root_seed=7, count=400)}
    assert asked.isdisjoint(judging)
    drawn = generator_of(7, "flow", DELAY.name).random(8)
    assert drawn.tolist() != generator_of(7, "flow", "camera_delay").random(8).tolist()
