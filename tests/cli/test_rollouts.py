"""`genpolicy export rollout`: each form, and every mistake in one sentence with exit code 2."""

import sys

import pytest
from PIL import Image

from genpolicy.cli.main import main
from genpolicy.documents.task import IDENTITY
from genpolicy.execution.journal import JOURNAL_VERSION, Journal, write_journal
from genpolicy.integrity.atomic import write_bytes
from genpolicy.integrity.documents import canonical_json
from genpolicy.tasks.identity import task_identity

ROLLOUT = "flow/push/0"


@pytest.fixture
def workspace(tmp_path):
    """What a ladder leaves of one condition: two rollouts, which held for a second."""
    found = []
    for start in (0, 1):
        journal = Journal(f"flow/push/{start}")
        journal.add("session", 0, {"version": JOURNAL_VERSION, "labels": {"method": "flow"}})
        journal.add("hold", 1_000_000_000, {"reason": "empty"})
        journal.add("outcome", 1_000_000_000, {"outcome": "timed_out", "mode": ""})
        found.append(journal)
    write_journal(tmp_path / "artifacts/stress/journals/flow__push.mcap", found)
    identity = canonical_json(task_identity("tabletop_insertion"))
    write_bytes(tmp_path / "artifacts/task" / IDENTITY.file, identity)
    return tmp_path


def run(workspace, *words):
    return main(["export", "rollout", *map(str, words), "--root", str(workspace)])


def refused(capsys, code):
    said = capsys.readouterr()
    assert (code, said.out) == (2, "")
    [line] = said.err.splitlines()
    return line


def test_a_gif(workspace, capsys):
    out = workspace / "push.gif"
    assert run(workspace, ROLLOUT, "--to", "gif", "--out", out) == 0
    assert capsys.readouterr().out.splitlines()[1] == f"session   {ROLLOUT}"
    assert Image.open(out).n_frames in (1, 11)  # pictures that are alike may become one


def test_the_form_for_foxglove_is_that_of_a_replay(workspace, capsys):
    """Property: one implementation, two fronts, the same bytes."""
    journal = workspace / "artifacts/stress/journals/flow__push.mcap"
    assert run(workspace, ROLLOUT, "--to", "foxglove", "--out", workspace / "a.mcap") == 0
    words = ["replay", str(journal), "--session", ROLLOUT, "--out", str(workspace / "b.mcap")]
    assert main(words) == 0
    for name in ("mcap", "layout.json"):
        assert (workspace / f"a.{name}").read_bytes() == (workspace / f"b.{name}").read_bytes()


def test_without_rerun_it_says_what_to_install(workspace, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "rerun", None)
    code = run(workspace, ROLLOUT, "--to", "rerun", "--out", workspace / "x.rrd")
    assert "pip install 'genpolicy[rerun]'" in refused(capsys, code)


@pytest.mark.parametrize(
    "name", ["flow", "flow/push", "flow/push/0/1", "../push/0", "flow/../0", "/a/b", ""]
)
def test_what_names_no_rollout_is_refused(workspace, capsys, name):
    line = refused(capsys, run(workspace, name, "--to", "gif", "--out", workspace / "x.gif"))
    assert "METHOD/CONDITION/START" in line and not (workspace / "x.gif").exists()


def test_a_journal_that_is_not_there_is_refused_with_those_that_are(workspace, tmp_path, capsys):
    line = refused(capsys, run(workspace, "act/push/0", "--to", "gif", "--out", workspace / "x"))
    assert "act__push.mcap is missing" in line and "flow/push" in line
    line = refused(capsys, run(tmp_path / "none", ROLLOUT, "--to", "gif", "--out", workspace / "x"))
    assert "there is none" in line and "make ladder" in line


def test_what_a_search_found_is_taken_from_where_it_lies(workspace, capsys):
    journal = Journal("flow/push@search/0")
    journal.add("session", 0, {"version": JOURNAL_VERSION, "labels": {"method": "flow"}})
    journal.add("hold", 1_000_000_000, {"reason": "empty"})
    journal.add("outcome", 1_000_000_000, {"outcome": "timed_out", "mode": ""})
    place = "artifacts/failure_search/journals/flow__push@search.mcap"
    write_journal(workspace / place, [journal])
    out = workspace / "x.mcap"
    assert run(workspace, "flow/push@search/0", "--to", "foxglove", "--out", out) == 0
    capsys.readouterr()
    line = refused(capsys, run(workspace, "act/push@search/0", "--to", "gif", "--out", out))
    assert "act__push@search.mcap is missing" in line and "flow/push@search" in line


def test_a_start_that_was_not_run_is_refused_with_those_that_were(workspace, capsys):
    line = refused(capsys, run(workspace, "flow/push/7", "--to", "gif", "--out", workspace / "x"))
    assert "flow/push/0, flow/push/1" in line


def test_what_is_there_stays(workspace, capsys):
    (workspace / "x.gif").write_bytes(b"mine")
    line = refused(capsys, run(workspace, ROLLOUT, "--to", "gif", "--out", workspace / "x.gif"))
    assert "there already" in line and (workspace / "x.gif").read_bytes() == b"mine"
