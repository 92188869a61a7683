"""Shadow evidence on few observations: complete rows, a clean stub, balanced books."""

from collections import Counter
from types import SimpleNamespace

import numpy as np
import pytest

from genpolicy.evidence.shadow.corruption import CORRUPTIONS
from genpolicy.evidence.shadow.session import IN_FLIGHT_PHASE_CHANGE
from genpolicy.evidence.shadow.shadow import HELD_OUT, TWO_MODES, case_of, shadow_policy
from genpolicy.execution.journal import write_journal
from genpolicy.feasibility.checks import CHECKS
from genpolicy.feasibility.settings import LAYERS
from genpolicy.verification.checker import check_journal


class Demonstrator:
    """Answers with what the operator did, a NaN, and what the operator did again."""

    method, checkpoint_hash, sampler_config_hash, stochastic = "operator", "w" * 64, "s" * 64, True
    prediction_horizon = 16

    def __init__(self, observations):
        self.chunks = {(o.episode_uuid, o.index): o.demonstrated for o in observations}

    def sample(self, seen, *, noise_names, candidates):
        assert len(seen) == len(noise_names)
        good = np.stack([self.chunks[name[1:]] for name in noise_names])
        return SimpleNamespace(
            actions=np.stack([good, np.full_like(good, np.nan), good], axis=1)[:, :candidates],
            nfe=1,
        )


@pytest.fixture(scope="module")
def evidence(shadow, observations):
    return shadow_policy(shadow, Demonstrator(observations), observations, seed=4)


def test_every_candidate_has_its_row_and_its_verdict(evidence, observations):
    rows = [row for row in evidence.candidates if row.fixture == HELD_OUT]
    assert len(rows) == 3 * len(observations)
    for row in rows:
        assert row.seed == 4 and row.method == "operator"
        verdicts = [getattr(row, layer) for layer in LAYERS]
        if row.candidate == 1:
            assert verdicts == [False, *[None] * 5] and row.first_reason == "finite"
            assert row.mode == "none" and row.position_change_m is None
            assert (row.outcome, row.first_row, row.layer_margin) == ("failed", 0, None)
        elif not row.first_reason:
            assert verdicts == [True] * 6
            assert row.outcome == "passed" and row.first_row is None and row.margin_unit
        else:
            assert row.outcome == "failed" and 0 <= row.first_row < 16 and row.margin_unit
    passed = [not row.first_reason for row in rows if row.candidate == 0]
    assert np.mean(passed) >= 0.8


def test_every_corruption_is_refused_and_its_session_executes_nothing(evidence):
    fixtures = {row.fixture for row in evidence.candidates}
    assert fixtures >= {c.name for c in CORRUPTIONS}
    for row in evidence.candidates:
        if row.fixture != HELD_OUT:
            assert row.first_reason, row.fixture
    for corruption in CORRUPTIONS:
        key = ("operator", corruption.name)
        assert evidence.stub[(*key, "delivered")] == evidence.stub[(*key, "arrivals")] == 0


def test_a_row_names_the_action_that_offends_and_the_unit_of_its_margin(evidence):
    """The NaN is in the first row, a damaged pose where the corruption puts it, ages are in s."""
    found = {(row.fixture, row.first_reason): row for row in evidence.candidates}
    units = {check.name: check.unit for check in CHECKS}
    for (_, reason), row in found.items():
        assert not reason or row.margin_unit == units[reason]
    assert found["stale_observation", "stale_observation"].margin_unit == "s"
    assert found["stale_observation", "stale_observation"].first_row in (0, 1)  # the first not late
    rejected = [row for row in evidence.candidates if row.first_reason]
    assert len({row.first_row for row in rejected}) > 3
    shapeless = {row.first_reason for row in rejected if row.first_row is None}
    assert shapeless <= {"shape"}


