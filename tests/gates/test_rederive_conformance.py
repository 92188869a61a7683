"""What a brought policy is said to have answered is derived again, and asked again."""

from dataclasses import replace

import pytest
import yaml

from gates.rederive_conformance import ANSWERS, DOCUMENT, rederive_conformance
from genpolicy.candidates.brought import read_brought
from genpolicy.candidates.conformance.recorded_starts import recorded_starts
from genpolicy.candidates.wire.policy import running
from genpolicy.candidates.wire.served import ServedPolicy
from genpolicy.data.dataset import load_dataset
from genpolicy.errors import RefusedError
from genpolicy.evidence.documents.conformance import CONFORMANCE
from genpolicy.evidence.reproducibility.conformance import (
    answer_rows,
    conformance_of,
    first_session,
)
from genpolicy.evidence.rows.brought import AGAIN, ANEW, FIRST, AnswerRow
from genpolicy.integrity.rows import read_rows, write_rows
from tests.candidates.conftest import ENTRY, serving  # noqa: F401

SEED = 3
PARAMS = {
    "seed": SEED,
    "task": {"name": "tabletop_insertion"},
    "candidates": {"planted": "planted.yaml"},
    "horizons": ENTRY["horizons"],
    "policy": {"seeds": [0]},
}


class Served(ServedPolicy):
    """Honest, until it is told to be another one."""

    off = 0.0

    def answer(self, message):
        answer = super().answer(message)
        return {**answer, "actions": answer["actions"] + self.off}


@pytest.fixture
def server(policy):
    return Served(policy)


@pytest.fixture
def workspace(server, serving, dataset, tmp_path):  # noqa: F811
    """Evidence of one that was brought, and its server, which still runs."""
    (tmp_path / "artifacts").mkdir()
    (tmp_path / "artifacts/ingest").symlink_to(dataset)
    folder = tmp_path / "artifacts/reload"
    folder.mkdir()
    with serving(server.answer, server.metadata) as address:
        (tmp_path / "planted.yaml").write_text(yaml.safe_dump({**ENTRY, "address": address}))
        data = load_dataset(tmp_path / "artifacts/ingest")
        (brought,) = read_brought(PARAMS["candidates"], seed=0, root=tmp_path)
        starts = recorded_starts(data, brought.entry.horizons, seed=SEED)
        with running(brought, data.observation_contract) as wire:
            session, told = first_session(wire, starts), wire.told
        found = conformance_of(starts, told, session, None, candidates=4)
        rows = answer_rows("planted", starts, session, None)
        CONFORMANCE.write(folder, {"planted": found})
        write_rows(folder / "answers.parquet", AnswerRow, rows)
        yield tmp_path


def rewrite(root, change):
    """Edit every row; None leaves it out."""
    path = root / ANSWERS
    rows = [new for row in read_rows(path, AnswerRow) if (new := change(row)) is not None]
    write_rows(path, AnswerRow, rows)


def judged(root, name, how):
    """A finding that says something else."""
    found = CONFORMANCE.read(root / "artifacts/reload")
    findings = [
        replace(one, judged=how) if one.name == name else one for one in found["planted"].findings
    ]
    CONFORMANCE.write(
        root / "artifacts/reload", {"planted": replace(found["planted"], findings=findings)}
    )


def refused(root, match, params=PARAMS):
    with pytest.raises(RefusedError, match=match):
        rederive_conformance(root, params)


def test_what_was_answered_is_answered_again(workspace):
    rederive_conformance(workspace, PARAMS)


def test_another_policy_now_is_refused(workspace, server):
    server.off = 2e-5
    refused(workspace, "another answer than it gives now")


def test_what_another_processor_rounds_is_no_other_answer(workspace, server):
    server.off = 1e-7
    rederive_conformance(workspace, PARAMS)


@pytest.mark.parametrize(("name", "how"), [("scale", "holds"), ("restarts", "holds")])
def test_a_finding_that_does_not_follow_is_refused(workspace, name, how):
    judged(workspace, name, how)
    refused(workspace, rf"planted: {name}")


def test_a_finding_that_is_left_out_is_refused(workspace):
    found = CONFORMANCE.read(workspace / "artifacts/reload")["planted"]
    CONFORMANCE.write(
        workspace / "artifacts/reload", {"planted": replace(found, findings=found.findings[:-1])}
    )
    refused(workspace, "own_answers")


def test_answers_that_were_made_up_are_refused(workspace):
    """All of them, again and anew alike, so that the findings still follow."""
    rewrite(workspace, lambda row: replace(row, actions=tuple(x + 1e-3 for x in row.actions)))
    refused(workspace, "another answer than it gives now")


