"""The compiled arm against the robot's own numpy, and each row alone against all together."""

import numpy as np
import pytest

from benchmarks.feasibility.plain import plain_cell
from genpolicy.errors import NonFiniteError
from genpolicy.robot.collision import Paths

HOME = np.array([0.0, -0.3, 0.0, -2.2, 0.0, 1.9, 0.785])


@pytest.fixture(scope="module")
def plain(cell):
    return plain_cell(cell)


def drawn(cell, count, seed=0):
    """Half anywhere within the joint ranges, half about a pose above the table."""
    rng, arm = np.random.default_rng(seed), cell.kinematics
    q = rng.uniform(arm.lower_rad, arm.upper_rad, (count, cell.joint_count))
    near = HOME + rng.normal(0, 0.35, q.shape)
    return np.where(np.arange(count)[:, None] % 2, near, q)


def paths(cell, kit, count, seed, *, asked="all", step_rad=0.03):
    """Random walks with fingers that move, an object that is let go, and a scene each."""
    rng = np.random.default_rng(seed)
    start = drawn(cell, count, seed)[:, None]
    steps = rng.normal(0, step_rad, (count, 7, cell.joint_count))
    steps *= rng.choice([0.0, 0.1, 1.0], (count, 1, 1))
    opening = rng.uniform(0, 0.04, (count, 7))
    scenes = tuple(kit.scene(hole_yaw_rad=float(rng.uniform(-0.3, 0.3))) for _ in range(count))
    return Paths(
        q_rad=start + np.cumsum(steps, axis=1),
        opening_m=opening,
        held=np.logical_and.accumulate(opening < 0.035, axis=1),
        scenes=scenes,
        contact_allowed=rng.random(count) < 0.5,
        clearance_m=rng.choice([0.0, 0.001, 0.01], count),
        asked=asked,
    )


def one(these, i):
    """The path of that number alone."""
    return Paths(
        these.q_rad[[i]], these.opening_m[[i]], these.held[[i]], (these.scenes[i],),
        these.contact_allowed[[i]], these.clearance_m[[i]], these.asked,
    )  # fmt: skip


def test_frames_are_those_of_the_robot(cell, plain):
    q = drawn(cell, 300)
    ours, theirs = cell.kinematics.frames(q), plain.kinematics.frames(q)
    assert np.allclose(ours.rotation, theirs.rotation, atol=1e-13, rtol=0)
    assert np.allclose(ours.position_m, theirs.position_m, atol=1e-13, rtol=0)


def test_inverse_kinematics_is_that_of_the_robot(cell, plain):
    q = drawn(cell, 300)
    target = plain.kinematics.forward(q)
    seeds = q + np.random.default_rng(1).normal(0, 0.3, q.shape)
    ours, theirs = (c.kinematics.solve(*target, q_seed_rad=seeds) for c in (cell, plain))
    assert np.array_equal(ours.converged, theirs.converged)
    assert ours.converged.sum() > 100
    good = ours.converged
    assert np.allclose(ours.q_rad[good], theirs.q_rad[good], atol=1e-8, rtol=0)


def test_inverse_kinematics_pushes_off_a_half_turn_as_the_robot_does(cell, plain):
    position, rotation = plain.kinematics.forward(HOME[None])
    target = position, rotation @ np.diag([1.0, -1.0, -1.0])
    seeds = HOME[None]
    ours, theirs = (
        c.kinematics.solve(*target, q_seed_rad=seeds, iterations=1) for c in (cell, plain)
    )
    assert np.allclose(ours.q_rad, theirs.q_rad, atol=1e-12)
    assert not np.allclose(ours.q_rad, HOME, atol=1e-3)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_pose_that_is_none_is_not_solved_and_harms_no_other(cell, bad):
    position, rotation = cell.kinematics.forward(np.stack([HOME, HOME]))
    position[0, 1] = bad
    found = cell.kinematics.solve(position, rotation, q_seed_rad=np.stack([HOME, HOME]))
    assert found.converged.tolist() == [False, True]
    assert np.isnan(found.position_error_m[0]) and np.array_equal(found.q_rad[0], HOME)


