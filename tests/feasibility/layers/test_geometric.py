"""The geometric layer: each of its checks alone, at the rows and between them."""

from dataclasses import replace

import numpy as np
import pytest

from genpolicy.contract.action import join_action
from genpolicy.execution.checks import without
from genpolicy.feasibility.admission import FeasibilityChecker
from genpolicy.feasibility.checks import CHECKS
from genpolicy.feasibility.layers.geometric import margins, measured_margins, swept_margins

BESIDE, BEYOND = (0.5, -0.15, 0.15), (0.5, 0.15, 0.15)
RATES = (
    "joint_velocity", "joint_acceleration", "joint_jerk", "joint_torque", "payload_torque",
    "tcp_speed", "tcp_turn", "measured_velocity", "measured_collision",
)  # fmt: skip
SAMPLED, ON_THE_WAY = ("scene_collision",), ("swept_collision", "measured_collision")
KINEMATIC = ("workspace", "joint_position", "singular", "unreachable")


@pytest.fixture(scope="module")
def cases(checker, kit):
    start = kit.context(checker, kit.START)
    return {
        "scene_collision": kit.Outside(
            kit.line(kit.START, (0.45, 0, 0.15)),
            start,
            others=ON_THE_WAY,
        ),
        "self_collision": folded(checker, kit),
        "swept_collision": kit.Outside(
            kit.line(BESIDE, BEYOND, n=1), kit.context(checker, BESIDE), others=RATES
        ),
        "measured_collision": cut_off(checker, kit),
    }


def cut_off(checker, kit):
    """Commands rest on one side of the post; on the other the arm was seen, a while ago."""
    ctx = kit.context(checker, BESIDE)
    beyond = kit.context(checker, BEYOND).q_cmd
    seen = replace(ctx, q_meas=beyond, state_time_s=ctx.now_s - 0.28)
    return kit.Outside(kit.line(BESIDE, BESIDE), seen)


def folded(checker, kit):
    """The hand folded back onto the base; the kinematic layer would refuse that first."""
    rng = np.random.default_rng(3)
    arm, model = checker.kinematics, checker.collision
    ctx = kit.context(checker, kit.START)
    for q in rng.uniform(arm.lower_rad, arm.upper_rad, (6000, 7)):
        hit = model.in_collision(q, ctx.scene)
        if hit is not None and hit.second in {"link0", "link1", "link2", "link3"}:
            break
    action = join_action(*arm.forward(q), 0.0)[None]
    there = replace(ctx, q_cmd=q, q_meas=q, last_action=action[0], q_cmd_history=np.tile(q, (2, 1)))
    return kit.Outside(action, there, others=(*KINEMATIC, *SAMPLED, *ON_THE_WAY))


@pytest.mark.parametrize(
    "name", ["scene_collision", "self_collision", "swept_collision", "measured_collision"]
)
def test_outside_is_refused_by_exactly_this_check(name, cases, build, kit):
    assert list(cases) == kit.names_of("geometric")
    kit.turns_red(build, name, cases[name])


def test_the_detail_says_what_touched_what(cases, build, kit):
    for name, text in (("scene_collision", "post"), ("self_collision", " and link")):
        case = cases[name]
        verdict = kit.judge(build(*KINEMATIC), case.actions, case.context)
        assert text in verdict.detail


def test_the_check_that_noticed_carries_the_depth(cases, cell, kit):
    case = cases["scene_collision"]
    found = margins(kit.solved(kit.batch_of((case.actions, case.context)), cell), cell)
    assert found.values["scene_collision"][0] < 0
    assert found.values["self_collision"][0] == 0
    assert "post" in found.details[0]


def test_between_two_rows_only_the_swept_test_sees_it(cases, cell, kit):
    case = cases["swept_collision"]
    batch = kit.solved(kit.batch_of((case.actions, case.context)), cell)
    assert margins(batch, cell).values["scene_collision"][0] >= 0
    found = swept_margins(batch, cell)
    assert found.values["swept_collision"][0] < 0
    assert "post" in found.details[0]


def test_what_no_check_asks_is_not_computed(cell, kit, checker, monkeypatch):
    """The swept test is the expensive one; without its row it is never made."""
    good, ctx = kit.line(kit.START, kit.SIDE), kit.context(checker, kit.START)

    def never(*args, **kwargs):
        raise AssertionError("a test that no check asked for")

    monkeypatch.setattr(cell.collision, "check_swept", never)
    blind = FeasibilityChecker(cell, checks=without(CHECKS, *ON_THE_WAY, "contact_surface"))
    assert kit.judge(blind, good, ctx).passed
    with pytest.raises(AssertionError, match="no check asked for"):
        kit.judge(checker, good, ctx)
    monkeypatch.setattr(cell.collision, "check_samples", never)
    names = (*SAMPLED, "self_collision", *ON_THE_WAY, "contact_surface")
    blind = FeasibilityChecker(cell, checks=without(CHECKS, *names))
    assert kit.judge(blind, good, ctx).passed


@pytest.mark.parametrize("periods", range(7))
def test_an_arm_that_follows_its_commands_round_the_post_cuts_no_corner(checker, kit, periods):
    """Seen up to 0.3 s ago: the straight way from there would lead through the post."""
    angle = np.pi - 0.15 * np.arange(17)
    ring = [0.5 + 0.102 * np.cos(angle), 0.102 * np.sin(angle), np.full(17, 0.15)]
    rotation = np.broadcast_to(kit.DOWN, (17, 3, 3))
    actions = join_action(np.stack(ring, axis=1), rotation, np.zeros(17))
    start = kit.context(checker, actions[0, :3])
    q, reached = checker.ik_chunk(actions, start.q_cmd)
    assert reached.all()
    now = 8
    ctx = replace(
        start, q_cmd=q[now], last_action=actions[now], q_cmd_history=q[now - 2 : now],
        q_meas=q[now - periods], state_time_s=start.now_s - periods * kit.PERIOD_S,
    )  # fmt: skip
    verdict = kit.judge(checker, actions[now + 1 :], ctx)
    assert verdict.passed, (verdict.first_reason, verdict.detail, verdict.margins)


def test_the_way_back_is_asked_without_clearance(cell, kit, checker):
    """Where the arm stands already, 1 mm more is not asked of it; what it is told to do must."""
    near = (0.50, -0.0865, 0.15)
    ctx = kit.context(checker, near)
    batch = kit.solved(kit.batch_of((kit.line(near, near), ctx)), cell)
    room = [m(batch, cell).values for m in (margins, measured_margins)]
    wide = replace(cell, settings=cell.settings.model_copy(update={"clearance_m": 0.05}))
    assert margins(batch, wide).values["scene_collision"][0] < 0 <= room[0]["scene_collision"][0]
    assert measured_margins(batch, wide).values["measured_collision"][0] == pytest.approx(
        room[1]["measured_collision"][0]
    )


def test_the_swept_test_is_made_where_the_rows_are_free(checker, cases, kit):
    """A chunk that hits at its rows costs no sweep, beside one that does not."""
    hit, good = cases["scene_collision"], kit.line(kit.START, kit.SIDE)
    chunks = kit.batch_of((hit.actions, hit.context), (good, hit.context))
    bad, fine = checker.check_many(chunks.projected, chunks.contexts, evaluate_all=True)
    assert bad.first_reason == "scene_collision" and "swept_collision" not in bad.margins
    assert fine.passed and fine.margins["swept_collision"] > 0
