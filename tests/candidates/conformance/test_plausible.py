import numpy as np
import pytest
from scipy.spatial.transform import Rotation as Turn

from genpolicy.candidates.conformance.plausible import (
    copied,
    nearest,
    shuffled_share,
    slopes,
    turned_away,
)
from genpolicy.contract.action import join_action


@pytest.fixture
def rng():
    return np.random.default_rng(0)


@pytest.fixture
def recorded(rng):
    """Thirty chunks from here to there, turned about the vertical, with a gripper that moves."""
    begin, end = rng.normal(size=(2, 30, 1, 3))
    shares = np.linspace(0, 1, 8)[None, :, None]
    turn = Turn.from_euler("z", rng.uniform(-0.5, 0.5, (30, 1))).as_matrix()
    opening = rng.uniform(0, 0.04, (30, 1)) * np.ones(8)
    return join_action(begin + shares * (end - begin), turn[:, None].repeat(8, 1), opening)


def slope_of(name, chunks, recorded, rng):
    return next(one for one in slopes(chunks, recorded, rng=rng) if one.name == name)


def test_of_candidates_the_one_nearest_to_what_was_done_is_taken(recorded):
    mirrored = recorded * np.array([1, -1, 1, 1, 1, 1, 1, 1, 1, 1])
    chosen = nearest(np.stack([mirrored, recorded + 0.001, recorded + 0.1], axis=1), recorded)
    np.testing.assert_array_equal(chosen, recorded + 0.001)


@pytest.mark.parametrize("factor", [1.0, 1000.0, 0.1, -1.0])
def test_a_factor_is_seen_as_its_inverse(recorded, rng, factor):
    chunks = recorded.copy()
    chunks[..., 1] *= factor
    found = slope_of("y", chunks, recorded, rng)
    assert found.slope == pytest.approx(1.0 / factor)
    assert found.low == pytest.approx(1.0 / factor)
    assert slope_of("x", chunks, recorded, rng).slope == pytest.approx(1.0)


def test_noise_of_the_recordings_widens_the_interval_around_one(recorded, rng):
    found = slope_of("x", recorded + 0.3 * rng.normal(size=(30, 1, 1)), recorded, rng)
    assert found.low < found.slope < found.high
    assert found.high - found.low > 0.05


def test_a_candidate_that_stands_has_no_slope_and_a_recording_that_stands_none_to_compare(
    recorded, rng
):
    still = recorded[:1].repeat(30, 0)
    assert np.isnan(slope_of("x", still, recorded, rng).slope)
    assert slopes(recorded, still, rng=rng) == []


def test_motions_of_the_moment_are_nearer_than_those_of_others(recorded, rng):
    assert shuffled_share(recorded[:, None] + 0.01, recorded, rng=rng) < 0.001


@pytest.mark.parametrize("what", ["one chunk", "the same displacement", "another moment's"])
def test_what_does_not_depend_on_the_moment_is_as_near_to_others(recorded, rng, what):
    chunks = {
        "one chunk": recorded[:1].repeat(30, 0),
        "the same displacement": recorded[:, :1] + (recorded[:1] - recorded[:1, :1]),
        "another moment's": recorded[rng.permutation(30)],
    }[what]
    assert shuffled_share(chunks[:, None], recorded, rng=rng) > 0.01


def test_the_shuffle_is_exact_for_chunks_that_know_nothing():
    """Of 200 candidates that draw at random, about one in a hundred is below 0.01."""
    rng = np.random.default_rng(5)
    shares = [
        shuffled_share(rng.normal(size=(12, 2, 4, 10)), rng.normal(size=(12, 4, 10)), rng=rng)
        for _ in range(40)
    ]
    assert 0.3 < np.mean(shares) < 0.7
    assert sum(share <= 0.05 for share in shares) <= 7


def test_single_actions_are_compared_as_they_are(recorded, rng):
    one = recorded[:, :1]
    assert shuffled_share(one[:, None] + 0.01, one, rng=rng) < 0.001


def test_a_quaternion_in_the_other_order_is_turned_away(recorded):
    quaternion = Turn.from_euler("z", np.zeros((30, 1))).as_quat()
    wrong = Turn.from_quat(np.roll(quaternion, 1, axis=1)).as_matrix()
    chunks = join_action(recorded[..., :3], wrong[:, None].repeat(8, 1), 0.0)
    assert turned_away(chunks, recorded) == (30, 30)
    assert turned_away(recorded, recorded) == (0, 30)


def test_a_rotation_that_is_none_counts_as_turned_away(recorded):
    chunks = recorded.copy()
    chunks[:3, :, 3:9] = 0.0
    assert turned_away(chunks, recorded) == (3, 30)


def test_a_recording_is_known_whichever_candidate_it_is(recorded, rng):
    drawn = recorded[:, None] + 1e-4 * (1.0 + np.abs(rng.normal(size=(30, 3, 1, 1))))
    assert copied(drawn, recorded) == 0
    drawn[4, 2] = recorded[4].astype(np.float32)
    assert copied(drawn, recorded) == 1


def test_many_chunks_of_other_moments_know_nothing_of_this_one(recorded, rng):
    drawn = recorded[rng.integers(30, size=(30, 8))]
    assert shuffled_share(drawn, recorded, rng=rng) > 0.01
