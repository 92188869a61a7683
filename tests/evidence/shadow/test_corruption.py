"""Every corruption: refused by the check that owns it, admitted by a checker without it."""

from dataclasses import replace

import numpy as np
import pytest

from gates.asked_for import REFUSED_FOR
from genpolicy.contract.action import GRIPPER
from genpolicy.evidence.shadow.case import decide, refusals
from genpolicy.evidence.shadow.corruption import CORRUPTIONS
from genpolicy.evidence.shadow.observations import held_out_observations
from genpolicy.evidence.shadow.shadow import Shadow, admit, case_of
from genpolicy.execution.cell import Cell
from genpolicy.execution.checks import without
from genpolicy.feasibility.admission import Admitted, FeasibilityChecker, Rejected
from genpolicy.feasibility.checks import CHECKS
from genpolicy.seeds import stream

BY_NAME = {item.name: item for item in CORRUPTIONS}
OWNERS = {item.check: item for item in CORRUPTIONS if item.check}


@pytest.fixture(scope="module")
def shadow(task, checker, kit):
    return Shadow(
        task=task, checker=checker, cell=Cell(kit.HORIZONS, kit.EXECUTION), late_rows=1,
        samples=2,
    )  # fmt: skip


@pytest.fixture(scope="module")
def good(shadow, data, kit):
    """Demonstrated chunks that are admitted as they are, with their phase."""
    observations = held_out_observations(
        data, horizons=kit.HORIZONS, count=18, generator=stream(1, "corruption")
    )
    cases = [
        (item.phase, case_of(shadow, item, item.demonstrated, number=number))
        for number, item in enumerate(observations)
    ]
    found = [(phase, case) for phase, case in cases if isinstance(admit(shadow, case), Admitted)]
    assert len(found) >= 0.8 * len(cases)
    assert {phase for phase, _ in found} >= {"approach", "insert", "retreat"}
    return found


def broken(good, corruption, checker):
    cases = [corruption.apply(case, checker) for _, case in good]
    return [case for case in cases if case is not None]


@pytest.fixture(scope="module")
def applied(good, shadow):
    """What each corruption makes of the good chunks; made once."""
    made = {}

    def cases(corruption):
        if corruption.name not in made:
            made[corruption.name] = broken(good, corruption, shadow.checker)
        return made[corruption.name]

    return cases


def test_every_check_has_a_fixture_of_its_own():
    assert len(BY_NAME) == len(CORRUPTIONS)
    owned = [item for item in CORRUPTIONS if item.check]
    assert [(item.layer, item.check) for item in owned] == [(c.layer, c.name) for c in CHECKS]
    assert {name for item in CORRUPTIONS for name in item.behind} <= {c.name for c in CHECKS}
    assert all(item.check not in item.behind for item in CORRUPTIONS)


def test_the_gate_expects_of_each_fixture_what_a_good_chunk_is_refused_for(applied, shadow):
    assert list(REFUSED_FOR) == [item.name for item in CORRUPTIONS]
    for item in CORRUPTIONS:
        if item.check:
            assert REFUSED_FOR[item.name] == item.check
            continue  # that it refuses by its name is asked of its mutant
        found = {decide(shadow.checker, case).reason for case in applied(item)}
        assert found == {REFUSED_FOR[item.name]}


FAST = ("joint_velocity", "joint_acceleration", "joint_jerk", "tcp_speed", "tcp_turn")


def test_golden_the_eight_checks_that_cannot_stand_alone_and_who_refuses_with_them():
    """Decision 55 counted five; `joint_torque` came with the light arm, two with their checks."""
    behind = {item.check: set(item.behind) for item in CORRUPTIONS if item.behind}
    assert len(behind) == 8 and behind == {
        "rotation_degenerate": {"rotation_not_orthonormal"},
        "unreachable": {"workspace", "start_pose", "singular"},
        "branch_jump": {
            *FAST, "joint_torque", "payload_torque", "measured_velocity", "measured_acceleration",
            "swept_collision", "measured_collision",
        },
        "scene_collision": {"swept_collision", "measured_collision", "contact_surface"},
        "self_collision": {"workspace", "swept_collision", "measured_collision"},
        "swept_collision": {*FAST, "measured_velocity", "measured_collision"},
        "joint_torque": {"joint_acceleration", "joint_jerk", "payload_torque"},
        "payload_torque": {"joint_acceleration", "joint_jerk"},
    }  # fmt: skip


def test_what_a_task_is_not_asked_is_said(checker, task):
    """Without contact phases or obstacles six checks have no fixture, and all others have."""
    bare = replace(checker.cell, contact_phases=frozenset())
    silent = {item.check for item in CORRUPTIONS if item.applicable(bare, ())}
    assert silent == {
        "approach_direction", "contact_speed", "contact_surface", "contact_force",
        "scene_collision", "swept_collision",
    }  # fmt: skip
    weightless = replace(checker.cell)
    weightless.__dict__["payload"] = None
    silent = {c.check for c in CORRUPTIONS if c.applicable(weightless, task.obstacles)}
    assert silent == {"payload_torque"}
    assert not [c.name for c in CORRUPTIONS if c.applicable(checker.cell, task.obstacles)]


@pytest.mark.parametrize("name", BY_NAME)
def test_refused_with_all_checks_on(name, applied, shadow):
    corruption = BY_NAME[name]
    cases = applied(corruption)
    assert cases, "the corruption could be applied nowhere"
    for case in cases:
        result = admit(shadow, case)
        assert isinstance(result, Rejected), f"{name} was admitted"
        if corruption.check:
            assert result.reason in (corruption.check, *corruption.behind)
        else:
            assert result.verdict.first_layer == corruption.layer


