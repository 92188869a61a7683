import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation as Turn

from genpolicy.candidates.wire.entry import Gripper, Input, Orientation, Output
from genpolicy.candidates.wire.mapping import Inputs, Outputs, opening, turns
from genpolicy.contract.action import GRIPPER, POSITION, join_action, split_action
from genpolicy.contract.observation import Channel, ObservationContract
from genpolicy.errors import ContractError
from genpolicy.tasks.api import load_task

CONTRACT = ObservationContract((
    Channel("place_m", ("x", "y", "z"), "m", "robot", 0.1),
    Channel("turn", tuple("abcdef"), "1", "robot", 0.1),
    Channel("hole", ("x_m", "yaw"), "1", "camera", 0.1),
))  # fmt: skip
ANCHOR = {"position": ["place_m"], "rotation": ["turn"]}
WIDTH = {
    "rotation_6d": 6, "matrix": 9, "quaternion_xyzw": 4, "quaternion_wxyz": 4,
    "rotation_vector_rad": 3, "euler_xyz_rad": 3, "euler_xyz_deg": 3,
}  # fmt: skip
WRITE = {
    "rotation_6d": lambda turn: np.concatenate([turn.as_matrix()[:, 0], turn.as_matrix()[:, 1]]),
    "matrix": lambda turn: turn.as_matrix().ravel(),
    "quaternion_xyzw": lambda turn: turn.as_quat(),
    "quaternion_wxyz": lambda turn: np.roll(turn.as_quat(), 1),
    "rotation_vector_rad": lambda turn: turn.as_rotvec(),
    "euler_xyz_rad": lambda turn: turn.as_euler("xyz"),
    "euler_xyz_deg": lambda turn: turn.as_euler("xyz", degrees=True),
}


def output(*, form="rotation_6d", unit="m", motion="absolute", frame="robot_base", **changes):
    last = 3 + WIDTH[form]
    return Output.model_validate({
        "frame": frame, "motion": motion,
        "position": {"columns": [0, 1, 2], "unit": unit},
        "rotation": {"columns": list(range(3, last)), "form": form},
        "gripper": {"column": last, "open": 1.0, "open_m": 0.04},
        "anchor": None if motion == "absolute" else ANCHOR,
        **changes,
    })  # fmt: skip


def seen(position, turn):
    return np.concatenate([position, WRITE["rotation_6d"](turn), [0.5, 0.1]])


def random_turns(count, seed=0):
    return Turn.random(count, rng=np.random.default_rng(seed))


@pytest.mark.parametrize("form", WIDTH)
def test_every_form_says_the_same_rotation(form):
    written = random_turns(20)
    numbers = np.stack([WRITE[form](turn) for turn in written])
    found = turns(Orientation(columns=list(range(WIDTH[form])), form=form), numbers)
    np.testing.assert_allclose(found, written.as_matrix(), atol=1e-12)


@pytest.mark.parametrize("form", WIDTH)
def test_numbers_that_are_no_rotation_are_none_and_spoil_no_other_row(form):
    good = WRITE[form](random_turns(1)[0])
    bad = np.full(WIDTH[form], np.nan)
    found = turns(Orientation(columns=list(range(WIDTH[form])), form=form), np.stack([good, bad]))
    assert np.isfinite(found[0]).all()
    assert np.isnan(found[1]).all()


@pytest.mark.parametrize(
    ("form", "numbers"),
    [
        ("quaternion_xyzw", np.zeros(4)),
        ("rotation_6d", np.zeros(6)),
        ("matrix", np.diag([1.0, 1.0, -1.0]).ravel()),  # a mirror
        ("matrix", 2.0 * np.eye(3).ravel()),
    ],
)
def test_a_row_that_describes_no_rotation_is_nan(form, numbers):
    found = turns(Orientation(columns=list(range(len(numbers))), form=form), numbers[None])
    assert np.isnan(found).all()


@given(st.floats(-1, 1), st.floats(-10, 10), st.floats(0.01, 0.1))
def test_gripper_numbers_are_shares_of_the_way_from_closed_to_open(share, closed, open_m):
    gripper = Gripper(column=0, closed=closed, open=closed + 2.0, open_m=open_m)
    chunk = np.array([[[closed + 2.0 * share]]])
    np.testing.assert_allclose(opening(gripper, chunk), share * open_m, atol=1e-12)


@pytest.mark.parametrize(("unit", "factor"), [("m", 1.0), ("cm", 100.0), ("mm", 1000.0)])
def test_absolute_places_in_their_unit(unit, factor):
    turn = random_turns(1)[0]
    chunk = np.concatenate(
        [[0.1 * factor, 0.2 * factor, 0.3 * factor], WRITE["rotation_6d"](turn), [1.0]]
    )
    found = Outputs(output(unit=unit), CONTRACT).mapped(chunk[None, None], seen(np.zeros(3), turn))
    position, rotation, gripper = split_action(found)
    np.testing.assert_allclose(position[0, 0], [0.1, 0.2, 0.3])
    np.testing.assert_allclose(rotation[0, 0], turn.as_matrix(), atol=1e-12)
    assert gripper[0, 0] == pytest.approx(0.04)


