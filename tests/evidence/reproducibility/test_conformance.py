"""Planted policies as evidence of Gate B: what fails is named, and follows from what is written."""

from dataclasses import replace

import numpy as np
import pytest

from genpolicy.candidates.brought import BroughtPolicy
from genpolicy.candidates.conformance.finding import OF_ANSWERS
from genpolicy.candidates.wire.policy import WirePolicy
from genpolicy.candidates.wire.remote import RemotePolicy
from genpolicy.evidence.documents.conformance import CONFORMANCE
from genpolicy.evidence.reproducibility.conformance import (
    answer_rows,
    conformance_of,
    drawn,
    findings_again,
    first_session,
    second_session,
)
from genpolicy.evidence.rows.brought import AGAIN, ANEW, FIRST, AnswerRow
from genpolicy.integrity.rows import read_rows, write_rows
from tests.candidates.conformance import test_check as planted
from tests.candidates.conftest import entry_of, serving, starts  # noqa: F401

WRONGS = [
    (planted.GlobalSeed, {"repeats", "restarts", "seeded"}),
    (planted.OtherWeights, {"restarts"}),
    (planted.OtherName, {"answers", "repeats", "restarts", "seeded"}),
    (planted.RecordedFuture, {"own_answers"}),
    (planted.IgnoresObservation, {"follows_observation", "scale", "orientation"}),
    (planted.Spread, {"scale"}),
    (planted.Mirrored, {"scale"}),
    (planted.Millimetres, {"scale"}),
    (planted.OtherOrigin, {"origin"}),
    (planted.Turned, {"orientation"}),
    (planted.CountsAnew, {"evaluations"}),
    (planted.NotANumber, {"answers"}),
    (planted.Fails, {"answers"}),
]


@pytest.fixture
def evidence_of(serving, entry_of, starts, task, tmp_path):  # noqa: F811
    """Document and rows of a planted server that is started twice."""

    def ask(server, *, anew=True, **fields):
        with serving(server, server.metadata) as address:
            entry = entry_of(address=address, **fields)
            brought = BroughtPolicy("planted", tmp_path / "planted.yaml", entry, "c" * 64, 0)

            def policy():
                remote = RemotePolicy(entry, address, task.observation, clock=server.clock)
                return WirePolicy(brought, remote, clock=server.clock)

            before, after = policy(), policy()
            session = first_session(before, starts)
            again = second_session(after, starts, session) if anew else None
            number = drawn(stochastic=entry.stochastic)
            found = conformance_of(starts, before.told, session, again, candidates=number)
            before.remote.close()
            after.remote.close()
        return found, answer_rows("planted", starts, session, again)

    return ask


def failed(found):
    return {one.name for one in found.findings if one.judged == "fails"}


def test_an_honest_one_holds_in_all_that_gate_b_asks(evidence_of, starts):  # noqa: F811
    found, rows = evidence_of(planted.Honest(starts))
    assert [one.name for one in found.findings] == list(OF_ANSWERS)
    assert {one.judged for one in found.findings} == {"holds"}
    assert {one.gate for one in found.findings} == {"B"}
    assert [sum(row.session == name for row in rows) for name in (FIRST, AGAIN, ANEW)] == [
        40, 20, 20,
    ]  # fmt: skip
    assert {(row.candidates, len(row.actions)) for row in rows} == {(4, 4 * 16 * 10)}


@pytest.mark.parametrize(("wrong", "fails"), WRONGS)
def test_a_planted_wrong_fails_by_name(evidence_of, starts, wrong, fails):  # noqa: F811
    found, _ = evidence_of(wrong(starts))
    assert failed(found) == fails


@pytest.mark.parametrize("server", [planted.Honest, *[wrong for wrong, _ in WRONGS]])
def test_findings_follow_from_what_is_written(evidence_of, starts, server, tmp_path):  # noqa: F811
    found, rows = evidence_of(server(starts))
    write_rows(tmp_path / "answers.parquet", AnswerRow, rows)
    CONFORMANCE.write(tmp_path, {"planted": found})
    read = read_rows(tmp_path / "answers.parquet", AnswerRow)
    stated = CONFORMANCE.read(tmp_path)["planted"]
    assert list(findings_again(read, starts, stated)) == found.findings == stated.findings


def test_a_slow_server_is_no_matter_of_these_findings(evidence_of, starts):  # noqa: F811
    found, _ = evidence_of(planted.Flatters(starts))
    assert failed(found) == set()


def test_one_that_always_draws_the_same_is_asked_for_one(evidence_of, starts):  # noqa: F811
    found, rows = evidence_of(planted.Honest(starts), stochastic=False)
    assert found.candidates == 1
    assert {row.candidates for row in rows} == {1}


def test_what_is_not_started_here_is_not_known_to_start_anew(evidence_of, starts):  # noqa: F811
    found, rows = evidence_of(planted.Honest(starts), anew=False)
    (restarts,) = [one for one in found.findings if one.name == "restarts"]
    assert restarts.judged == "unknown"
    assert ANEW not in {row.session for row in rows}


class Dead(planted.Honest):
    def __call__(self, message):
        self.asked += 1
        raise MemoryError


def test_a_dead_server_is_asked_no_more_and_each_moment_has_its_row(
    evidence_of, starts,  # noqa: F811
):  # fmt: skip
    dead = Dead(starts)
    found, rows = evidence_of(dead)
    assert dead.asked == 8
    assert failed(found) == {"answers"}
    assert [row.fault for row in rows if row.session == FIRST] == ["refused"] * 8 + ["gone"] * 32


def test_another_number_gives_another_finding(evidence_of, starts):  # noqa: F811
    found, rows = evidence_of(planted.Honest(starts))
    forged = [
        replace(row, actions=tuple((np.array(row.actions) * 1e3).tolist()))
        if row.session == FIRST
        else row
        for row in rows
    ]
    again = findings_again(forged, starts, found)
    assert {"scale", "repeats"} <= {one.name for one in again if one.judged == "fails"}
