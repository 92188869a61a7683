"""Tables of the comparison, derived from journals of sessions whose counts are known."""

import numpy as np
import pytest

from genpolicy.contract.chunk import DiscardReason
from genpolicy.evidence.shadow.rig import Rig
from genpolicy.execution.journal import write_journal
from genpolicy.verification.rollouts import derived_with_recoveries
from genpolicy.verification.tables import AGE_LEVELS, KEYS, derived_tables


def played(start):
    """A session of policy, fallback-free: two chunks, one of them cut short, and one refusal."""
    rig = Rig(session=f"flow/nominal/{start}")
    rig.journal.events()[0].payload["labels"].update(
        method="flow", perturbation="nominal", start=str(start)
    )
    for number in range(2 + start):
        rig.executor.begin_invocation(rig.now_s, f"i{number}", repr(0.01 * (number + 1)))
        for _ in range(number):  # a candidate was refused, and the next one checked
            rig.journal.invocation(
                rig.now_s, invocation_id=f"i{number}", stage="check", detail="0.5"
            )
        rig.executor.end_invocation(rig.now_s, f"i{number}", "answered")
    rig.run()
    rig.observe()
    rig.deliver(rig.chunk(task_phase="insert"))
    chunk = rig.chunk()
    rig.deliver(chunk)
    rig.tick(3)
    offer = {"source": "policy", "arrival": 2, "now_ns": rig.now_ns}
    assert rig.stub.offer(chunk, chunk.actions[0], row=3, sequence=99, **offer) == "infeasible"
    assert rig.stub.offer(chunk, chunk.actions[0], row=0, sequence=99, **offer) is not None
    rig.end()
    return rig


@pytest.fixture(scope="module")
def sessions():
    return [played(start) for start in (0, 1)]


@pytest.fixture(scope="module")
def tables(sessions, tmp_path_factory):
    path = tmp_path_factory.mktemp("journals") / "flow__nominal.mcap"
    write_journal(path, [rig.journal for rig in sessions])
    return derived_tables([path])


def test_every_table_has_its_keys_once(tables):
    assert set(tables) == set(KEYS)
    for name, keys in KEYS.items():
        found = [tuple(row[key] for key in keys) for row in tables[name]]
        assert len(set(found)) == len(found) > 0
        assert all(row["method"] == "flow" for row in tables[name])


def test_ages_are_order_statistics_of_what_was_accepted(tables, sessions):
    ages = [
        event.payload["age_ns"] / 1e9
        for rig in sessions
        for event in rig.journal.events()
        if event.kind == "accept"
    ]
    expected = [float(np.quantile(ages, level, method="higher")) for level in AGE_LEVELS]
    assert [row["action_age_s"] for row in tables["ages"]] == expected
    assert {row["actions"] for row in tables["ages"]} == {len(ages)} == {22}


def test_the_balance_is_that_of_the_executor(tables, sessions):
    accounts = [rig.executor.conservation().chunks for rig in sessions]
    (row,) = tables["conservation"]
    assert row["generated"] == sum(account.generated for account in accounts) == 6
    assert row["executed"] == sum(account.executed for account in accounts) == 4
    assert row["discarded"] == 2 and row["queued"] == 0
    counted = {row["reason"]: row["count"] for row in tables["counts"]}
    assert counted == {str(DiscardReason.PHASE_TRANSITION): 2}


def test_the_stub_s_arrivals_and_refusals(tables, sessions):
    (row,) = tables["stub"]
    for name in ("arrivals", "stale", "invalid"):
        assert row[name] == sum(getattr(rig.stub, name) for rig in sessions)
    assert (row["stale"], row["invalid"]) == (2, 2)


def test_invocations_are_numbered_in_the_order_in_which_they_began(tables):
    found = [(row["start"], row["invocation"], row["latency_s"]) for row in tables["invocations"]]
    assert found == [(0, 0, 0.01), (0, 1, 0.52), (1, 0, 0.01), (1, 1, 0.52), (1, 2, 1.03)]


def test_a_rollout_s_latency_counts_every_check(sessions, tmp_path):
    write_journal(tmp_path / "journal.mcap", [rig.journal for rig in sessions])
    found = [
        row["latency_p95_s"]
        for row in derived_with_recoveries(tmp_path / "journal.mcap")[0].values()
    ]
    assert found == [0.52, 1.03]


def test_without_a_journal_nothing_follows():
    assert derived_tables([]) == {name: [] for name in KEYS}
