"""The first offending row: where a fault is put, it is found; of whatever check, late rows too."""

from dataclasses import replace

import numpy as np
import pytest

from genpolicy.contract.action import GRIPPER, POSITION
from genpolicy.contract.chunk import Projected
from genpolicy.execution.checks import without
from genpolicy.feasibility.admission import FeasibilityChecker
from genpolicy.feasibility.checks import CHECKS
from genpolicy.feasibility.offence import offending_row
from genpolicy.feasibility.reasons import Reason

ROW = 6


def row_of(kit, checker, name, actions, ctx, *, raw=None, changes=(0.0, 0.0), **metadata):
    """The first offending row of a chunk that the check refuses."""
    proposal = kit.proposal(actions if raw is None else raw, **metadata)
    projected = Projected(proposal, actions, *changes)
    found = checker.located(projected, checker.check(projected, context=ctx), context=ctx)
    assert found.first_reason == name, (found.first_reason, found.margins)
    assert [layer.row for layer in found.layers if layer is not found.first] == [None] * 5
    return found.first.row


def spoilt(kit, column, value, row=ROW):
    """A chunk that stands still and from one row on is spoilt in some columns."""
    actions = kit.line(kit.START, kit.START)
    actions[row:, column] = value
    return actions


def only(checker, *names):
    """The checker without checks that notice the same fault first."""
    return FeasibilityChecker(checker.cell, checks=without(CHECKS, *names))


SINGLE_ROWS = {
    Reason.FINITE: (0, np.nan),
    Reason.ROTATION_DEGENERATE: (slice(3, 9), 0.0),
    Reason.ROTATION_NOT_ORTHONORMAL: (3, 2.0),
    Reason.GRIPPER_RANGE: (GRIPPER, 0.5),
    Reason.WORKSPACE: (2, 0.4),
    Reason.SCENE_COLLISION: (POSITION, (0.5, 0.0, 0.15)),
}


@pytest.mark.parametrize("row", [1, ROW, 15])
@pytest.mark.parametrize("name", SINGLE_ROWS)
def test_a_row_that_offends_by_itself_is_found(checker, kit, name, row):
    ctx = kit.context(checker, kit.START)
    actions = spoilt(kit, *SINGLE_ROWS[name], row=row)
    assert row_of(kit, checker, name, actions, ctx) == row


@pytest.mark.parametrize("late", [0, 2])
@pytest.mark.parametrize("name", [Reason.JOINT_VELOCITY, Reason.TCP_SPEED])
def test_a_step_that_is_too_fast_is_found_whatever_comes_late(checker, kit, name, late):
    ctx = replace(kit.context(checker, kit.START), first_index=late)
    actions = spoilt(kit, 1, 0.1)
    others = {c.name for c in CHECKS if c.layer == "dynamic"} - {name}
    assert row_of(kit, only(checker, *others), name, actions, ctx) == ROW


def test_a_sweep_offends_with_the_row_that_it_leads_to(checker, kit):
    """Rows on either side of the post: each is free, the way to the second one is not."""
    start = np.array([0.5, -0.12, 0.15])
    ctx = kit.context(checker, start)
    actions = kit.line(start, start)
    actions[ROW:, 1] = 0.12
    assert row_of(kit, checker, Reason.SWEPT_COLLISION, actions, ctx) == ROW


def test_a_late_row_counts_where_the_check_looks_at_it(checker, kit):
    ctx = replace(kit.context(checker, kit.START), first_index=3)
    assert row_of(kit, checker, Reason.GRIPPER_RANGE, spoilt(kit, GRIPPER, 0.5, row=1), ctx) == 1


def test_a_chunk_that_is_too_long_offends_behind_the_longest(checker, kit):
    ctx = kit.context(checker, kit.START)
    actions = kit.line(kit.START, kit.START, n=kit.K + 3)
    assert row_of(kit, checker, Reason.SHAPE, actions, ctx) == kit.K


