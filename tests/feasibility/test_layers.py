"""Each check alone: inside passes, outside is rejected with its reason, disabled it passes."""

from dataclasses import replace

import numpy as np
import pytest

from genpolicy.contract.action import join_action
from genpolicy.contract.chunk import Projected
from genpolicy.errors import ConfigError, ContractError, NonFiniteError
from genpolicy.feasibility.settings import CHECKS, CHECKS_BY_LAYER, LAYERS, FeasibilitySettings
from genpolicy.robot.limits import FR3


def judge(checker, kit, actions, ctx, *, changes=(0.0, 0.0), **meta):
    """Check actions as they are, without projection."""
    projected = Projected(kit.proposal(actions, **meta), actions, *changes)
    return checker.check(projected, context=ctx)


def tilt(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


def outside_cases(checker, kit):
    """Per check: actions, context, metadata, changes by projection, checks to disable with it."""
    start, k = np.array(kit.START), kit.K
    good, ctx = kit.line(start, kit.SIDE), kit.context(checker, start)
    spiky = good.copy()
    spiky[8, 1] += 0.012
    over_post = (0.5, -0.15, 0.15)
    across = kit.line(over_post, (0.5, 0.15, 0.15), n=2)
    hover = (0.65, 0.0, 0.13)
    insert = kit.context(checker, hover, phase="insert")
    flat = np.tile(kit.DOWN, (k, 1, 1))
    ramp = np.linspace(0, 0.03, k)
    turned = kit.line(start, start)
    for i in range(k):
        turned[i] = join_action(start, kit.DOWN @ _yaw(0.07 * (i + 1)), 0.0)
    rotations = good.copy()
    rotations[:, 3:9] *= 1.3
    zero = good.copy()
    zero[5, 3:9] = 0.0
    wide = good.copy()
    wide[3, 9] = 0.06
    high = kit.line(start, (0.40, 0.0, 0.285))
    rates = {"joint_velocity", "joint_acceleration", "joint_jerk", "tcp_speed"}
    dynamic = rates | {"tcp_turn"}
    nan = good.copy()
    nan[2, 1] = np.nan
    return {
        "shape": (np.tile(good, (2, 1)), ctx, {}, None, None),
        "finite": (nan, ctx, {}, None, None),
        "rotation_degenerate": (zero, ctx, {}, None, None),
        "rotation_not_orthonormal": (rotations, ctx, {}, None, ()),
        "gripper_range": (wide, ctx, {}, None, {"gripper_opening"}),
        "projection_too_large": (good, ctx, {}, (0.03, 0.0), ()),
        "workspace": (high, ctx, {}, None, ()),
        "unreachable": (kit.line(start, (0.95, 0.0, 0.15)), ctx, {}, None, None),
        "joint_position": (kit.line(start, (0.335, 0, 0.06)), ctx, {}, None, ()),
        "singular": (good, ctx, {}, None, ()),
        "scene_collision": (
            kit.line(start, (0.45, 0, 0.15)), ctx, {}, None, {"swept_collision"},
        ),
        "self_collision": (None, ctx, {}, None, None),
        "swept_collision": (
            across[-1:], kit.context(checker, over_post), {}, None, dynamic,
        ),
        "action_period": (good, ctx, {"action_period_s": 0.1}, None, ()),
        "joint_velocity": (
            join_action(np.linspace(start, (0.40, 0.17, 0.15), 9)[1:], flat[:8], 0.0),
            ctx, {}, None, rates | {"joint_acceleration"},
        ),
        "joint_acceleration": (spiky, ctx, {}, None, rates),
        "joint_jerk": (good, ctx, {}, None, ()),
        "tcp_speed": (
            join_action(np.linspace(start, (0.37, 0.0, 0.27), 5)[1:], flat[:4], 0.0),
            ctx, {}, None, rates,
        ),
        "tcp_turn": (turned, ctx, {}, None, {"joint_acceleration", "joint_velocity"}),
        "approach_direction": (
            kit.line(hover, (0.65, 0.04, 0.13)), insert, {"task_phase": "insert"}, None, (),
        ),
        "contact_speed": (
            kit.line(hover, (0.65, 0.0, 0.055), n=6), insert, {"task_phase": "insert"}, None,
            rates | {"scene_collision", "swept_collision"},
        ),
        "gripper_opening": (kit.line(start, kit.SIDE, opening=ramp), ctx, {}, None, ()),
        "reset": (good, ctx, {"session_epoch": 0}, None, ()),
        "calibration_mismatch": (good, ctx, {"calibration_epoch": "e1"}, None, ()),
        "phase_transition": (good, ctx, {"task_phase": "align"}, None, ()),
        "checkpoint_mismatch": (good, ctx, {"policy_checkpoint_hash": "x"}, None, ()),
        "sampler_mismatch": (good, ctx, {"sampler_config_hash": "x"}, None, ()),
        "future_observation": (
            good, ctx, {"condition_observation_event_time_s": 9.96}, None, (),
        ),
        "out_of_order": (
            good, replace(ctx, newest_accepted_observation_s=9.91), {}, None, (),
        ),
        "stale_observation": (
            good, ctx, {"condition_observation_event_time_s": 9.69}, None, (),
        ),
        "expired": (good, ctx, {"valid_until_s": 9.999}, None, ()),
    }  # fmt: skip


SETTINGS = {
    "singular": {"condition_limit": 5.0},
    "joint_jerk": {"jerk_factor": 0.003},
    "joint_position": {"joint_margin_rad": 0.2},
    "joint_velocity": {"tcp_speed_limit_m_s": 2.0, "velocity_factor": 0.3},
    "tcp_turn": {"maximum_actions": 16},
}


def _yaw(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])


