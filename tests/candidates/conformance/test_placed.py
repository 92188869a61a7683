import numpy as np
import pytest
from scipy.spatial.transform import Rotation as Turn

from genpolicy.candidates.conformance.placed import offsets, turned_away
from genpolicy.candidates.conformance.units import origin
from genpolicy.contract.action import GRIPPER, ROTATION, join_action
from genpolicy.contract.rotation import rotation_from_6d

STEP_M = 0.01


@pytest.fixture
def rng():
    return np.random.default_rng(0)


@pytest.fixture
def measured(rng):
    """Forty poses of hands that are turned anyhow."""
    turns = Turn.random(40, random_state=0).as_matrix()
    return join_action(rng.normal(size=(40, 3)), turns, rng.uniform(0, 0.04, 40))


@pytest.fixture
def recorded(measured, rng):
    """From there in steps of up to a centimetre, one way or the other."""
    return away(measured, rng.uniform(-STEP_M, STEP_M, (40, 1, 3)))


def away(measured, steps):
    chunks = measured[:, None].repeat(8, 1)
    chunks[..., :3] += steps * np.arange(1, 9)[None, :, None]
    return chunks


def judged(drawn, recorded, measured):
    return origin(offsets(drawn, recorded, measured), comparable=True)


def draws(chunks, rng, error_m=0.002):
    drawn = chunks[:, None].repeat(5, 1)
    drawn[..., :3] += error_m * rng.normal(size=(len(chunks), 5, 1, 3))
    return drawn


def test_who_begins_where_the_robot_is_holds(recorded, measured, rng):
    assert judged(draws(recorded, rng), recorded, measured).judged == "holds"


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("off_m", [0.05, -0.03])
def test_another_origin_is_told(recorded, measured, rng, axis, off_m):
    drawn = draws(recorded, rng)
    drawn[..., axis] += off_m
    found = judged(drawn, recorded, measured)
    assert found.judged == "fails"
    assert f": {'xyz'[axis]} {1e3 * off_m:.1g}"[:4] in found.said


def test_another_point_of_the_tool_is_told_however_the_hand_is_turned(recorded, measured, rng):
    drawn = draws(recorded, rng)
    turned = rotation_from_6d(measured[:, ROTATION])
    drawn[..., :3] += 0.03 * turned[:, None, None, :, 2]
    found = judged(drawn, recorded, measured)
    assert found.judged == "fails"
    assert found.said.count("mm (a step") == 1
    assert ": z of the tool" in found.said


def test_an_offset_of_less_than_a_step_may_be_a_bias(recorded, measured, rng):
    drawn = draws(recorded, rng)
    drawn[..., 1] += 0.005
    found = judged(drawn, recorded, measured)
    assert found.judged == "unknown"
    assert "too little to tell" in found.said


@pytest.mark.parametrize("factor", [-1.0, 0.0, 2.0])
def test_the_other_way_a_slower_and_a_faster_one_have_no_offset(recorded, measured, rng, factor):
    other = recorded.copy()
    other[..., :3] = measured[:, None, :3] + factor * (recorded - measured[:, None])[..., :3]
    assert judged(draws(other, rng), recorded, measured).judged == "holds"


def test_who_always_goes_left_where_people_go_right_has_no_offset(measured, rng):
    """One mode of two, everywhere: it steps no farther than those of the other mode."""
    steps = rng.uniform(-STEP_M, STEP_M, (40, 1, 3))
    steps[..., 1] = STEP_M * rng.uniform(0.5, 1.0, (40, 1))
    left = steps * np.array([1.0, -1.0, 1.0])
    found = judged(draws(away(measured, left), rng), away(measured, steps), measured)
    assert found.judged == "unknown"
    assert "y" in found.said


def test_who_is_twice_as_fast_in_the_only_direction_there_is_has_no_offset(measured, rng):
    """Everybody moves along x alike: a faster policy is ahead at every moment."""
    steps = np.zeros((40, 1, 3))
    steps[..., 0] = rng.normal(0.008, 0.0002, (40, 1))
    found = judged(draws(away(measured, 2.0 * steps), rng), away(measured, steps), measured)
    assert found.judged == "unknown"


def test_noise_of_draws_is_no_offset(recorded, measured, rng):
    assert judged(draws(recorded, rng, error_m=0.05), recorded, measured).judged != "fails"


def test_a_gripper_that_is_commanded_beyond_what_stops_it_is_not_known(recorded, measured, rng):
    drawn = draws(recorded, rng)
    drawn[..., GRIPPER] -= 0.01
    found = judged(drawn, recorded, measured)
    assert found.judged == "unknown"
    assert "gripper" in found.said


def test_where_the_robot_is_not_observed_nothing_is_said(recorded, measured, rng):
    nowhere = np.full_like(measured, np.nan)
    assert offsets(draws(recorded, rng), recorded, nowhere) == []
    assert judged(draws(recorded, rng), recorded, nowhere).judged == "unknown"


def test_numbers_that_are_no_places_have_no_origin(recorded, measured, rng):
    drawn = draws(recorded, rng)
    drawn[..., 0] += 1.0
    found = offsets(drawn, recorded, measured)
    assert origin(found, comparable=False).judged == "unknown"
    assert origin(found, comparable=True).judged == "fails"


def test_an_honest_candidate_is_hardly_ever_called_off():
    """At most one in a hundred by chance; of two hundred none, since a step is far."""
    for seed in range(200):
        rng = np.random.default_rng(seed)
        measured = join_action(
            rng.normal(size=(20, 3)), Turn.random(20, random_state=seed).as_matrix(), 0.0
        )
        recorded, other = (
            away(measured, rng.uniform(-STEP_M, STEP_M, (20, 1, 3))) for _ in range(2)
        )
        assert judged(other[:, None], recorded, measured).judged != "fails"


def test_a_quaternion_in_the_other_order_is_turned_away(recorded, measured):
    quaternion = Turn.from_matrix(rotation_from_6d(measured[:, ROTATION])).as_quat()
    wrong = Turn.from_quat(np.roll(quaternion, 1, axis=1)).as_matrix()
    chunks = join_action(recorded[..., :3], wrong[:, None].repeat(8, 1), 0.0)
    assert turned_away(chunks, recorded, measured)[0] >= 38
    assert turned_away(recorded, recorded, measured) == (0, 40, 0.05)


def test_a_hand_that_is_not_observed_is_turned_as_the_recorded_action(recorded, measured):
    nowhere = np.full_like(measured, np.nan)
    chunks = recorded.copy()
    chunks[:7, :, ROTATION] = recorded[7:14, :, ROTATION]
    assert turned_away(chunks, recorded, nowhere) == (7, 40, 0.05)


def test_recordings_that_turn_fast_allow_as_much(recorded, measured):
    turned = recorded.copy()
    turn = Turn.from_rotvec([0.0, 0.0, 0.2]).as_matrix()
    hand = rotation_from_6d(measured[:, ROTATION])
    turned = join_action(recorded[..., :3], (hand @ turn)[:, None].repeat(8, 1), 0.0)
    assert turned_away(recorded, turned, measured) == (0, 40, pytest.approx(0.4))


def test_a_rotation_that_is_none_counts_as_turned_away(recorded, measured):
    chunks = recorded.copy()
    chunks[:3, :, ROTATION] = 0.0
    assert turned_away(chunks, recorded, measured)[:2] == (3, 40)