@pytest.mark.parametrize("check", OWNERS)
def test_refused_by_its_check_alone_and_admitted_without_it(check, applied, shadow):
    corruption, cell = OWNERS[check], shadow.checker.cell
    seeing = FeasibilityChecker(cell, checks=without(CHECKS, *corruption.behind))
    blind = FeasibilityChecker(cell, checks=without(CHECKS, check, *corruption.behind))
    for case in applied(corruption):
        assert decide(seeing, case).reason == check
        assert isinstance(decide(blind, case), Admitted)


@pytest.mark.parametrize("check", [name for name, item in OWNERS.items() if item.behind])
def test_what_stands_behind_a_check_does_refuse_its_fixture(check, applied, shadow):
    """Else the fixture would show its check alone, and should be said to."""
    blind = FeasibilityChecker(shadow.checker.cell, checks=without(CHECKS, check))
    found = frozenset().union(*refusals(blind, applied(OWNERS[check])))
    assert found and found <= set(OWNERS[check].behind)


def test_roughness_alone_is_smoothed_and_is_no_corruption(good, shadow):
    """4 mm from side to side is repaired by projection, so that it cannot stand as a fixture."""
    case = next(case for phase, case in good if phase == "approach")
    actions = np.array(case.proposal.actions)
    actions[1::2, 1] += 0.004
    actions[::2, 1] -= 0.004
    result = admit(shadow, case.with_actions(actions))
    assert isinstance(result, Admitted)
    assert 0.002 < result.projected.position_change_m < 0.02


def test_the_obstacle_stands_where_the_projected_chunk_goes(good, shadow):
    case = next(case for phase, case in good if phase == "approach")
    actions = np.array(case.proposal.actions)
    actions[:, 2] += 0.13  # above the workspace; projection brings it down by up to 5 cm
    bad = BY_NAME["collision"].apply(case.with_actions(actions), shadow.checker)
    assert isinstance(admit(shadow, bad), Rejected)


def test_the_obstacle_cannot_stand_where_nothing_goes(good, checker):
    _, case = good[0]
    nowhere = case.with_actions(np.full_like(case.proposal.actions, np.nan))
    assert BY_NAME["collision"].apply(nowhere, checker) is None


def test_an_obstacle_that_is_too_low_is_lifted_into_the_way(good, shadow):
    """As in a cell whose robot passes over what stands in it."""
    case = next(case for phase, case in good if phase == "approach")
    (name,) = case.obstacles
    at, turn = case.poses[name]
    low = replace(case, poses={**case.poses, name: (at - np.array([0.0, 0.0, 0.15]), turn)})
    bad = BY_NAME["collision"].apply(low, shadow.checker)
    assert bad.context.scene.bodies[name][0][2] > at[2] - 0.15
    assert admit(shadow, bad).verdict.first_layer == "geometric"


def test_what_a_task_calls_its_bodies_is_taken_from_it(good, shadow, checker):
    """Another name for the obstacle, or none at all: the corruption follows, or does not apply."""
    _, case = good[0]
    assert case.obstacles == shadow.task.obstacles
    (name,) = case.obstacles
    renamed = {("pillar" if key == name else key): pose for key, pose in case.poses.items()}
    moved = BY_NAME["collision"].apply(
        replace(case, poses=renamed, obstacles=("pillar",)), shadow.checker
    )
    there, _ = moved.context.scene.bodies["pillar"]
    assert np.linalg.norm(there[:2] - case.poses[name][0][:2]) > 0
    assert name not in moved.context.scene.bodies
    assert BY_NAME["collision"].apply(replace(case, obstacles=()), checker) is None
    assert BY_NAME["collision"].apply(replace(case, obstacles=("absent",)), checker) is None


def test_what_needs_room_is_tried_in_the_free_phases_of_the_task(good, checker, task):
    release = BY_NAME["early_release"]
    applied = {phase for phase, case in good if release.apply(case, checker) is not None}
    assert applied == {"approach"} == task.free_phases
    without_room = [replace(case, free_phases=frozenset()) for _, case in good]
    assert all(release.apply(case, checker) is None for case in without_room)


def test_nothing_is_let_go_by_a_hand_that_holds_nothing(good, checker):
    case = next(case for phase, case in good if phase == "approach")
    empty = np.array(case.context.last_action)
    empty[GRIPPER] = checker.settings.gripper_upper_m
    assert BY_NAME["early_release"].apply(case.with_context(last_action=empty), checker) is None


def test_a_corruption_leaves_the_good_case_alone(good, checker):
    for _, case in good[:1]:
        before = case.proposal.actions.copy()
        for corruption in CORRUPTIONS:
            corruption.apply(case, checker)
        np.testing.assert_array_equal(case.proposal.actions, before)


def test_an_arm_that_is_cut_off_stands_in_the_open(shadow, observations):
    """Else a check that looks at where it stands, and not at the way, would do."""
    model, found = shadow.checker.collision, 0
    for number, item in enumerate(observations[::4]):
        case = case_of(shadow, item, item.demonstrated, number=number)
        broken = BY_NAME["cut_off"].apply(case, shadow.checker)
        context = broken.context
        opening_m = float(context.last_action[-1])
        assert (
            model.in_collision(context.q_meas, context.scene, held=False, opening_m=opening_m)
            is None
        )
        found += 1
    assert found >= 5
