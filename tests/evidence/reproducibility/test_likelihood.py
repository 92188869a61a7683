"""The chunk behind a mode comes back from the dataset; few situations, by a draw of their own."""

import numpy as np
import pytest

from genpolicy.contract.action import POSITION
from genpolicy.evidence.need.held_out import HeldOut
from genpolicy.evidence.need.method_modes import ModeSituation
from genpolicy.evidence.reproducibility.likelihood import (
    SITUATIONS,
    density_rows,
    drawn_situations,
    modal_chunk,
)
from genpolicy.policies.policy import load_policy

SHIFT_M = np.array([0.02, -0.01, 0.0])


@pytest.fixture
def demonstrated(data):
    """Chunks at every row of the training split."""
    return data.windows("train", observation_horizon=1, prediction_horizon=16).actions


def held_out_of(count):
    path = np.zeros((2, 16, 3))
    situations = tuple(ModeSituation("test", "approach", f"e{i}", i, path[0], path)
                       for i in range(count))  # fmt: skip
    return HeldOut(situations, np.arange(count, dtype=float)[:, None, None])


@pytest.mark.parametrize("length", [16, 10])
def test_a_mode_that_was_moved_finds_its_demonstration(demonstrated, length):
    """With all its numbers, whether or not the audit's chunk is as long."""
    source = demonstrated[40]
    found = modal_chunk(source[:length, POSITION] + SHIFT_M, demonstrated)
    np.testing.assert_allclose(found.actions[:, POSITION], source[:, POSITION] + SHIFT_M)
    np.testing.assert_array_equal(found.actions[:, 3:], source[:, 3:])
    assert found.shape_distance_m < 1e-12
    assert found.moved_m == pytest.approx(np.linalg.norm(SHIFT_M))


def test_of_equal_paths_it_takes_the_one_that_is_moved_least(demonstrated):
    near, far = demonstrated[40].copy(), demonstrated[40].copy()
    far[:, POSITION] += 10 * SHIFT_M
    for chunks in ([far, near], [near, far]):
        found = modal_chunk(near[:, POSITION] + SHIFT_M, np.stack(chunks))
        assert found.moved_m == pytest.approx(np.linalg.norm(SHIFT_M))


def test_a_path_that_nobody_went_says_how_far_it_is(demonstrated):
    bent = demonstrated[40][:, POSITION].copy()
    bent[:, 2] += 0.1 * (-1.0) ** np.arange(16)
    assert modal_chunk(bent, demonstrated).shape_distance_m > 0.05


def test_looking_for_a_mode_leaves_the_demonstrations_alone(demonstrated):
    before = demonstrated.copy()
    modal_chunk(before[3][:, POSITION] + SHIFT_M, demonstrated)
    np.testing.assert_array_equal(before, demonstrated)


def test_few_situations_are_asked_all_and_many_by_a_draw():
    few, many = held_out_of(SITUATIONS), held_out_of(100)
    assert drawn_situations(few) is few
    drawn, again = drawn_situations(many), drawn_situations(many)
    places = [s.index for s in drawn.situations]
    assert len(places) == len(set(places)) == SITUATIONS and places == sorted(places)
    assert places == drawn.observations.ravel().tolist() == [s.index for s in again.situations]


def test_a_method_that_states_no_density_has_no_rows(fleet, data):
    policy = load_policy(next(iter(sorted((fleet[0] / "chunked_bc").glob("seed_0")))))
    assert density_rows(policy, held_out_of(2), data, seed=0, samples=2) == []
