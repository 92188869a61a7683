"""Examples of what was rejected: chosen by the rule, judged again, and drawn up whole."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from genpolicy.contract.action import GRIPPER, POSITION
from genpolicy.errors import IntegrityError
from genpolicy.evidence.documents.gallery import GALLERY
from genpolicy.evidence.shadow.gallery import REASONS_EACH, chosen, gallery_of
from genpolicy.evidence.shadow.shadow import HELD_OUT, shadow_policy
from genpolicy.feasibility.reasons import Reason


class Spoiler:
    """Answers with what the operator did, spoilt from one row on in three ways, and once not."""

    method, checkpoint_hash, sampler_config_hash, stochastic = "flow", "w" * 64, "s" * 64, True
    prediction_horizon = 16

    def __init__(self, observations):
        self.chunks = {(o.episode_uuid, o.index): o.demonstrated for o in observations}

    def sample(self, seen, *, noise_names, candidates):
        good = np.stack([self.chunks[name[1:]] for name in noise_names])
        wide, far, none = good.copy(), good.copy(), good.copy()
        wide[:, 7:, GRIPPER] = 0.2
        far[:, 5:, 1] += 0.3
        none[:, 3:, 0] = np.nan
        return SimpleNamespace(actions=np.stack([wide, far, none, good], axis=1), nfe=1)


@pytest.fixture(scope="module")
def few(observations):
    return observations[:4]


@pytest.fixture(scope="module")
def rows(shadow, few):
    return shadow_policy(shadow, Spoiler(few), few, seed=0).candidates


@pytest.fixture(scope="module")
def gallery(shadow, few, rows):
    return gallery_of(shadow, few, rows)


@pytest.fixture(scope="module")
def examples(gallery):
    return {example.reason: example for example in gallery.examples}


def row(reason, margin, *, observation=0, candidate=0, method="flow", fixture=HELD_OUT):
    """A row with nothing in it but what the rule looks at."""
    return SimpleNamespace(
        method=method, fixture=fixture, first_reason=reason, layer_margin=margin,
        observation=observation, candidate=candidate,
    )  # fmt: skip


def test_the_most_frequent_reasons_come_first_and_those_behind_them_not_at_all():
    reasons = list(Reason)[1 : REASONS_EACH + 3]
    many = [row(str(r), -1.0, candidate=k) for n, r in enumerate(reasons) for k in range(9 - n)]
    found = [(item.first_reason, alike, total) for item, alike, total in chosen(many)]
    assert found == [(str(r), 9 - n, len(many)) for n, r in enumerate(reasons[:REASONS_EACH])]


def test_reasons_as_frequent_come_in_the_order_of_the_checks_and_methods_by_name():
    two = [row("expired", -1.0), row("workspace", -1.0, method="diffusion"), row("finite", None)]
    assert [(i.method, i.first_reason, n, total) for i, n, total in chosen(two)] == [
        ("diffusion", "workspace", 1, 1), ("flow", "finite", 1, 2), ("flow", "expired", 1, 2),
    ]  # fmt: skip


@pytest.mark.parametrize(("margins", "place"), [
    ([-3.0, -1.0, -2.0], 2), ([-4.0, -1.0, -2.0, -3.0], 3), ([None, -1.0, -2.0], 1),
    ([None, None, None], 1), ([-1.0, -1.0, -1.0], 1), ([-5.0], 0),
])  # fmt: skip
def test_the_example_is_the_one_in_the_middle_by_margin(margins, place):
    """Of an even number the worse one; without a number last; alike by observation."""
    many = [row("joint_jerk", m, observation=n) for n, m in enumerate(margins)]
    ((found, alike, _),) = chosen(many[::-1])
    assert (found.observation, alike) == (place, len(margins))


def test_nothing_but_rejections_on_held_out_observations_with_a_path_is_chosen():
    other = [row("expired", -1.0, fixture="expired"), row("", 0.1), row("shape", -1.0)]
    assert chosen(other) == [] and chosen([]) == []


def test_each_reason_is_shown_with_its_row_margin_and_limit(examples, rows, shadow):
    """Where the chunk was spoilt: the gripper in row 7, the NaN in row 3, the leap in row 5."""
    assert set(examples) == {row.first_reason for row in rows if row.fixture == HELD_OUT} - {""}
    gripper, none = examples["gripper_range"], examples["finite"]
    assert (gripper.row, gripper.unit) == (7, "m")
    assert gripper.margin == pytest.approx(0.045 - 0.2) and gripper.limits == [-0.005, 0.045]
    assert none.row == 3 and none.margin is None and none.limits == []
    assert none.raw_m[2] is not None and none.raw_m[3:] == [None] * 13
    far = examples["projection_too_large"]
    settings = shadow.checker.settings
    assert far.row == 5 and far.unit == "m" and far.limits == [settings.position_change_limit_m]
    assert all(example.outcome == "failed" for example in examples.values())


def test_an_example_states_the_candidate_that_it_is(examples, rows):
    table = {(r.observation, r.candidate): r for r in rows if r.fixture == HELD_OUT}
    for example in examples.values():
        own = table[example.observation, example.candidate]
        assert (own.first_reason, own.first_row) == (example.reason, example.row)
        assert (own.situation, own.phase, own.mode) == (
            example.situation, example.phase, example.mode,
        )  # fmt: skip
        for stated, flat in ((example.raw_m, own.raw), (example.projected_m, own.projected)):
            told = np.array([p or [np.nan] * 3 for p in stated])
            positions = np.reshape(flat, (-1, 10))[:, POSITION]
            finite = np.isfinite(positions).all(axis=1)
            np.testing.assert_array_equal(told[finite], positions[finite])
            assert np.isnan(told[~finite]).all()
        alike = [r for r in table.values() if r.first_reason == example.reason]
        assert (example.rejected, example.held_out) == (len(alike), len(table))


def test_the_scene_and_the_tool_are_drawn_up(gallery, examples, shadow):
    names = {shape.name for shape in shadow.checker.collision.shapes.scene}
    for example in gallery.examples:
        kinds = {body.kind for body in example.bodies}
        assert {body.name for body in example.bodies if body.kind != "robot"} == names
        assert {"obstacle", "target", "scene"} <= kinds
        assert example.late_rows == 1 and example.touching == []
    assert not [b for b in examples["finite"].bodies if b.kind == "robot"]  # it has no pose there
    tool = {b.name for b in examples["gripper_range"].bodies if b.kind == "robot"}
    assert {"hand", "finger_left", "finger_right"} <= tool


def test_what_turned_too_far_is_told_in_degrees_of_turn(shadow, few):
    class Turned(Spoiler):
        def sample(self, seen, *, noise_names, candidates):
            chunks = np.stack([self.chunks[name[1:]] for name in noise_names])
            chunks[:, 6:, 3:9] = (0.0, 1.0, 0.0, 1.0, 0.0, 0.0)
            return SimpleNamespace(actions=chunks[:, None], nfe=1)

    found = shadow_policy(shadow, Turned(few), few[:1], seed=0).candidates
    (example,) = gallery_of(shadow, few, found).examples
    assert (example.reason, example.unit) == ("projection_too_large", "rad")
    assert example.limits == [shadow.checker.settings.rotation_change_limit_rad]


def test_it_is_a_document_that_is_read_back(gallery, tmp_path):
    GALLERY.write(tmp_path, gallery)
    assert GALLERY.read(tmp_path) == gallery


@pytest.mark.parametrize(("changes", "said"), [
    ({"first_reason": "joint_jerk"}, "rejected for joint_jerk"), ({"first_row": 9}, "at action 9"),
    ({"observation": 99}, "of observation 99, expected one of 4"),
    ({"layer_margin": -0.5}, "with a margin of -0.5 in representation"),
    ({"layer_margin": None}, "with a margin of None in representation"),
    ({"margin_layer": "contact"}, "in contact, expected what the layers say: -0.1.* in repr"),
])  # fmt: skip
def test_a_row_of_which_the_layers_say_something_else_is_refused(shadow, few, rows, changes, said):
    one = next(r for r in rows if (r.fixture, r.first_reason) == (HELD_OUT, "gripper_range"))
    with pytest.raises(IntegrityError, match=said):
        gallery_of(shadow, few, [replace(one, **changes)])


def test_a_row_that_the_layers_admit_is_refused(shadow, few, rows):
    good = next(r for r in rows if r.fixture == HELD_OUT and not r.first_reason)
    forged = replace(good, first_reason="joint_jerk", first_row=2)
    with pytest.raises(IntegrityError, match="what the layers say: admitted"):
        gallery_of(shadow, few, [forged])


def test_what_touches_is_named_and_marked(shadow, observations):
    """Straight at the obstacle, no faster than allowed."""
    item = next(o for o in observations if o.phase == "approach")
    task = shadow.task
    (place, _), _ = task.scene_poses(item.history[-1])[task.obstacles[0]], None
    here = task.action_at(item.history[-1])
    way = np.array([*place[:2], here[2]]) - here[:3]
    steps = 0.01 * smooth(np.arange(1, 17)) * way / np.linalg.norm(way)

    class Into(Spoiler):
        def sample(self, seen, *, noise_names, candidates):
            chunk = np.tile(here, (16, 1))
            chunk[:, :3] += steps
            return SimpleNamespace(actions=np.stack([chunk[None, None]] * len(seen))[0], nfe=1)

    found = shadow_policy(shadow, Into([item]), [item], seed=0).candidates
    (example,) = gallery_of(shadow, [item], found).examples
    assert example.layer == "geometric" and example.touching[1] == task.obstacles[0]
    touching = {body.name: body.kind for body in example.bodies if body.touches}
    assert touching == {example.touching[0]: "robot", example.touching[1]: "obstacle"}
    assert example.limits == [shadow.checker.settings.clearance_m] and example.margin < 0


def smooth(row):
    """Rows at an even pace, but for the first ones. Shape (n, 1)."""
    return (row * np.minimum(1.0, row / 5))[:, None]