@pytest.mark.parametrize("further", [False, True])
def test_made_up_answers_of_either_kind_of_moment_are_refused(workspace, further):
    """The findings stand on the first moments, which are a fifth of all: each kind is sampled."""
    apart = CONFORMANCE.read(workspace / "artifacts/reload")["planted"].episodes

    def off(row):
        hit = (row.moment >= apart) == further
        return replace(row, actions=tuple(x + 1e-3 for x in row.actions)) if hit else row

    rewrite(workspace, off)
    refused(workspace, "another answer than it gives now")


@pytest.mark.parametrize("session", [FIRST, AGAIN])
def test_a_moment_that_is_left_out_is_refused(workspace, session):
    rewrite(workspace, lambda row: None if (row.session, row.moment) == (session, 0) else row)
    refused(workspace, rf"planted, {session}")


def test_a_new_start_of_what_was_not_started_here_is_refused(workspace):
    written = read_rows(workspace / ANSWERS, AnswerRow)
    anew = [replace(row, session=ANEW) for row in written if row.session == AGAIN]
    write_rows(workspace / ANSWERS, AnswerRow, [*written, *anew])
    refused(workspace, "planted, anew")


def test_a_moment_of_another_episode_is_refused(workspace):
    rewrite(workspace, lambda row: replace(row, episode_uuid="elsewhere"))
    refused(workspace, "a moment of its own")


@pytest.mark.parametrize("beyond", [-1, 1])
def test_a_moment_that_the_seed_does_not_draw_is_refused(workspace, beyond):
    """One before the first, and one behind the last: neither is read from the other end."""
    moments = {row.moment for row in read_rows(workspace / ANSWERS, AnswerRow)}
    last, other = max(moments), -1 if beyond < 0 else max(moments) + 1
    rewrite(workspace, lambda row: replace(row, moment=other) if row.moment == last else row)
    refused(workspace, "a moment of its own")


@pytest.mark.parametrize(("changes", "said"), [
    ({"moments": 1}, "4 chunks at 1 moments"), ({"candidates": 3}, "3 chunks at"),
    ({"observations_sha256": "0" * 64}, "asked about other moments"),
    ({"seeded": False}, "planted: seeded is B holds"),
])  # fmt: skip
def test_each_thing_that_is_said_of_the_asking_is_held_by_itself(workspace, changes, said):
    found = CONFORMANCE.read(workspace / "artifacts/reload")["planted"]
    assert {name: getattr(found, name) for name in changes} != changes
    CONFORMANCE.write(workspace / "artifacts/reload", {"planted": replace(found, **changes)})
    refused(workspace, said)


def test_answers_of_a_server_that_nobody_can_ask_are_refused(workspace):
    """Nothing listens where it was: who it was cannot be shown, so its answers are none."""
    path = workspace / "planted.yaml"
    path.write_text(
        yaml.safe_dump({**yaml.safe_load(path.read_text()), "address": "ws://127.0.0.1:9"})
    )
    refused(workspace, r"planted is \d+ answers of a server, required one that starts")


def test_moments_of_another_seed_are_refused(workspace):
    refused(workspace, "other moments|a moment of its own", {**PARAMS, "seed": SEED + 1})


def test_another_number_of_chunks_is_refused(workspace):
    found = CONFORMANCE.read(workspace / "artifacts/reload")["planted"]
    CONFORMANCE.write(workspace / "artifacts/reload", {"planted": replace(found, candidates=1)})
    refused(workspace, "1 chunks at")


def test_another_number_of_episodes_is_refused(workspace):
    found = CONFORMANCE.read(workspace / "artifacts/reload")["planted"]
    changed = replace(found, episodes=found.moments)
    CONFORMANCE.write(workspace / "artifacts/reload", {"planted": changed})
    refused(workspace, "of 15 episodes")


def test_what_its_server_can_is_held_against_it(workspace):
    found = CONFORMANCE.read(workspace / "artifacts/reload")["planted"]
    CONFORMANCE.write(
        workspace / "artifacts/reload", {"planted": replace(found, counts_evaluations=False)}
    )
    refused(workspace, r"planted: evaluations is")
    judged(workspace, "evaluations", "unknown")
    refused(workspace, r"planted is other things that its server can, required \(True, True, \d+\)")


def test_findings_of_somebody_who_was_not_brought_are_refused(workspace):
    refused(workspace, DOCUMENT, {**PARAMS, "candidates": {}})


def test_who_is_said_to_answer_otherwise_is_not_asked_again(workspace, server):
    """It stands in the evidence that it does not repeat itself, and gate B says so."""
    server.off = 1.0
    rewrite(
        workspace,
        lambda row: row if row.session == FIRST else replace(
            row, actions=tuple(x + 1e-3 for x in row.actions)
        ),
    )  # fmt: skip
    for name in ("repeats", "seeded"):
        judged(workspace, name, "fails")
    rederive_conformance(workspace, PARAMS)