@pytest.mark.parametrize("frame", ["robot_base", "tcp"])
@pytest.mark.parametrize("motion", ["relative", "increments"])
@pytest.mark.parametrize("unit", ["m", "mm"])
def test_relative_motions_are_the_absolute_ones_they_were_made_of(frame, motion, unit):
    """A path is written relative to its anchor, by the definition of the motion, and read back."""
    rng = np.random.default_rng(1)
    path, rotations = rng.normal(size=(2, 5, 3)), random_turns(10, 2)
    at, towards = rng.normal(size=3), random_turns(1, 3)[0]
    chunks = np.empty((2, 5, 10))
    for candidate in range(2):
        before, faced = at, towards
        for row in range(5):
            target = rotations[5 * candidate + row]
            step = path[candidate, row] - before
            if frame == "tcp":
                step, turn = faced.inv().apply(step), faced.inv() * target
            else:
                turn = target * faced.inv()
            scale = 1000.0 if unit == "mm" else 1.0
            chunks[candidate, row] = [*(step * scale), *WRITE["rotation_6d"](turn), 0.5]
            if motion == "increments":
                before, faced = path[candidate, row], target
    declared = output(motion=motion, frame=frame, unit=unit)
    found = Outputs(declared, CONTRACT).mapped(chunks, seen(at, towards))
    expected = join_action(path, rotations.as_matrix().reshape(2, 5, 3, 3), 0.02)
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_without_a_rotation_the_anchor_keeps_its_own():
    declared = output(
        motion="relative", rotation=None, gripper={"column": 3, "open": 1.0, "open_m": 0.04}
    )
    towards = random_turns(1, 4)[0]
    found = Outputs(declared, CONTRACT).mapped(np.zeros((1, 2, 4)), seen(np.ones(3), towards))
    _, rotation, _ = split_action(found)
    np.testing.assert_allclose(rotation, np.broadcast_to(towards.as_matrix(), (1, 2, 3, 3)))
    np.testing.assert_array_equal(found[..., POSITION], 1.0)


def test_a_number_that_is_none_stays_in_its_row():
    chunk = np.tile(
        np.concatenate([np.zeros(3), WRITE["rotation_6d"](Turn.identity()), [0.0]]), (1, 2, 1)
    )
    chunk[0, 1, 0] = np.nan
    found = Outputs(output(), CONTRACT).mapped(chunk, seen(np.zeros(3), Turn.identity()))
    assert np.isfinite(found[0, 0]).all()
    assert np.isnan(found[0, 1, 0])
    assert found[0, 1, GRIPPER] == 0.0


def test_six_numbers_that_are_no_rotation_yet_are_left_for_feasibility_to_judge():
    chunk = np.array([[[0.0, 0.0, 0.0, 1.1, 0.0, 0.2, 0.0, 0.9, 0.0, 0.0]]])
    found = Outputs(output(), CONTRACT).mapped(chunk, seen(np.zeros(3), Turn.identity()))
    np.testing.assert_array_equal(found, chunk)


@pytest.mark.parametrize("form", ["rotation_6d", "quaternion_xyzw"])
def test_mapped_actions_lie_row_by_row_in_memory(form):
    chunks = np.zeros((3, 4, 10 if form == "rotation_6d" else 8))
    chunks[..., 3] = 1.0
    found = Outputs(output(form=form), CONTRACT).mapped(chunks, seen(np.zeros(3), Turn.identity()))
    assert found.flags.c_contiguous


def inputs(**part):
    return Inputs({"state": Input.model_validate(part)}, CONTRACT, observation_horizon=2)


def test_inputs_are_named_channels_in_the_order_and_type_that_is_asked_for():
    observations = np.arange(22.0).reshape(2, 11)
    given = inputs(channels=["hole", "place_m.y"]).of(observations)["state"]
    assert given.dtype == np.float32
    assert given.tolist() == [20.0, 21.0, 12.0]
    both = inputs(channels=["place_m"], history=2, dtype="float64").of(observations)["state"]
    assert both.tolist() == [[0.0, 1.0, 2.0], [11.0, 12.0, 13.0]]


def test_only_lengths_are_given_in_another_unit():
    observations = np.ones((2, 11))
    given = inputs(channels=["place_m", "turn.a", "hole"], unit="mm").of(observations)["state"]
    assert given.tolist() == [1000.0, 1000.0, 1000.0, 1.0, 1000.0, 1.0]


def test_more_history_than_conditions_the_policy_is_refused():
    with pytest.raises(ContractError, match="at most H_o = 2"):
        inputs(channels=["place_m"], history=3)


