"""Every reason at the margin of its check: verdict, margins of all checks and first row, golden.

The chunks are the corrupted fixtures of Gate C, one for each reason, made from two chunks of this
folder. That a margin is right is shown by the tests beside the layers; here none moves unseen.
"""

import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from genpolicy.contract.chunk import Projected
from genpolicy.evidence.shadow.case import Case, decide
from genpolicy.evidence.shadow.corruption import CORRUPTIONS
from genpolicy.feasibility.admission import Admitted
from genpolicy.feasibility.checks import CHECKS
from genpolicy.feasibility.reasons import Reason

sys.path.insert(0, str(Path(__file__).parents[1]))
from held import hold

GOLDEN = Path(__file__).parent / "golden"
HOVER, LOWER = (0.65, 0.0, 0.13), (0.65, 0.0, 0.105)
OWN = [corruption for corruption in CORRUPTIONS if corruption.check]


@pytest.fixture(scope="module")
def good(checker, kit):
    """A chunk in the open and one in contact, each from an arm that was measured aside."""
    found = []
    for start, end, phase in ((kit.START, kit.SIDE, "approach"), (HOVER, LOWER, "insert")):
        ctx = kit.context(checker, start, phase=phase)
        ctx = replace(ctx, q_meas=ctx.q_cmd + 0.001, dq_meas=np.full(7, 0.002))
        found.append(
            Case(
                kit.proposal(kit.line(start, end), task_phase=phase), ctx,
                dict(ctx.scene.bodies), ("post",), frozenset({"approach", "align"}),
            )
        )  # fmt: skip
    return found


def stated(checker, case):
    """All that feasibility says of a case, in plain numbers."""
    proposal, context = case.proposal, case.context
    projected = (
        Projected(proposal, proposal.actions, 0.0, 0.0)
        if case.unprojected
        else checker.project(proposal, context=context)
    )
    verdict = checker.located(projected, checker.check(projected, context=context), context=context)
    whole = checker.check(projected, context=context, evaluate_all=True)
    layers = {
        layer.name: [str(layer.outcome), layer.check, layer.unit, layer.row, layer.margin]
        for layer in verdict.layers
    }
    return {
        "reason": verdict.first_reason,
        "layers": layers,
        "margins": {str(name): float(margin) for name, margin in whole.margins.items()},
        "detail": whole.detail,
        "rows": list(verdict.rows),
        "changed": [projected.position_change_m, projected.rotation_change_rad],
        "moved": numbers(projected.actions - proposal.actions),
    }


def numbers(values):
    """The largest and the mean size of each column; what is no number is told by its count."""
    finite = np.where(np.isfinite(values), np.abs(values), 0.0)
    return [*finite.max(axis=0), *finite.mean(axis=0), int(np.sum(~np.isfinite(values)))]


def plain(value):
    """The same with floats of Python, and texts for what JSON has no number for."""
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, list):
        return [plain(item) for item in value]
    if isinstance(value, float) and math.isfinite(value):
        return float(value)
    return str(value) if isinstance(value, (str, float)) else value


def test_every_reason_has_the_margins_and_the_first_row_that_it_had(checker, build, good):
    found = {}
    for corruption in OWN:
        broken = [corruption.apply(case, checker) for case in good]
        case = next(item for item in broken if item is not None)
        told = stated(build(*corruption.behind), case)
        assert told["reason"] == corruption.check, corruption.name
        found[corruption.check] = plain(told)
    assert list(found) == list(Reason)
    hold(GOLDEN / "reasons.json", found)


def test_what_is_admitted_has_the_margins_that_it_had(checker, good):
    assert all(isinstance(decide(checker, case), Admitted) for case in good)
    hold(
        GOLDEN / "admitted.json",
        {case.context.phase: plain(stated(checker, case)) for case in good},
    )


def test_every_limit_that_is_stated_is_what_it_was(cell, good):
    """Of all checks, in the open and in contact: what pages state, and what margins count by."""
    found = {
        str(check.name): {
            "scale": float(check.scale(cell)),
            **{case.context.phase: plain(list(check.limit(cell, case.context))) for case in good},
        }
        for check in CHECKS
    }
    assert list(found) == list(Reason)
    hold(GOLDEN / "limits.json", found)
