"""Only the feasibility module makes an `Admitted`, and nobody can forge or change one."""

import copy
import dataclasses
import pickle

import numpy as np
import pytest

from genpolicy.candidates.joining import BLENDS, JoiningSettings
from genpolicy.candidates.votes import Prediction, Votes, blend
from genpolicy.contract.chunk import Candidate, actions_sha256
from genpolicy.errors import IntegrityError
from genpolicy.feasibility.admission import Admitted, Rejected
from genpolicy.feasibility.settings import LAYERS


@pytest.fixture
def admitted(checker, kit):
    ctx = kit.context(checker, kit.START)
    result = checker.admit(kit.proposal(kit.line(kit.START, kit.SIDE)), context=ctx)
    assert isinstance(result, Admitted)
    return result


def test_it_carries_what_passed(admitted):
    assert admitted.actions_sha256 == actions_sha256(admitted.actions)
    assert [layer.name for layer in admitted.verdict.layers] == list(LAYERS)
    assert all(layer.passed is True for layer in admitted.verdict.layers)
    assert admitted.metadata.chunk_id == "c0"
    assert admitted.context.now_s == 10.0
    admitted.verify()


def test_it_cannot_be_constructed(admitted):
    for seal in (None, object(), "seal"):
        with pytest.raises(TypeError, match="admission only"):
            Admitted(
                projected=admitted.projected, verdict=admitted.verdict, context=admitted.context,
                seal=seal,
            )  # fmt: skip


def test_it_cannot_be_copied_replaced_pickled_or_subclassed(admitted):
    for forge in (copy.copy, copy.deepcopy, pickle.dumps, dataclasses.replace):
        with pytest.raises(TypeError):
            forge(admitted)
    with pytest.raises(TypeError, match="subclassed"):
        type("Forged", (Admitted,), {})
    for change in (
        lambda: setattr(admitted, "verdict", None),
        lambda: delattr(admitted, "verdict"),
    ):
        with pytest.raises(TypeError, match="propose a new chunk"):
            change()


def test_a_forgery_behind_the_seal_is_recognised(admitted):
    forged = object.__new__(Admitted)
    for name in ("projected", "actions_sha256", "verdict", "context"):
        object.__setattr__(forged, name, getattr(admitted, name))
    with pytest.raises(IntegrityError, match="not issued by the feasibility module"):
        forged.verify()


def test_changed_actions_are_recognised(admitted):
    with pytest.raises(ValueError, match="read-only"):
        admitted.actions[0, 0] = 1.0
    admitted.actions.flags.writeable = True
    admitted.actions[0, 0] = np.nextafter(admitted.actions[0, 0], 2)
    with pytest.raises(IntegrityError, match="changed since they passed"):
        admitted.verify()


def test_a_rejected_chunk_is_another_type_with_raw_kept(checker, kit):
    ctx = kit.context(checker, kit.START)
    raw = kit.line(kit.START, (0.45, 0, 0.15))
    result = checker.admit(kit.proposal(raw), context=ctx)
    assert isinstance(result, Rejected)
    assert result.reason == "scene_collision"
    assert np.array_equal(result.projected.proposal.actions, raw)


@pytest.mark.parametrize("rule", BLENDS)
def test_a_blend_needs_an_admission_of_its_own(checker, kit, rule):
    """P6: both parents pass, what they blend into, by either sign, runs into the post."""
    ctx = kit.context(checker, kit.START)
    left, right = (checker.admit(kit.proposal(kit.detour(s)), context=ctx) for s in (1, -1))
    assert isinstance(left, Admitted)
    assert isinstance(right, Admitted)
    before = Prediction("earlier", left.metadata, kit.detour(1), left.actions)
    mixed = blend(
        Candidate(right.metadata, kit.detour(-1)),
        [Votes(before, first=0, stop=kit.K, shift=0)],
        JoiningSettings(rule=rule),
    )
    assert mixed.metadata.chunk_id not in ("earlier", left.metadata.chunk_id)
    assert mixed.selected_by == rule
    result = checker.admit(mixed, context=ctx)
    assert isinstance(result, Rejected)
    assert result.verdict.first_layer == "geometric"


def test_every_candidate_has_one_verdict_and_one_reason(checker, kit):
    """P13: candidates = admitted + rejected by first reason; layers exclusive and ordered."""
    rng = np.random.default_rng(9)
    ctx = kit.context(checker, kit.START)
    proposals = [
        kit.proposal(kit.line(kit.START, np.array(kit.START) + rng.normal(0, 0.12, 3)))
        for _ in range(30)
    ]
    results = checker.admit_many(proposals, [ctx] * 30)
    assert len(results) == 30
    reasons = [r.reason for r in results if isinstance(r, Rejected)]
    assert sum(isinstance(r, Admitted) for r in results) + len(reasons) == 30
    assert len(set(reasons)) >= 2
    for result in results:
        passed = [layer.passed for layer in result.verdict.layers]
        failed = passed.index(False) if False in passed else 6
        assert passed == [True] * failed + [False] * (failed < 6) + [None] * (5 - failed)


def relabelled(admitted, **changes):
    """The genuine object, with other metadata put below its actions."""
    proposal = dataclasses.replace(
        admitted.projected.proposal, metadata=dataclasses.replace(admitted.metadata, **changes)
    )
    return {"projected": dataclasses.replace(admitted.projected, proposal=proposal)}


@pytest.mark.parametrize("bent", [
    lambda a: relabelled(a, valid_until_s=99.0),
    lambda a: relabelled(a, chunk_id="other"),
    lambda a: relabelled(a, session_epoch=7),
    lambda a: {"verdict": dataclasses.replace(a.verdict, rows=(0, 99))},
    lambda a: {"verdict": dataclasses.replace(a.verdict, margins={})},
    lambda a: {"context": dataclasses.replace(a.context, q_meas=a.context.q_meas + 1e-9)},
    lambda a: {"context": dataclasses.replace(a.context, last_action=a.context.last_action + 1)},
    lambda a: {"context": dataclasses.replace(a.context, now_s=11.0)},
])  # fmt: skip
def test_a_genuine_chunk_with_other_papers_is_recognised(admitted, bent):
    for name, value in bent(admitted).items():
        object.__setattr__(admitted, name, value)
    with pytest.raises(IntegrityError, match="with other metadata, another verdict or another"):
        admitted.verify()


def test_papers_that_say_the_same_are_the_same(admitted):
    for name, value in relabelled(admitted).items():
        object.__setattr__(admitted, name, value)
    admitted.verify()
