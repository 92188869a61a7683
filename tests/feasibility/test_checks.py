"""The table of checks: complete, in order, and the only way to leave one out."""

from dataclasses import replace

import numpy as np
import pytest

from genpolicy.errors import ConfigError
from genpolicy.execution.checks import without
from genpolicy.feasibility.admission import FeasibilityChecker
from genpolicy.feasibility.batch import Margins
from genpolicy.feasibility.checks import CHECKS
from genpolicy.feasibility.reasons import Reason, Unit
from genpolicy.feasibility.settings import LAYERS
from genpolicy.feasibility.verdict import LayerOutcome


def test_the_table_holds_every_reason_once_and_layers_in_order():
    assert [check.name for check in CHECKS] == list(Reason)
    assert len(Reason) == 42
    assert list(dict.fromkeys(check.layer for check in CHECKS)) == list(LAYERS)
    assert sorted(CHECKS, key=lambda check: LAYERS.index(check.layer)) == list(CHECKS)


def test_every_limit_has_a_size(cell):
    assert all(check.scale(cell) > 0 for check in CHECKS)
    for check in CHECKS:
        assert check.gauge(cell).unit is check.unit and isinstance(check.unit, Unit)


UNDEFINED = {Reason.FINITE, Reason.ROTATION_DEGENERATE}
REGION_OR_CHOICE = {
    *UNDEFINED, Reason.WORKSPACE, Reason.CONTROLLER_MODE, Reason.SESSION_EPOCH,
    Reason.CALIBRATION_MISMATCH, Reason.PHASE_TRANSITION, Reason.CHECKPOINT_MISMATCH,
    Reason.SAMPLER_MISMATCH,
}  # fmt: skip


def test_what_is_no_number_fails_only_where_numbers_are_asked_for():
    failing = {check.name for check in CHECKS if check.undefined is LayerOutcome.FAILED}
    assert failing == UNDEFINED
    assert {check.undefined for check in CHECKS} == {LayerOutcome.FAILED, LayerOutcome.UNKNOWN}


def test_a_limit_is_stated_of_all_but_a_region_and_a_choice(cell, checker, kit):
    ctx = kit.context(checker, kit.START)
    limits = {check.name: list(check.limit(cell, ctx)) for check in CHECKS}
    assert {name for name, limit in limits.items() if not limit} == REGION_OR_CHOICE
    assert all(np.all(np.isfinite(limit)) for limit in limits.values())
    assert limits[Reason.SCENE_COLLISION] == [cell.settings.clearance_m]
    assert limits[Reason.CONTACT_FORCE] == [0.0]
    inside = replace(ctx, phase="insert")
    by_phase = {check.name: list(check.limit(cell, inside)) for check in CHECKS}
    assert by_phase[Reason.SCENE_COLLISION] == [cell.settings.contact_clearance_m]
    assert by_phase[Reason.CONTACT_FORCE] == [cell.force_envelope_n["insert"]]


@pytest.mark.parametrize(("name", "factor"), [
    (Reason.JOINT_VELOCITY, 0.5), (Reason.JOINT_ACCELERATION, 0.5), (Reason.JOINT_JERK, 0.5),
    (Reason.TCP_SPEED, 1.0), (Reason.TCP_TURN, 1.0), (Reason.JOINT_TORQUE, 1.0),
    (Reason.MEASURED_VELOCITY, 1.0), (Reason.MEASURED_ACCELERATION, 1.0),
])  # fmt: skip
def test_a_margin_at_rest_is_the_limit_that_is_stated(cell, checker, kit, name, factor):
    """A chunk that stands still uses nothing, so what is left is the smallest of the limits."""
    check = next(item for item in CHECKS if item.name is name)
    ctx = replace(kit.context(checker, kit.START), dq_meas=np.zeros(7))
    standing = kit.line(kit.START, kit.START)
    batch = kit.solved(kit.batch_of((standing, ctx)), cell)
    margin = float(check.measure(batch, cell).values[name][0])
    limit = min(check.limit(cell, ctx))
    if name is Reason.JOINT_TORQUE:  # the arm bears its own weight
        assert 0 < margin < limit == cell.limits.torque_nm.min()
    else:
        assert margin == pytest.approx(limit, rel=1e-5)
    whole = {
        Reason.JOINT_VELOCITY: cell.limits.velocity_rad_s,
        Reason.JOINT_ACCELERATION: cell.limits.acceleration_rad_s2,
        Reason.JOINT_JERK: cell.limits.jerk_rad_s3,
    }
    if name in whole:
        assert limit == pytest.approx(factor * whole[name].min())


def test_a_mutant_is_the_table_minus_a_row():
    assert without(CHECKS) == CHECKS
    rest = without(CHECKS, "expired", "shape")
    assert [c.name for c in CHECKS if c not in rest] == ["shape", "expired"]
    with pytest.raises(ConfigError, match="no_such_check"):
        without(CHECKS, "no_such_check")
    with pytest.raises(ConfigError, match="expired"):
        without(rest, "expired")


@pytest.mark.parametrize(
    "table",
    [
        (),
        (CHECKS[0], CHECKS[0]),
        (replace(CHECKS[0], layer="seventh"),),
        (replace(CHECKS[0], name="never"),),
    ],
)
def test_what_is_no_table_is_a_configuration_error(cell, table):
    with pytest.raises(ConfigError, match="the table of checks"):
        FeasibilityChecker(cell, checks=table)


def test_a_checker_cannot_be_told_to_leave_one_out(cell):
    checker = FeasibilityChecker(cell)
    assert checker.checks == CHECKS
    assert not [name for name in vars(checker) if "disabled" in name]
    with pytest.raises(TypeError):
        FeasibilityChecker(cell, disabled_checks=frozenset({"expired"}))


def refuse_all(batch, cell):
    return Margins({"shape": np.full(len(batch), -1.0)})


def test_a_new_row_decides_like_any_other(cell, kit, checker):
    """A row of one's own in place of another, and the verdict gives its name as the reason."""
    mine = replace(CHECKS[0], measure=refuse_all)
    verdict = kit.judge(
        FeasibilityChecker(cell, checks=(*without(CHECKS, "shape"), mine)),
        kit.line(kit.START, kit.SIDE),
        kit.context(checker, kit.START),
    )
    assert (verdict.first_layer, verdict.first_reason) == ("representation", "shape")
