"""The representation layer: each of its checks alone, and the margins that it gives."""

import numpy as np
import pytest

from genpolicy.contract.chunk import Projected
from genpolicy.feasibility.batch import Batch
from genpolicy.feasibility.layers.representation import CHECKED, margins

NAMES = CHECKED


@pytest.fixture(scope="module")
def cases(checker, kit):
    ctx, good = kit.context(checker, kit.START), kit.line(kit.START, kit.SIDE)
    nan, zero, wide, long = good.copy(), good.copy(), good.copy(), good.copy()
    nan[2, 1] = np.nan
    zero[5, 3:9] = 0.0
    wide[3, 9] = 0.06
    long[:, 3:9] *= 1.3
    return {
        "shape": kit.Outside(np.tile(good, (2, 1)), ctx, others=None),
        "finite": kit.Outside(nan, ctx, others=None),
        "rotation_degenerate": kit.Outside(zero, ctx, others=None),
        "rotation_not_orthonormal": kit.Outside(long, ctx),
        "gripper_range": kit.Outside(wide, ctx, others=("gripper_opening",)),
        "projection_too_large": kit.Outside(good, ctx, changes=(0.03, 0.0)),
    }


@pytest.mark.parametrize("name", NAMES)
def test_outside_is_refused_by_exactly_this_check(name, cases, build, kit):
    assert tuple(kit.names_of("representation")) == NAMES == tuple(cases)
    kit.turns_red(build, name, cases[name])


def test_margins_of_a_good_chunk(checker, cell, kit):
    """By hand: 16 of 16 actions leave 0; a gripper at 2 cm is 2.5 cm from either end."""
    actions = kit.line(kit.START, kit.SIDE, opening=0.02)
    found = margins(kit.batch_of((actions, kit.context(checker, kit.START))), cell).values
    expected = {
        "shape": 0.0, "finite": 0.0, "rotation_degenerate": 0.0, "rotation_not_orthonormal": 0.2,
        "gripper_range": 0.025, "projection_too_large": 0.02,
    }  # fmt: skip
    assert {name: value[0] for name, value in found.items()} == pytest.approx(expected)


def test_the_change_that_used_up_more_of_its_limit_decides(checker, cell, kit):
    actions, ctx = kit.line(kit.START, kit.SIDE), kit.context(checker, kit.START)
    changes = ((0.005, 0.09), (0.018, 0.01), (0.021, 0.0), (0.0, 0.11))
    chunks = tuple(Projected(kit.proposal(actions), actions, *change) for change in changes)
    found = margins(Batch(chunks, (ctx,) * 4), cell).values["projection_too_large"]
    np.testing.assert_allclose(found, [0.01, 0.002, -0.001, -0.01])


def test_what_is_no_chunk_has_no_further_margins(checker, cell, kit):
    ctx = kit.context(checker, kit.START)
    good, flat = kit.line(kit.START, kit.SIDE), np.ones((16, 7))
    found = margins(kit.batch_of((good, ctx), (flat, ctx)), cell).values
    assert all(value[0] >= 0 for value in found.values())
    assert found["shape"][1] == -1.0
    assert all(np.isnan(value[1]) for name, value in found.items() if name != "shape")
