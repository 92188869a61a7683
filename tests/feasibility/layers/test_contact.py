"""The contact layer: each of its checks alone, and tasks that hold or open nothing."""

from dataclasses import replace

import numpy as np
import pytest

from genpolicy.feasibility.admission import FeasibilityChecker
from genpolicy.feasibility.inverse import solved
from genpolicy.feasibility.layers.contact import force_margins, margins, surface_margins
from genpolicy.robot.impedance import STIFFNESS_N_M
from genpolicy.robot.scene_state import SceneState

HOVER = (0.65, 0.0, 0.13)
WALL = (0.677, 0.0, 0.097)  # over the target's wall, the tip 18 mm below its top
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])
RATES = ("joint_velocity", "joint_acceleration", "joint_jerk", "tcp_speed")


def standing(checker, kit, place):
    """The post below what is held, its top 3 mm higher than the tip."""
    bodies = dict(kit.context(checker, place).scene.bodies)
    tip_m = place[2] - checker.collision.shapes.held_reach_m
    bodies["post"] = (np.array([place[0], place[1], tip_m + 0.003 - 0.11]), UPRIGHT)
    return SceneState(bodies)


@pytest.fixture(scope="module")
def cases(checker, kit):
    pressed = kit.context(checker, WALL, phase="insert")
    insert, phase = kit.context(checker, HOVER, phase="insert"), {"task_phase": "insert"}
    ramp = np.linspace(0, 0.03, kit.K)
    return {
        "approach_direction": kit.Outside(kit.line(HOVER, (0.65, 0.04, 0.13)), insert, phase),
        "contact_speed": kit.Outside(
            kit.line(HOVER, (0.65, 0.0, 0.06), n=6), insert, phase,
            others=(*RATES, "scene_collision", "swept_collision"),
        ),
        "gripper_opening": kit.Outside(
            kit.line(kit.START, kit.SIDE, opening=ramp), kit.context(checker, kit.START)
        ),
        "contact_surface": kit.Outside(
            kit.line(HOVER, HOVER), replace(insert, scene=standing(checker, kit, HOVER)), phase
        ),
        "contact_force": kit.Outside(kit.line(WALL, WALL), pressed, phase),
    }  # fmt: skip


@pytest.mark.parametrize("name", [
    "approach_direction", "contact_speed", "gripper_opening", "contact_surface", "contact_force",
])  # fmt: skip
def test_outside_is_refused_by_exactly_this_check(name, cases, build, kit):
    assert list(cases) == kit.names_of("contact")
    kit.turns_red(build, name, cases[name])


def test_on_the_way_from_where_the_arm_was_measured_it_touches_nothing_else(checker, cell, kit):
    """What is held stood in the post's top when it was seen; its commands are free of it."""
    aside = (HOVER[0], HOVER[1] + 0.04, HOVER[2])
    ctx = kit.context(checker, HOVER, phase="insert")
    ctx = replace(ctx, scene=standing(checker, kit, aside))
    seen = replace(ctx, q_meas=kit.context(checker, aside).q_cmd)
    phase = {"task_phase": "insert"}
    assert kit.judge(checker, kit.line(HOVER, HOVER), ctx, **phase).passed
    verdict = kit.judge(checker, kit.line(HOVER, HOVER), seen, **phase)
    assert verdict.first_reason == "contact_surface" and "post" in verdict.detail


def test_margins_by_hand(checker, cell, kit):
    """One step of 1 mm sideways and 4 mm down in 50 ms, held in a contact phase."""
    ctx = kit.context(checker, HOVER, phase="insert")
    step = kit.line(HOVER, (HOVER[0] + 0.001, HOVER[1], HOVER[2] - 0.004), n=1)
    found = margins(kit.batch_of((step, ctx)), cell).values
    cone = 0.003 + np.tan(0.35) * 0.004 - 0.001
    assert found["approach_direction"][0] == pytest.approx(min(cone, 0.003))
    assert found["contact_speed"][0] == pytest.approx(0.15 - np.hypot(0.001, 0.004) / 0.05, 1e-5)
    assert found["gripper_opening"][0] == 0.0


def test_outside_the_contact_phases_nothing_applies(checker, cell, kit):
    ctx = kit.context(checker, HOVER, phase="align")
    fast = kit.line(HOVER, (0.65, 0.04, 0.05), n=2)
    found = margins(kit.batch_of((fast, ctx)), cell).values
    assert all(value[0] == 0.0 for value in found.values())


def test_letting_go_is_for_the_target(checker, kit):
    """Open in the air: no; in the insert phase only once the tip is deep; in release: yes."""
    opening = np.clip(np.linspace(-0.02, 0.04, kit.K), 0, None)
    for z, phase, passes in (
        (0.15, "approach", False), (0.13, "align", False), (0.13, "insert", False),
        (0.083, "insert", True), (0.083, "release", True),
    ):  # fmt: skip
        at = (0.65, 0.0, z)
        ctx = kit.context(checker, at, phase=phase)
        verdict = kit.judge(checker, kit.line(at, at, opening=opening), ctx, task_phase=phase)
        assert verdict.passed == passes, (z, phase, verdict.first_reason, verdict.detail)
        assert passes or verdict.first_reason == "gripper_opening"