@pytest.mark.parametrize("form", WIDTH)
@pytest.mark.parametrize(("motion", "frame"), [
    ("absolute", "robot_base"), ("relative", "robot_base"), ("relative", "tcp"),
    ("increments", "robot_base"), ("increments", "tcp"),
])  # fmt: skip
@pytest.mark.parametrize("unit", ["m", "mm"])
def test_what_is_written_in_a_form_is_read_back_as_it_was(form, motion, frame, unit):
    rng = np.random.default_rng(5)
    path, rotations = rng.normal(size=(6, 3)), random_turns(6, 4).as_matrix()
    actions = join_action(path, rotations, rng.uniform(0.0, 0.04, 6))
    declared = output(
        form=form, motion=motion, frame=frame, unit=unit,
        gripper={"column": 3 + WIDTH[form], "closed": -1.0, "open": 2.0, "open_m": 0.04},
    )  # fmt: skip
    mapping = Outputs(declared, CONTRACT)
    at = seen(rng.normal(size=3), random_turns(1, 6)[0])
    written = mapping.written(actions, at)
    assert written.shape == (6, declared.width)
    np.testing.assert_allclose(mapping.mapped(written[None], at)[0], actions, atol=1e-9)


def test_our_own_form_is_written_to_the_bit():
    """Six numbers as they are: not even made orthonormal again."""
    rng = np.random.default_rng(6)
    actions = rng.normal(size=(4, 10))
    declared = output(gripper={"column": 9, "open": 1.0, "open_m": 1.0})
    written = Outputs(declared, CONTRACT).written(actions, seen(np.zeros(3), Turn.identity()))
    assert written.tobytes() == actions.tobytes()


def test_given_actions_cannot_be_said_as_joints_or_without_a_rotation():
    joints = Output.model_validate({
        "motion": "absolute", "joints": {"columns": list(range(7)), "unit": "rad"},
        "gripper": {"column": 7, "open": 1.0, "open_m": 0.04},
    })  # fmt: skip
    scene = load_task("tabletop_insertion").scene_path
    unturned = output(motion="relative", rotation=None)
    at = seen(np.zeros(3), Turn.identity())
    for declared, told in ((joints, "joints"), (unturned, "no rotation")):
        with pytest.raises(ContractError, match=told):
            Outputs(declared, CONTRACT, scene=scene).written(np.zeros((2, 10)), at)


def test_an_anchor_that_is_no_pose_is_refused():
    with pytest.raises(ContractError, match=r"action\.anchor\.rotation"):
        Outputs(
            output(motion="relative", anchor={"position": ["place_m"], "rotation": ["place_m"]}),
            CONTRACT,
        )


@pytest.mark.parametrize(
    ("anchor", "told"),
    [
        ({"position": ["wrench_n"]}, r"position of .* wrench_n\.x in N, expected 3 numbers in m"),
        ({"position": ["phase.insert", "hole_pose.x_m", "hole_pose.y_m"]}, r"phase\.insert in 1"),
        ({"position": ["hole_pose.x_m", "hole_pose.y_m", "hole_pose.cos_yaw"]}, r"cos_yaw in 1"),
        ({"rotation": ["wrench_n", "tcp_position_m"]}, r"rotation of .* in N, expected 6 numbers"),
        ({"rotation": ["hole_pose", "tcp_rotation.column_0_x", "tcp_rotation.column_0_y"]}, "in m"),
    ],
)  # fmt: skip
def test_an_anchor_of_another_unit_is_refused(task, anchor, told):
    """Wrong before: displacements were added to three forces, and whatever came was judged."""
    whole = {"position": ["tcp_position_m"], "rotation": ["tcp_rotation"]}
    Outputs(output(motion="relative", anchor=whole), task.observation)
    with pytest.raises(ContractError, match=told):
        Outputs(output(motion="relative", anchor={**whole, **anchor}), task.observation)


@pytest.mark.parametrize("form", ["rotation_6d", "quaternion_xyzw", "matrix"])
@pytest.mark.parametrize("huge", [1e7, 1e200, -1e300])
def test_a_row_with_a_number_that_would_overflow_is_none_at_all(form, huge):
    turn = random_turns(1)[0]
    row = np.concatenate([[0.4, 0.0, 0.2], WRITE[form](turn), [0.5]])
    chunks = np.tile(row, (1, 3, 1))
    chunks[0, 1, 3] = huge
    mapped = Outputs(output(form=form), CONTRACT).mapped(chunks, seen(np.zeros(3), turn))
    assert np.isnan(mapped[0, 1]).any() and np.isfinite(mapped[0, [0, 2]]).all()


def test_a_motion_that_leaves_the_earth_is_none_though_its_numbers_are():
    turn = Turn.identity()
    chunks = np.tile(np.concatenate([[9e5, 0, 0], WRITE["rotation_6d"](turn), [0.5]]), (1, 2, 1))
    found = Outputs(output(motion="increments"), CONTRACT).mapped(chunks, seen(np.zeros(3), turn))
    assert np.isfinite(found[0, 0]).all() and np.isnan(found[0, 1, 0])