@pytest.fixture(scope="module")
def cases(checker, kit):
    return outside_cases(checker, kit)


def test_every_check_has_a_case(cases):
    assert set(cases) == set(CHECKS)
    assert tuple(CHECKS_BY_LAYER) == LAYERS


def test_inside_passes_every_layer(checker, kit):
    verdict = judge(checker, kit, kit.line(kit.START, kit.SIDE), kit.context(checker, kit.START))
    assert verdict.passed
    assert verdict.first_reason == ""
    assert [layer.passed for layer in verdict.layers] == [True] * 6
    assert all(margin >= 0 for margin in verdict.margins.values())
    assert set(verdict.margins) == set(CHECKS)


@pytest.mark.parametrize("name", [c for c in CHECKS if c != "self_collision"])
def test_outside_is_rejected_with_its_reason_and_the_check_has_an_effect(name, cases, build, kit):
    actions, ctx, meta, changes, others = cases[name]
    settings = SETTINGS.get(name, {})
    masked = set(others or ()) - {name}
    arguments = {"changes": changes or (0.0, 0.0), **meta}
    before = {"workspace", "joint_position"} if name == "unreachable" else set()
    verdict = judge(build(*(masked | before), **settings), kit, actions, ctx, **arguments)
    assert verdict.first_reason == name, verdict.margins
    assert not verdict.passed
    layer = next(n for n in LAYERS if name in CHECKS_BY_LAYER[n])
    assert verdict.first_layer == layer
    assert not verdict.layer(layer).margin >= 0
    behind = LAYERS[LAYERS.index(layer) + 1 :]
    assert [verdict.layer(n).passed for n in behind] == [None] * len(behind)
    without = judge(build(name, *masked, *before, **settings), kit, actions, ctx, **arguments)
    if others is None:  # a later barrier still stands: rejected, but for another reason
        assert not without.passed
        assert without.first_reason != name
    else:
        assert without.passed, (without.first_reason, without.detail)


