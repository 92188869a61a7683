"""What layers let through is found again in the journal, by MuJoCo, whatever the layers claim."""

import math
from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest

from genpolicy.evidence.shadow.corruption import CORRUPTIONS
from genpolicy.evidence.shadow.layer_mutants import RULES
from genpolicy.evidence.shadow.observations import spread
from genpolicy.evidence.shadow.session import play
from genpolicy.evidence.shadow.shadow import admit, case_of
from genpolicy.execution.checks import without
from genpolicy.execution.journal import encode_actions
from genpolicy.feasibility.admission import Admitted, FeasibilityChecker
from genpolicy.feasibility.checks import CHECKS
from genpolicy.feasibility.figures import expected_motion
from genpolicy.verification.checker import check_messages
from genpolicy.verification.motion import MotionProof

BY_CHECK = {item.check: item for item in CORRUPTIONS if item.check}


def journal(shadow, item, case, name):
    result = admit(shadow, case)
    assert isinstance(result, Admitted), result.reason
    played = play(shadow.cell, item, [(case, result)], fixture=name, number=0)
    return [
        (e.kind, deepcopy({"session": e.session, "n": e.n, "t": e.t, **e.payload}))
        for e in played.journal.events()
    ]


def rules(messages, shadow, **changes):
    motion = replace(expected_motion(shadow.checker.cell), **changes)
    report = check_messages(messages, None, motion)
    assert report.reproved_actions > 0
    return {violation.rule for violation in report.violations}


@pytest.fixture(scope="module")
def items(observations):
    return spread(observations, 6)


@pytest.fixture
def clean(shadow, items):
    item = next(item for item in items if item.phase == "approach")
    return journal(shadow, item, case_of(shadow, item, item.demonstrated, number=0), "held_out")


def of_kind(messages, kind):
    return [message for found, message in messages if found == kind]


def move(messages, body, x_m, *, seen=True):
    """The body stood elsewhere when the chunk was checked, and was seen there (or not)."""
    told = [enqueued(messages)["motion"]["scene"]]
    told += [message["bodies"] for message in of_kind(messages, "scene") if seen]
    for scene in told:
        pose = np.frombuffer(bytes.fromhex(scene[body])).copy()
        pose[0] += x_m
        scene[body] = encode_actions(pose)


def enqueued(messages):
    return next(message for kind, message in messages if kind == "enqueue")


def test_what_the_operator_did_is_proved_in_every_phase(shadow, items):
    phases = set()
    for item in items:
        case = case_of(shadow, item, item.demonstrated, number=0)
        if isinstance(admit(shadow, case), Admitted):
            phases.add(item.phase)
            assert not rules(journal(shadow, item, case, "held_out"), shadow)
    assert {"approach", "insert", "retreat"} <= phases


@pytest.mark.parametrize("check", RULES)
def test_an_executed_row_that_a_missing_check_let_through_is_found(check, shadow, items):
    corruption = BY_CHECK[check]
    table = without(CHECKS, check, *corruption.behind)
    blind = replace(shadow, checker=FeasibilityChecker(shadow.checker.cell, checks=table))
    found = []
    for item in items:
        bad = corruption.apply(case_of(shadow, item, item.demonstrated, number=0), shadow.checker)
        if bad is not None:
            messages = journal(blind, item, bad, corruption.name)
            assert all(enqueued(messages)["layers"].values())
            found.append(rules(messages, shadow))
    assert found and all(RULES[check] in names for names in found)


def test_joints_that_are_not_the_executed_pose_are_found(clean, shadow):
    assert not rules(clean, shadow)
    motion = enqueued(clean)["motion"]
    q_rad = np.frombuffer(bytes.fromhex(motion["q_rad"])).copy()
    q_rad[0] += 1e-4
    motion["q_rad"] = encode_actions(q_rad)
    assert "P6.pose" in rules(clean, shadow)


def test_joints_beyond_their_limits_are_found(clean, shadow):
    motion = enqueued(clean)["motion"]
    q_rad = np.frombuffer(bytes.fromhex(motion["q_rad"])).reshape(-1, motion["joints"]).copy()
    q_rad[:, -1] += 2 * np.pi  # the same poses
    motion["q_rad"] = encode_actions(q_rad)
    motion["q_cmd_rad"] = encode_actions(q_rad[0])
    found = rules(clean, shadow)
    assert "P6.joint_limit" in found and "P6.pose" not in found


def test_a_chunk_that_does_not_say_what_it_was_checked_against_is_found(clean, shadow):
    enqueued(clean)["motion"] = None
    report = check_messages(clean, None, expected_motion(shadow.checker.cell))
    assert {violation.rule for violation in report.violations} == {"P6.ground"}
    assert report.checked_actions > 0 == report.reproved_actions


@pytest.mark.parametrize("change", [{"joints": 6}, {"q_rad": ""}])
def test_a_ground_of_another_size_is_found(change, clean, shadow):
    enqueued(clean)["motion"].update(change)
    assert rules(clean, shadow) == {"P6.ground"}


def test_without_figures_of_the_robot_nothing_is_claimed_to_be_proved(clean):
    assert check_messages(clean).reproved_actions == 0