@pytest.mark.parametrize("name", ["dynamics", "loaded_dynamics"])
def test_torques_are_those_of_the_robot(cell, plain, name):
    q = drawn(cell, 300)
    rates = np.random.default_rng(2).normal(0, 1, (2, *q.shape))
    ours, theirs = (getattr(c, name).torque(q, *rates) for c in (cell, plain))
    assert np.allclose(ours, theirs, atol=1e-11, rtol=0)


@pytest.mark.parametrize("asked", ["all", "held", "free"])
@pytest.mark.parametrize("question", ["check_samples", "check_swept"])
def test_collisions_are_those_of_the_robot(cell, plain, kit, question, asked):
    these = paths(cell, kit, 60, 3, asked=asked)
    ours, theirs = (getattr(c.collision, question)(these) for c in (cell, plain))
    assert [h and (h.row, h.index, h.first, h.second) for h in ours.hits] == [
        h and (h.row, h.index, h.first, h.second) for h in theirs.hits
    ]
    hits = sum(h is not None for h in ours.hits)
    assert hits < 60 and (hits or asked == "held")
    free = [h is None for h in ours.hits]
    assert np.allclose(ours.clearance_m[free], theirs.clearance_m[free], atol=1e-12, rtol=0)
    assert np.isfinite(ours.clearance_m).any()


def test_bounds_of_a_piece_are_those_of_the_robot(cell, plain, kit):
    """Also of fingers that slide while the hand turns, which bend off the straight line."""
    these = paths(cell, kit, 40, 7, step_rad=0.3)
    pieces = cell.collision._first_pieces(these)
    assert np.ptp(pieces.opening, axis=1).min() < 1e-3 < np.ptp(pieces.opening, axis=1).max()
    poses = cell.collision.poses(these.scenes)
    ours, theirs = (c.collision._evaluate(pieces, poses) for c in (cell, plain))
    assert np.allclose(ours.bound_m, theirs.bound_m, atol=1e-12, rtol=0)
    assert np.allclose(ours.travel_m, theirs.travel_m, atol=1e-12, rtol=0)


def test_a_row_has_the_same_bits_in_any_company(cell, kit):
    q = drawn(cell, 33)
    rates = np.random.default_rng(4).normal(0, 1, (2, *q.shape))
    target = cell.kinematics.forward(q)
    together = cell.kinematics.solve(*target, q_seed_rad=q + 0.05)
    torque = cell.dynamics.torque(q, *rates)
    walks = paths(cell, kit, 33, 5)
    for question in ("check_samples", "check_swept"):
        report = getattr(cell.collision, question)(walks)
        for i in range(0, 33, 4):
            alone = getattr(cell.collision, question)(one(walks, i))
            assert alone.clearance_m[0] == report.clearance_m[i]
            hit, single = report.hits[i], alone.hits[0]
            assert (hit is None) == (single is None)
            assert hit is None or (hit.depth_m, hit.first) == (single.depth_m, single.first)
    for i in range(33):
        alone = cell.kinematics.solve(
            target[0][[i]], target[1][[i]], q_seed_rad=q[[i]] + 0.05
        )  # fmt: skip
        assert alone.q_rad.tobytes() == together.q_rad[[i]].tobytes()
        single = cell.dynamics.torque(q[[i]], rates[0, [i]], rates[1, [i]])
        assert single.tobytes() == torque[[i]].tobytes()


@pytest.mark.parametrize("question", ["check_samples", "check_swept"])
def test_what_is_not_finite_is_never_called_free(cell, kit, question):
    these = paths(cell, kit, 3, 6)
    these.q_rad[1, 2, 0] = np.nan
    with pytest.raises(NonFiniteError):
        getattr(cell.collision, question)(these)