def test_the_stub_sees_good_actions_only(evidence, kit):
    delivered = evidence.stub["operator", HELD_OUT, "delivered"]
    arrivals = evidence.stub["operator", HELD_OUT, "arrivals"]
    # One of eight rows is late, and the last one is too old when its time comes.
    assert arrivals == delivered * (kit.HORIZONS.execution_horizon - 2) > 0
    for (_, _, name), count in evidence.stub.items():
        assert count == 0 or name in ("arrivals", "delivered")
    changed = evidence.stub["operator", IN_FLIGHT_PHASE_CHANGE, "arrivals"]
    assert 0 < changed < arrivals


def test_nothing_is_lost_and_the_reason_is_its_own(evidence, tmp_path):
    reasons = Counter()
    for (_, fixture), accounts in evidence.accounts.items():
        for account in accounts:
            assert account.queued == 0
            assert account.generated == account.executed + sum(account.discarded.values())
            reasons += Counter({(fixture, str(k)): n for k, n in account.discarded.items()})
    path = tmp_path / "journal.mcap"
    write_journal(path, evidence.sessions)
    report = check_journal(path)
    assert report.violations == [] and report.checked_actions > 0
    expected = {
        "reordered_chunk": "superseded", "stale_observation": "stale_observation",
        "phase_change": "phase_transition", "expired": "expired", "earlier_session": "reset",
        "calibration_change": "calibration_mismatch", "not_a_number": "infeasible",
    }  # fmt: skip
    for fixture, reason in expected.items():
        assert reasons[fixture, reason] > 0, fixture
    assert reasons[HELD_OUT, "superseded"] > 0


def test_situations_with_modes_are_judged_neither_corrupted_nor_executed(shadow, observations):
    few, more = observations[:1], observations[1:4]
    found = shadow_policy(shadow, Demonstrator(observations), few, seed=0, two_mode=more)
    rows = [row for row in found.candidates if row.fixture == TWO_MODES]
    assert len(rows) == 3 * len(more) and {row.observation for row in rows} == {1, 2, 3}
    assert [row.situation for row in rows[::3]] == [f"{o.episode_uuid}:{o.index}" for o in more]
    alone = shadow_policy(shadow, Demonstrator(observations), few, seed=0)
    rest = [row for row in found.candidates if row.fixture != TWO_MODES]
    assert repr(rest) == repr(alone.candidates)
    assert found.stub == alone.stub
    told = {session.session: session for session in found.sessions}
    noted = [name for name in told if f"/{TWO_MODES}/" in name]
    assert len(noted) == len(more) and len(told) == len(alone.sessions) + len(more)
    for name in noted:
        kinds = [event.kind for event in told[name].events()]
        assert kinds.count("candidate") == 3 and kinds[-1] == "end"
        assert not {"enqueue", "accept", "invocation"} & set(kinds)


def test_a_policy_that_answers_not_a_number_leaves_evidence(shadow, observations):
    def sample(seen, *, noise_names, candidates):
        return SimpleNamespace(actions=np.full((len(seen), candidates, 16, 10), np.nan), nfe=1)

    policy = SimpleNamespace(
        method="broken", checkpoint_hash="w", sampler_config_hash="s", sample=sample
    )
    found = shadow_policy(shadow, policy, observations[:2], seed=0)
    built = {item.name for item in CORRUPTIONS if item.built}
    assert {r.first_reason for r in found.candidates if r.fixture not in built} == {"finite"}
    assert set(found.stub.values()) == {0}


def test_a_trained_policy_goes_the_same_way(shadow, observations, policy):
    found = shadow_policy(shadow, policy, observations[:3], seed=0)
    assert {row.method for row in found.candidates} == {"flow"}
    for (_, _, name), count in found.stub.items():
        assert count == 0 or name in ("arrivals", "delivered")


def test_all_rows_that_are_not_late_are_judged(shadow, observations):
    """Decision 16: also behind the execution horizon, where nothing of the chunk is executed."""
    item = next(o for o in observations if o.phase == "approach")
    bad = np.array(item.demonstrated)
    bad[-1, 0] += 0.5
    case = case_of(shadow, item, bad, number=0)
    assert case.context.rows(16) == slice(1, 16)
    good = case_of(shadow, item, item.demonstrated, number=0)
    admitted, refused = (
        shadow.checker.admit(c.proposal, context=c.context).verdict.passed for c in (good, case)
    )
    assert admitted and not refused