def test_projection_offends_with_the_row_that_it_moved_too_far(checker, kit):
    ctx = kit.context(checker, kit.START)
    raw = spoilt(kit, 1, 0.005, row=2)
    raw[ROW:, 1] = 0.05
    actions = kit.line(kit.START, kit.START)
    found = row_of(
        kit, checker, Reason.PROJECTION_TOO_LARGE, actions, ctx, raw=raw, changes=(0.05, 0.0)
    )
    assert found == ROW


@pytest.mark.parametrize(("late", "metadata", "name"), [
    (0, {"session_epoch": 0}, Reason.SESSION_EPOCH), (2, {"valid_until_s": 9.0}, Reason.EXPIRED),
])  # fmt: skip
def test_what_every_row_breaks_alike_offends_with_the_first_that_is_executed(
    checker, kit, late, metadata, name
):
    ctx = replace(kit.context(checker, kit.START), first_index=late)
    assert row_of(kit, checker, name, kit.line(kit.START, kit.SIDE), ctx, **metadata) == late


def test_an_unknown_check_offends_with_the_first_row(checker, kit):
    ctx = replace(kit.context(checker, kit.START), state_time_s=20.0)
    actions = kit.line(kit.START, kit.SIDE)
    assert row_of(kit, checker, Reason.MEASURED_VELOCITY, actions, ctx) == 0


@pytest.mark.parametrize("raw", [np.zeros((0, 10)), np.zeros((4, 3)), np.zeros(7)])
def test_what_is_no_chunk_has_no_row(checker, kit, raw):
    assert row_of(kit, checker, Reason.SHAPE, raw, kit.context(checker, kit.START)) is None


def test_rows_that_are_all_late_and_checks_that_hold_have_no_row(checker, kit):
    ctx = kit.context(checker, kit.START)
    late = replace(ctx, first_index=16)
    actions = kit.line(kit.START, kit.SIDE)
    assert row_of(kit, checker, Reason.SHAPE, actions, late) is None
    fine = Projected(kit.proposal(actions), actions, 0.0, 0.0)
    for check in CHECKS:
        assert offending_row(check, fine, context=ctx, cell=checker.cell) is None, check.name
    verdict = checker.check(fine, context=ctx)
    assert checker.located(fine, verdict, context=ctx) == verdict


def test_kinematics_are_not_asked_about_numbers_that_are_none(checker, kit):
    ctx = kit.context(checker, kit.START)
    actions = spoilt(kit, 0, np.nan)
    chunk = Projected(kit.proposal(actions), actions, 0.0, 0.0)
    check = next(c for c in CHECKS if c.name is Reason.WORKSPACE)
    assert offending_row(check, chunk, context=ctx, cell=checker.cell) is None


def test_the_row_is_that_of_the_shortest_beginning(checker, kit):
    """By the definition, of random chunks: one row less passes the check, that row does not."""
    ctx = kit.context(checker, kit.START)
    rng, reasons = np.random.default_rng(5), []
    for jitter_m in (0.0, 0.0, 0.0, 0.0, 0.0, 0.0005, 0.001, 0.002, 0.004):
        actions = kit.line(kit.START, np.array(kit.START) + rng.normal(0, 0.15, 3))
        actions[:, POSITION] += rng.normal(0, jitter_m, (kit.K, 3))
        chunk = Projected(kit.proposal(actions), actions, 0.0, 0.0)
        verdict = checker.located(chunk, checker.check(chunk, context=ctx), context=ctx)
        if verdict.passed:
            continue
        row = verdict.first.row
        for rows, refused in ((row, False), (row + 1, True)):
            part = Projected(kit.proposal(actions[:rows]), actions[:rows], 0.0, 0.0)
            if rows:
                margins = checker.check(part, context=ctx, evaluate_all=True).margins
                assert (not margins[verdict.first_reason] >= 0) is refused
        reasons.append(verdict.first_reason)
    assert len(reasons) >= 5 and len(set(reasons)) >= 3, reasons
