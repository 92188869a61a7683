"""The margin of each layer: of what rejects its own, of what passed the tightest by its share."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from genpolicy.evidence.shadow.layer_margins import (
    CONTACT,
    NO_DISTANCE,
    TWO_UNITS,
    LayerMargin,
    columns_of,
    decides,
    gauges_of,
    in_order,
    judged_again,
)
from genpolicy.evidence.shadow.shadow import HELD_OUT, case_of, shadow_policy
from genpolicy.feasibility.checks import CHECKS
from genpolicy.feasibility.reasons import Reason, Unit
from genpolicy.feasibility.settings import LAYERS
from genpolicy.integrity.rows import columns_of as names_of

LAYER_OF = {check.name: check.layer for check in CHECKS}


class Answers:
    """What the operator did, and what leaps from its sixth row on."""

    method, checkpoint_hash, sampler_config_hash, stochastic = "flow", "w" * 64, "s" * 64, True
    prediction_horizon = 16

    def __init__(self, observations):
        self.chunks = {(o.episode_uuid, o.index): o.demonstrated for o in observations}

    def sample(self, seen, *, noise_names, candidates):
        good = np.stack([self.chunks[name[1:]] for name in noise_names])
        quick = good.copy()
        quick[:, 5:, 1] += 0.02
        return SimpleNamespace(actions=np.stack([good, quick], axis=1), nfe=1)


@pytest.fixture(scope="module")
def rows(shadow, observations):
    few = observations[:8]
    return shadow_policy(shadow, Answers(few), few, seed=0).candidates


@pytest.fixture(scope="module")
def gauges(checker):
    return gauges_of(checker)


@pytest.fixture
def room(gauges):
    """Margins of all checks with which a chunk passes; the way between rows is the closest."""
    wide = {name: 0.9 * gauge.scale for own in gauges.values() for name, gauge in own.items()}
    return wide | dict.fromkeys(NO_DISTANCE, 0.0) | {
        Reason.SWEPT_COLLISION: 0.004, Reason.JOINT_VELOCITY: 0.5, Reason.JOINT_JERK: 300.0,
        Reason.PROJECTION_TOO_LARGE: 1e-6, Reason.UNREACHABLE: 1e-6,
    }  # fmt: skip


def again(room, gauges):
    return judged_again(in_order(room), gauges)


def test_each_layer_keeps_its_own_margin_in_its_own_unit(room, gauges):
    found = again(room, gauges)
    assert tuple(found) == LAYERS and {own.outcome for own in found.values()} == {"passed"}
    swept = found["geometric"]
    assert (swept.check, swept.margin, swept.unit) == ("swept_collision", 0.004, "m")
    assert swept.share == pytest.approx(0.04), "of a tenth of a metre"
    assert all(own.row is None for own in found.values())
    assert decides(found) == "geometric"


def test_units_compare_by_the_share_of_their_limit(room, gauges):
    """300 rad/s^3 is a larger number than .5 rad/s, and a far smaller share of its limit."""
    dynamic = again(room, gauges)["dynamic"]
    assert (dynamic.check, dynamic.margin, dynamic.unit) == ("joint_jerk", 300.0, "rad/s^3")
    scale = gauges["dynamic"][Reason.JOINT_JERK].scale
    assert dynamic.share == 300.0 / scale < 0.5 / gauges["dynamic"][Reason.JOINT_VELOCITY].scale


def test_the_tightest_layer_is_not_the_one_with_the_smallest_number(room, gauges):
    """4 mm of 100 are more than 1 rad/s^3 of thousands."""
    found = again({**room, Reason.JOINT_JERK: 1.0}, gauges)
    assert found["dynamic"].margin > found["geometric"].margin
    assert found["dynamic"].share < found["geometric"].share and decides(found) == "dynamic"


def test_a_check_that_answers_yes_or_no_is_never_the_tightest(room, gauges):
    found = again(room, gauges)
    named = {Reason(own.check) for own in found.values()}
    assert not named & (NO_DISTANCE | TWO_UNITS)
    plain = {c.name for c in CHECKS if c.unit is Unit.NONE and c.scale is CHECKS[1].scale}
    assert plain <= NO_DISTANCE, "what has neither unit nor limit asks yes or no"
    assert {c.name for c in CHECKS if c.unit is Unit.M_OR_RAD} == TWO_UNITS


def test_a_layer_that_measured_nothing_has_no_margin(room, gauges):
    """A contact check that does not apply says 0; what nothing limits is infinite."""
    idle = {name: 0.0 for name, layer in LAYER_OF.items() if layer == CONTACT}
    free = {name: math.inf for name, layer in LAYER_OF.items() if layer == "kinematic"}
    found = again({**room, **idle, **free}, gauges)
    assert found[CONTACT] == found["kinematic"] == LayerMargin("passed")
    at_0 = again({**room, Reason.SWEPT_COLLISION: 0.0}, gauges)["geometric"]
    assert (at_0.check, at_0.margin, at_0.share) == ("swept_collision", 0.0, 0.0)
    everything = again({**dict.fromkeys(Reason, math.inf), **dict.fromkeys(NO_DISTANCE, 0.0)},
                       gauges)  # fmt: skip
    assert decides(everything) == ""


def test_what_rejects_states_the_check_that_it_rejects_for(room, gauges):
    found = again({**room, Reason.JOINT_JERK: -2.0, Reason.JOINT_VELOCITY: 1e-9}, gauges)
    jerk = found["dynamic"]
    assert (jerk.outcome, jerk.check, jerk.margin) == ("failed", "joint_jerk", -2.0)
    assert jerk.share < 0 and decides(found) == "dynamic"
    assert found[CONTACT] == found["fresh"] == LayerMargin("not_reached")
    assert found["geometric"].margin == 0.004


@pytest.mark.parametrize(("name", "outcome"), [
    (Reason.FINITE, "failed"), (Reason.MEASURED_VELOCITY, "unknown"),
])  # fmt: skip
def test_what_could_not_be_measured_has_a_check_and_no_margin(room, gauges, name, outcome):
    own = again({**room, name: math.nan}, gauges)[LAYER_OF[name]]
    assert (own.outcome, own.check) == (outcome, str(name))
    assert own.margin is None and own.share is None


def test_margins_of_more_or_fewer_checks_are_none(room, gauges):
    with pytest.raises(ValueError, match="zip"):
        judged_again(in_order(room)[1:], gauges)


def test_a_check_that_was_not_evaluated_is_not_a_number():
    found = in_order({Reason.SINGULAR: 3.0})
    assert len(found) == len(Reason) and found[list(Reason).index(Reason.SINGULAR)] == 3.0
    assert sum(map(math.isnan, found)) == len(Reason) - 1


def test_every_row_has_the_margins_of_all_its_layers(rows, gauges):
    """As judged: from all margins of a row follows what it states of each layer."""
    assert {row.outcome for row in rows if row.fixture == HELD_OUT} == {"passed", "failed"}
    for row in rows:
        stated = {name: getattr(row, name) for name in columns_of(again({}, gauges))}
        derived = columns_of(judged_again(row.margins, gauges))
        offending = {name for name in derived if name.startswith("row_")}
        assert {n: stated[n] for n in derived if n not in offending} == {
            n: value for n, value in derived.items() if n not in offending
        }
        rows_said = [stated[name] for name in offending if stated[name] is not None]
        assert rows_said == ([] if row.first_row is None else [row.first_row])
        if row.first_row is not None:
            assert stated[f"row_{row.margin_layer}"] == row.first_row


def test_a_row_states_the_layer_that_its_margin_is_of(rows):
    for row in rows:
        assert row.margin_layer in LAYERS
        own = [getattr(row, f"{what}_{row.margin_layer}") for what in ("check", "margin", "unit")]
        assert own == [row.margin_check, row.layer_margin, row.margin_unit]
        passed = row.outcome == "passed"
        assert row.margin_check == row.first_reason or passed
        shares = [getattr(row, f"share_{name}") for name in LAYERS]
        own_share = getattr(row, f"share_{row.margin_layer}")
        assert not passed or own_share == min(s for s in shares if s is not None)


def test_the_margins_are_those_of_the_checks(shadow, checker, observations):
    """Asked again of the checker, by another way than the row was made."""
    few = observations[:2]
    for row in shadow_policy(shadow, Answers(few), few, seed=0).candidates:
        if row.fixture != HELD_OUT:
            continue
        raw = np.reshape(row.raw, (-1, 10))
        case = case_of(shadow, few[row.observation], raw, number=row.observation)
        projected = checker.project(case.proposal, context=case.context)
        verdict = checker.check(projected, context=case.context)
        for name, margin in zip(Reason, row.margins, strict=True):
            expected = verdict.margins.get(name, math.nan)
            assert margin == expected or (math.isnan(margin) and math.isnan(expected))


def test_the_columns_are_those_of_the_row(rows, gauges):
    named = set(columns_of(again({}, gauges)))
    assert named < set(names_of(type(rows[0]))) and len(named) == 6 * len(LAYERS)
