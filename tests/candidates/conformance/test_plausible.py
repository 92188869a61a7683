import numpy as np
import pytest
from scipy.spatial.transform import Rotation as Turn

from genpolicy.candidates.conformance.plausible import (
    DRAWS,
    copied,
    nearest,
    of_episodes,
    shuffled_share,
    slopes,
    turn_slopes,
)
from genpolicy.candidates.conformance.units import orientation, scale
from genpolicy.contract.action import GRIPPER, ROTATION, join_action
from genpolicy.contract.rotation import rotation_from_6d, rotation_to_6d


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
    stands = slope_of("x", still, recorded, rng)
    assert np.isnan(stands.slope)
    assert stands.stands
    assert (stands.low, stands.high) == (-np.inf, np.inf)
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


def transposed(chunks):
    turned = chunks.copy()
    turned[..., ROTATION] = rotation_to_6d(
        np.swapaxes(rotation_from_6d(chunks[..., ROTATION]), -1, -2)
    )
    return turned


@pytest.mark.parametrize("most_rad", [0.5, 0.05])
def test_a_transposed_rotation_turns_the_other_way(recorded, rng, most_rad):
    """Of small turns too, which lie nearer to the right one than recordings do to each other."""
    turn = Turn.from_euler("z", rng.uniform(-most_rad, most_rad, (30, 1))).as_matrix()
    ours = join_action(recorded[..., :3], turn[:, None].repeat(8, 1), 0.0)
    found = turn_slopes(transposed(ours), ours, rng=rng)
    assert [one.name for one in found] == ["turn about z"]
    assert found[0].high == pytest.approx(-1.0)
    assert orientation(transposed(ours), ours, ours[:, 0]).judged == "fails"
    assert orientation(ours, ours, ours[:, 0]).judged == "holds"


def test_what_is_its_own_transpose_is_the_same_rotation(recorded):
    """A hand that points down and turns about the vertical: there is nothing to tell apart."""
    turn = Turn.from_euler("xz", np.stack([np.full(30, np.pi), np.linspace(-0.5, 0.5, 30)], 1))
    down = join_action(recorded[..., :3], turn.as_matrix()[:, None].repeat(8, 1), 0.0)
    np.testing.assert_allclose(transposed(down), down, atol=1e-12)
    assert orientation(transposed(down), down, down[:, 0]).judged == "holds"


def test_turns_smaller_than_a_floor_have_no_slope(recorded, rng):
    turn = Turn.from_euler("z", rng.uniform(-0.01, 0.01, (30, 1))).as_matrix()
    ours = join_action(recorded[..., :3], turn[:, None].repeat(8, 1), 0.0)
    assert turn_slopes(transposed(ours), ours, rng=rng) == []


def test_a_gripper_that_only_trembles_is_not_compared(recorded, rng):
    """Ten micrometres of a sensor are no motion that a candidate must show."""
    recorded[..., GRIPPER] = 0.02 + 1e-5 * rng.normal(size=(30, 1))
    chunks = recorded.copy()
    chunks[..., GRIPPER] = 0.02
    assert [one.name for one in slopes(chunks, recorded, rng=rng)] == ["x", "y", "z"]
    assert scale(chunks, recorded, follows=True).judged == "holds"


@pytest.mark.parametrize("error", [0.0, 1e-5])
def test_a_gripper_that_stands_where_the_recorded_one_moves_is_wrong(recorded, rng, error):
    chunks = recorded.copy()
    chunks[..., GRIPPER] = 0.02 + error * rng.normal(size=(30, 1))
    found = scale(chunks, recorded, follows=True)
    assert (found.judged, found.said.rpartition("wrong: ")[2]) == ("fails", "gripper")


def test_a_gripper_that_moved_at_two_moments_of_thirty_says_nothing(recorded):
    recorded[..., GRIPPER] = 0.0
    recorded[:2, :, GRIPPER] = 0.04
    chunks = recorded.copy()
    chunks[..., GRIPPER] = 0.0
    assert scale(chunks, recorded, follows=True).judged == "holds"


def test_noise_of_a_candidate_is_no_other_unit(recorded):
    """Least squares alone call 1.7 spreads of error a factor of four."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        chunks = recorded.copy()
        spread = recorded[..., :3].mean(axis=1).std(axis=0)
        chunks[..., :3] += 1.7 * spread * rng.normal(size=(30, 1, 3))
        assert scale(chunks, recorded, follows=True).judged != "fails"
        chunks[..., :3] *= 1000.0
        assert scale(chunks, recorded, follows=True).judged != "holds"


def test_noise_of_the_recordings_is_no_other_unit(recorded, rng):
    """A policy that says the mean of what people do moves less than they do."""
    noisy = recorded.copy()
    spread = recorded[..., :3].mean(axis=1).std(axis=0)
    noisy[..., :3] += 1.5 * spread * rng.normal(size=(30, 1, 3))
    assert scale(recorded, noisy, follows=True).judged != "fails"


def test_of_nothing_in_common_nothing_is_known(recorded, rng):
    other = recorded.copy()
    other[..., 0] = recorded[rng.permutation(30), :, 0]
    found = slope_of("x", other, recorded, rng)
    assert (found.low, found.high) == (-np.inf, np.inf)


def test_a_recording_is_known_whichever_candidate_it_is(recorded, rng):
    drawn = recorded[:, None] + 1e-4 * (1.0 + np.abs(rng.normal(size=(30, 3, 1, 1))))
    assert copied(drawn, recorded) == 0
    drawn[4, 2] = recorded[4].astype(np.float32)
    assert copied(drawn, recorded) == 1


def test_many_chunks_of_other_moments_know_nothing_of_this_one(recorded, rng):
    drawn = recorded[rng.integers(30, size=(30, 8))]
    assert shuffled_share(drawn, recorded, rng=rng) > 0.01


def test_the_factor_lies_between_both_slopes(rng):
    """Of many moments noise of two spreads makes one slope a fifth, and the other one right."""
    recorded = np.zeros((2000, 1, 10))
    recorded[..., 0] = rng.normal(size=(2000, 1))
    chunks = recorded.copy()
    chunks[..., 0] += 2.0 * rng.normal(size=(2000, 1))
    [found] = slopes(chunks, recorded, rng=rng)
    assert found.slope == pytest.approx(0.2, abs=0.03)
    assert found.low < 0.2 < 1.0 < found.high


def test_episodes_are_drawn_with_all_their_moments(rng):
    episodes = np.array(["b", "a", "c", "b", "a", "c"])
    rows = of_episodes(episodes, rng)
    assert rows.shape == (DRAWS, 6)
    drawn = rows.reshape(DRAWS, 3, 2)
    assert {tuple(pair) for pair in drawn.reshape(-1, 2).tolist()} == {(0, 3), (1, 4), (2, 5)}
    assert len(np.unique(rows, axis=0)) > 20


def test_moments_each_of_another_episode_are_drawn_as_they_are():
    rows = of_episodes(np.array(["d", "a", "c", "b"]), np.random.default_rng(1))
    expected = np.random.default_rng(1).integers(4, size=(DRAWS, 4))
    np.testing.assert_array_equal(rows, expected)