def test_what_is_held_may_touch_the_target_in_contact_phases_only(shadow, items):
    item = next(item for item in items if item.phase == "insert")
    case = case_of(shadow, item, item.demonstrated, number=0)
    messages = journal(shadow, item, case, "held_out")
    move(messages, shadow.checker.collision.shapes.target_body, 0.012)  # a wall in what is held
    assert not rules(messages, shadow)
    contact = expected_motion(shadow.checker.cell).contact
    elsewhere = replace(contact, phases=frozenset())
    assert "P6.collision" in rules(messages, shadow, contact=elsewhere)
    for force_n in ({"insert": 5.0}, {}):
        gentle = replace(contact, force_n=force_n)
        assert rules(messages, shadow, contact=gentle) == {"P6.force"}


def test_a_scene_that_nobody_saw_is_found(clean, shadow):
    assert of_kind(clean, "scene")
    move(clean, shadow.checker.collision.shapes.target_body, 1e-6, seen=False)
    assert rules(clean, shadow) == {"P6.scene"}


def test_without_a_seen_scene_nothing_is_believed(clean, shadow):
    for message in of_kind(clean, "scene"):
        message["bodies"] = {}
    assert rules(clean, shadow) == {"P1.scene", "P6.scene"}


def test_a_state_of_after_the_row_is_found(clean, shadow):
    """Measured when the first row had ended: nothing is left of the time to get there."""
    chunk = enqueued(clean)
    first = chunk["checked_rows"][0] + 1
    chunk["motion"]["measured_ns"] = chunk["start_ns"] + first * chunk["period_ns"]
    assert rules(clean, shadow) == {"P6.measured_speed", "P6.state_age"}


def test_commands_before_that_do_not_fit_are_found(clean, shadow):
    """The journal says which commands the chunk went on from; a leap in them is a leap."""
    motion = enqueued(clean)["motion"]
    before = np.frombuffer(bytes.fromhex(motion["q_before_rad"])).copy()
    before[-1] += 0.2
    motion["q_before_rad"] = encode_actions(before)
    assert "P6.joint_acceleration" in rules(clean, shadow)


def test_an_honest_chunk_is_held_to_each_limit_of_contact_in_its_phases_only(shadow, items):
    contact = expected_motion(shadow.checker.cell).contact
    tight = {"speed_m_s": 1e-3, "cone_rad": 1e-6, "forgiven_m": 1e-6}
    for phase, broken in (("insert", {"P6.contact_speed", "P6.approach"}), ("approach", set())):
        item = next(item for item in items if item.phase == phase)
        case = case_of(shadow, item, item.demonstrated, number=0)
        messages = journal(shadow, item, case, "held_out")
        assert not rules(messages, shadow)
        assert rules(messages, shadow, contact=replace(contact, **tight)) == broken


def test_the_hand_may_let_go_where_that_is_meant_or_deep_enough(shadow, items):
    """The depth is that of the object's lowest point below the target, by MuJoCo."""
    contact = expected_motion(shadow.checker.cell).contact
    assert not list(contact.letting_go("release", -math.inf))
    assert not list(contact.letting_go("insert", contact.release_depth_m))
    for phase, depth_m in (("insert", 0.019), ("insert", math.nan), ("approach", 1.0)):
        assert [rule for rule, _ in contact.letting_go(phase, depth_m)] == ["P6.release"]
    item = next(item for item in items if item.phase == "insert")
    result = admit(shadow, case_of(shadow, item, item.demonstrated, number=0))
    shapes = shadow.checker.collision.shapes
    proof = MotionProof(expected_motion(shadow.checker.cell))
    proof._pose(result.verdict.q_rad[-1], 0.0, True, {})
    target_m = shapes.nominal_bodies[shapes.target_body][0] + shapes.target_offset_m
    tip_m = proof._data.site_xpos[proof._tcp] - [0.0, 0.0, shapes.held_reach_m]
    assert proof._depth_m() == pytest.approx(target_m[2] - tip_m[2], abs=5e-4)


def test_a_robot_that_must_turn_more_freely_is_not_proved(clean, shadow):
    assert rules(clean, shadow, condition=2.0) == {"P6.singular"}


def test_a_robot_with_weaker_joints_is_not_proved(clean, shadow):
    assert "P6.torque" in rules(clean, shadow, torque_nm=np.full(7, 1.0))


def test_links_of_the_arm_may_not_meet_either(shadow):
    """MuJoCo is asked about every pair with three joints between; the layers about the tool."""
    arm = shadow.checker.kinematics
    proof = MotionProof(expected_motion(shadow.checker.cell))
    generator = np.random.default_rng(0)
    found = set()
    for q_rad in generator.uniform(arm.lower_rad, arm.upper_rad, (400, arm.joint_count)):
        proof._pose(q_rad, 0.02, False, {})
        found |= {text.split(" is ")[0] + "," + text.split(" in ")[1] for _, text in
                  proof._touching(False, False)}  # fmt: skip
    links = {pair for pair in found if pair.count("link") == 2}
    assert links & {"link0,link5.", "link5,link0.", "link0,link6.", "link6,link0."}
    assert not {pair for pair in found if {"link0", "link1"} == set(pair.rstrip(".").split(","))}