def test_a_whole_insertion_passes_phase_by_phase(checker, kit):
    down = kit.line(HOVER, (0.65, 0, 0.09))
    insert = kit.judge(
        checker, down, kit.context(checker, HOVER, phase="insert"), task_phase="insert"
    )
    assert insert.passed, (insert.first_reason, insert.detail)
    up = kit.line((0.65, 0, 0.083), (0.65, 0, 0.15), opening=0.04)
    retreat = kit.context(checker, (0.65, 0, 0.083), phase="retreat", opening=0.04)
    verdict = kit.judge(checker, up, retreat, task_phase="retreat")
    assert verdict.passed, (verdict.first_reason, verdict.detail)


@pytest.mark.parametrize("opening", [0.0, 0.04])
def test_without_a_gripper_nothing_is_let_go(cell, kit, opening):
    """No opening phase and a constant opening: every phase passes, closed or open."""
    checker = FeasibilityChecker(replace(cell, opening_phases=frozenset()))
    for phase in ("approach", "insert", "retreat"):
        ctx = kit.context(checker, HOVER, phase=phase, opening=opening)
        chunk = kit.line(HOVER, (0.65, 0.0, 0.12), opening=opening)
        verdict = kit.judge(checker, chunk, ctx, task_phase=phase)
        assert verdict.passed, (phase, verdict.first_reason)


def test_without_opening_phases_opening_is_refused_everywhere_above_the_target(cell, kit):
    checker = FeasibilityChecker(replace(cell, opening_phases=frozenset()))
    ramp = np.linspace(0, 0.03, kit.K)
    ctx = kit.context(checker, HOVER, phase="retreat")
    verdict = kit.judge(checker, kit.line(HOVER, HOVER, opening=ramp), ctx, task_phase="retreat")
    assert verdict.first_reason == "gripper_opening"


def test_without_a_target_nothing_is_ever_deep_enough(cell, kit, checker, monkeypatch):
    deep = kit.context(checker, (0.65, 0.0, 0.083), phase="insert")
    ramp = kit.line((0.65, 0.0, 0.083), (0.65, 0.0, 0.083), opening=np.linspace(0, 0.03, kit.K))
    assert margins(kit.batch_of((ramp, deep)), cell).values["gripper_opening"][0] == 0.0
    monkeypatch.setattr(cell.collision, "shapes", replace(cell.collision.shapes, target_body=""))
    assert margins(kit.batch_of((ramp, deep)), cell).values["gripper_opening"][0] < 0


def solved_batch(kit, checker, actions, ctx):
    return solved(kit.batch_of((actions, ctx)), checker.cell)


def test_force_by_hand(checker, cell, kit):
    """The tip 18 mm below the top of a wall that is 26 mm thick: 18 mm is the shortest way out."""
    ctx = kit.context(checker, WALL, phase="insert")
    found = force_margins(solved_batch(kit, checker, kit.line(WALL, WALL), ctx), cell).values
    assert found["contact_force"][0] == pytest.approx(40.0 - STIFFNESS_N_M * 0.018, abs=0.05)
    settings = cell.settings.model_copy(update={"contact_force_by_phase_n": {"insert": 60.0}})
    assert judged(cell, kit, ctx, settings).passed
    ctx = replace(ctx, phase="release")
    assert judged(cell, kit, ctx, settings).first_reason == "contact_force"


def judged(cell, kit, ctx, settings):
    checker = FeasibilityChecker(replace(cell, settings=settings))
    return kit.judge(checker, kit.line(WALL, WALL), ctx, task_phase=ctx.phase)


def test_in_the_middle_of_the_target_nothing_is_pressed(checker, cell, kit):
    inside = (0.65, 0.0, 0.083)
    ctx = kit.context(checker, inside, phase="insert")
    batch = solved_batch(kit, checker, kit.line(inside, inside), ctx)
    assert force_margins(batch, cell).values["contact_force"][0] == 40.0
    assert surface_margins(batch, cell).values["contact_surface"][0] >= 0.0


def test_what_nothing_is_held_by_presses_and_touches_nothing(checker, cell, kit):
    for place, changes in ((WALL, {}), (HOVER, {"scene": standing(checker, kit, HOVER)})):
        ctx = kit.context(checker, place, phase="insert", opening=0.04, **changes)
        batch = solved_batch(kit, checker, kit.line(place, place, opening=0.04), ctx)
        assert force_margins(batch, cell).values["contact_force"][0] == 40.0
        assert surface_margins(batch, cell).values["contact_surface"][0] >= 0.0


def test_outside_the_contact_phases_the_geometric_layer_refuses_the_same(checker, kit):
    for place, changes in ((WALL, {}), (HOVER, {"scene": standing(checker, kit, HOVER)})):
        ctx = kit.context(checker, place, phase="align", **changes)
        verdict = kit.judge(checker, kit.line(place, place), ctx, task_phase="align")
        assert verdict.first_reason == "scene_collision" and "held" in verdict.detail


def test_another_surface_on_the_way_is_found_between_the_rows(checker, cell, kit):
    """Thin and high, beside both rows: only the motion between them meets it."""
    near, far = (0.62, 0.0, 0.2), (0.68, 0.0, 0.2)
    scene = standing(checker, kit, (0.65, 0.0, 0.2))
    ctx = kit.context(checker, near, phase="insert", scene=scene)
    batch = solved_batch(kit, checker, kit.line(near, far, n=1), ctx)
    found = surface_margins(batch, cell)
    assert found.values["contact_surface"][0] < 0 and found.details[0].startswith("held and post")