def test_self_collision_is_rejected_with_its_reason(build, kit):
    """The hand folded back onto the base; kinematic layer off, it would reject first."""
    checker = build("workspace", "joint_position", "singular", "unreachable")
    rng = np.random.default_rng(3)
    arm, model = checker.kinematics, checker.collision
    ctx = kit.context(checker, kit.START)
    for q in rng.uniform(arm.lower_rad, arm.upper_rad, (6000, 7)):
        hit = model.in_collision(q, ctx.scene)
        if hit is not None and hit.second in {"link0", "link1", "link2", "link3"}:
            break
    position, rotation = arm.forward(q)
    action = join_action(position, rotation, 0.0)[None]
    there = replace(ctx, q_cmd=q, q_meas=q, last_action=action[0], q_cmd_history=np.tile(q, (2, 1)))
    verdict = judge(checker, kit, action, there)
    assert verdict.first_reason == "self_collision"
    assert " and link" in verdict.detail
    off = ("self_collision", "scene_collision", "swept_collision")
    names = {"workspace", "joint_position", "singular", "unreachable", *off}
    assert judge(build(*names), kit, action, there).first_reason not in off


@pytest.mark.parametrize(
    ("setting", "values"),
    [
        ("tcp_speed_limit_m_s", (0.5, 0.25, 0.05)),
        ("joint_margin_rad", (0.1, 0.5, 1.5)),
        ("condition_limit", (30.0, 10.0, 2.0)),
        ("velocity_factor", (0.5, 0.3, 0.05)),
        ("acceleration_factor", (0.5, 0.2, 0.02)),
        ("jerk_factor", (0.5, 0.01, 0.0005)),
        ("clearance_m", (0.001, 0.02, 0.2)),
        ("orthonormality_tolerance", (0.2, 1e-3, 1e-12)),
        ("position_change_limit_m", (0.02, 1e-3, 1e-9)),
        ("held_opening_m", (0.018, 0.01, 0.001)),
    ],
)
def test_lowering_a_limit_never_admits(build, kit, checker, setting, values):
    """P8, on random chunks as projected once: a rejected one stays rejected."""
    rng = np.random.default_rng(11)
    ctx = kit.context(checker, kit.START)
    chunks = []
    for _ in range(12):
        end = np.array(kit.START) + rng.normal(0, 0.06, 3)
        actions = kit.line(kit.START, end) + rng.normal(0, 2e-4, (kit.K, 10))
        chunks.append(checker.project(kit.proposal(actions), context=ctx))
    passed = np.array(
        [
            [v.passed for v in build(**{setting: value}).check_many(chunks, [ctx] * 12)]
            for value in values
        ]
    )
    assert np.all(passed[1:] <= passed[:-1])


def test_shrinking_validity_and_age_never_admits(checker, kit):
    """P8 for deadlines."""
    ctx = kit.context(checker, kit.START)
    good = kit.line(kit.START, kit.SIDE)
    ages = [judge(checker, kit, good, replace(ctx, maximum_age_s=a)).passed for a in (0.3, 0.1, 0)]
    until = [judge(checker, kit, good, ctx, valid_until_s=t).passed for t in (10.4, 10.0, 9.9)]
    assert ages == [True, True, False]
    assert until == [True, True, False]


def test_one_chunk_or_many_is_the_same(checker, kit):
    ctx = kit.context(checker, kit.START)
    rng = np.random.default_rng(2)
    ends = np.array(kit.START) + rng.normal(0, 0.08, (10, 3))
    proposals = [kit.proposal(kit.line(kit.START, end)) for end in ends]
    projected = checker.project_many(proposals, [ctx] * 10)
    many = checker.check_many(projected, [ctx] * 10)
    for chunk, proposal, verdict in zip(projected, proposals, many, strict=True):
        assert np.allclose(
            checker.project(proposal, context=ctx).actions, chunk.actions, atol=1e-9, rtol=0
        )
        alone = checker.check(chunk, context=ctx)
        assert alone.first_reason == verdict.first_reason
        for name, margin in alone.margins.items():
            if np.isfinite(margin):
                assert verdict.margins[name] == pytest.approx(margin, abs=1e-5, rel=1e-5)


def test_evaluate_all_adds_evidence_and_keeps_the_first_reason(checker, kit):
    ctx = kit.context(checker, kit.START)
    bad = kit.line(kit.START, (0.45, 0, 0.15))
    projected = Projected(kit.proposal(bad, session_epoch=0), bad, 0.0, 0.0)
    short = checker.check(projected, context=ctx)
    full = checker.check(projected, context=ctx, evaluate_all=True)
    assert short.first_reason == full.first_reason == "scene_collision"
    assert short.layer("fresh").passed is None
    assert full.layer("fresh").passed is False
    assert full.layer("dynamic").passed is True


