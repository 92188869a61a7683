"""A server that changes without its files is seen by what it answers before and after."""

from contextlib import ExitStack

import pytest

from genpolicy.candidates.brought import BroughtPolicy
from genpolicy.candidates.wire.policy import WirePolicy
from genpolicy.candidates.wire.remote import RemotePolicy
from genpolicy.candidates.wire.served import ServedPolicy
from genpolicy.contract.chunk import actions_sha256
from genpolicy.evidence.fixtures_again import (
    FIXTURES,
    asked_again,
    brought_fixtures,
    fixture_name,
)
from genpolicy.evidence.rows.brought import AFTER, BEFORE
from genpolicy.policies.fixtures import CANDIDATES
from tests.candidates.conftest import entry_of, serving  # noqa: F401


class ChangesAfter(ServedPolicy):
    """Other weights after so many questions; its files and metadata stay."""

    most = FIXTURES + 5
    asked = 0

    def answer(self, message):
        self.asked += 1
        answer = super().answer(message)
        if self.asked > self.most:
            answer["actions"] = answer["actions"] + 1e-9
        return answer


@pytest.fixture
def wire(serving, entry_of, task, tmp_path):  # noqa: F811
    """A brought policy behind a server of this answer."""

    def start(served):
        address = stack.enter_context(serving(served.answer, served.metadata))
        entry = entry_of(address=address)
        brought = BroughtPolicy("planted", tmp_path / "planted.yaml", entry, "c" * 64, 0)
        remote = RemotePolicy(entry, address, task.observation)
        stack.callback(remote.close)
        return WirePolicy(brought, remote)

    with ExitStack() as stack:
        yield start


def digests(policy, fixtures, when):
    rows = asked_again(policy, fixtures, condition="shadow", when=when)
    assert {(row.method, row.condition, row.when) for row in rows} == {("planted", "shadow", when)}
    assert [row.row for row in rows] == list(range(FIXTURES))
    return [row.sha256 for row in rows]


def test_the_same_weights_give_the_bits_of_gate_b(wire, policy, data, kit):
    served = wire(ServedPolicy(policy))
    fixtures = brought_fixtures(data, kit.HORIZONS)
    at_gate_b = []
    for row in reversed(range(FIXTURES)):
        drawn = served.sample(
            fixtures[row][None], noise_names=[fixture_name(row)], candidates=CANDIDATES
        )
        at_gate_b.insert(0, actions_sha256(drawn.actions[0]))
    assert digests(served, fixtures, BEFORE) == digests(served, fixtures, AFTER) == at_gate_b


def test_what_changes_after_many_questions_shows_behind_them(wire, policy, data, kit):
    served = wire(ChangesAfter(policy))
    fixtures = brought_fixtures(data, kit.HORIZONS)
    before = digests(served, fixtures, BEFORE)
    for row in range(10):
        served.sample(fixtures[:1], noise_names=[("shadow", row)], candidates=2)
    after = digests(served, fixtures, AFTER)
    assert not set(before) & set(after)


def test_no_answer_is_said_and_is_no_hash(wire, policy, data, kit):
    class Silent(ServedPolicy):
        def answer(self, message):
            raise MemoryError

    rows = asked_again(
        wire(Silent(policy)), brought_fixtures(data, kit.HORIZONS), condition="x", when=BEFORE
    )
    assert {(row.answered, row.sha256) for row in rows} == {(False, "")}


def test_nobody_who_runs_here_is_asked(policy, data, kit):
    fixtures = brought_fixtures(data, kit.HORIZONS)
    assert asked_again(policy, fixtures, condition="shadow", when=BEFORE) == []