def test_late_rows_and_rows_beyond_the_horizon_are_not_checked(checker, kit):
    ctx = kit.context(checker, kit.START)
    good = kit.line(kit.START, kit.SIDE)
    late = good.copy()
    late[:2, :3] = (0.45, 0.0, 0.15)  # would collide, but those two are past
    on_time = np.concatenate([late[:2], kit.line(kit.START, kit.SIDE)[:14]])
    assert judge(checker, kit, on_time, ctx).first_reason != ""
    assert judge(checker, kit, on_time, replace(ctx, first_index=2)).passed
    tail = good.copy()
    tail[10:, :3] = (0.45, 0.0, 0.15)
    assert not judge(checker, kit, tail, ctx).passed
    verdict = judge(checker, kit, tail, replace(ctx, end_index=8))
    assert verdict.passed
    assert verdict.rows == (0, 8)


def test_a_missing_history_is_not_invented(checker, kit):
    """Without earlier commands the seam's acceleration is not judged; with them it is."""
    good = kit.line(kit.START, kit.SIDE)
    ctx = kit.context(checker, kit.START)
    moved = ctx.q_cmd_history.copy()
    moved[-1, 0] -= 0.05
    assert judge(checker, kit, good, replace(ctx, q_cmd_history=np.zeros((0, 7)))).passed
    rejected = judge(checker, kit, good, replace(ctx, q_cmd_history=moved))
    assert rejected.first_reason == "joint_acceleration"


def test_letting_go_is_for_the_hole(checker, kit):
    """Open in the air: no; in the insert phase only once the tip is deep; in release: yes."""
    opening = np.clip(np.linspace(-0.02, 0.04, kit.K), 0, None)
    for z, phase, passes in (
        (0.15, "approach", False), (0.13, "align", False), (0.13, "insert", False),
        (0.083, "insert", True), (0.083, "release", True),
    ):  # fmt: skip
        at = (0.65, 0.0, z)
        ctx = kit.context(checker, at, phase=phase)
        verdict = judge(checker, kit, kit.line(at, at, opening=opening), ctx, task_phase=phase)
        assert verdict.passed == passes, (z, phase, verdict.first_reason, verdict.detail)
        assert passes or verdict.first_reason == "gripper_opening"


def test_a_whole_insertion_passes_phase_by_phase(checker, kit):
    down = kit.line((0.65, 0, 0.13), (0.65, 0, 0.09))
    insert = judge(
        checker, kit, down, kit.context(checker, (0.65, 0, 0.13), phase="insert"),
        task_phase="insert",
    )  # fmt: skip
    assert insert.passed, (insert.first_reason, insert.detail)
    up = kit.line((0.65, 0, 0.083), (0.65, 0, 0.15), opening=0.04)
    retreat = kit.context(checker, (0.65, 0, 0.083), phase="retreat", opening=0.04)
    verdict = judge(checker, kit, up, retreat, task_phase="retreat")
    assert verdict.passed, (verdict.first_reason, verdict.detail)


def test_configuration_is_checked(build, checker, kit):
    with pytest.raises(ConfigError, match="disabled_checks"):
        build("no_such_check")
    with pytest.raises(ConfigError, match="limits is of the robot panda"):
        build(robot="fr3")
    twin = build()
    twin.limits, twin.settings = FR3, FeasibilitySettings(robot="fr3")
    with pytest.raises(ConfigError, match="position limits of the table"):
        twin._require_consistent()
    with pytest.raises(ValueError, match="extra"):
        FeasibilitySettings(speed=1.0)
    with pytest.raises(ValueError, match="finite"):
        FeasibilitySettings(clearance_m=float("nan"))


def test_a_context_with_nan_or_without_rows_is_refused(checker, kit):
    ctx = kit.context(checker, kit.START)
    with pytest.raises(NonFiniteError, match="state of the robot is unknown"):
        replace(ctx, q_cmd=np.full(7, np.nan))
    with pytest.raises(ContractError, match="no row of it"):
        replace(ctx, first_index=4, end_index=4)
