"""`genpolicy replay`: what it prints, and every mistake in one sentence with exit code 2."""

import os

import pytest

from genpolicy.cli.main import main
from genpolicy.execution.journal import JOURNAL_VERSION, Journal, write_journal

TASK = ("--task", "tabletop_insertion")


@pytest.fixture
def journal(tmp_path):
    found = Journal("only")
    found.add("session", 0, {"version": JOURNAL_VERSION, "labels": {"method": "flow"}})
    found.add("hold", 50_000_000, {"reason": "empty"})
    write_journal(tmp_path / "journal.mcap", [found])
    return tmp_path / "journal.mcap"


def run(*words):
    return main(["replay", *map(str, words)])


def refused(capsys, code):
    said = capsys.readouterr()
    assert (code, said.out) == (2, "")
    [line] = said.err.splitlines()
    assert line.startswith("genpolicy replay: ")
    return line


def test_it_says_what_it_wrote(journal, capsys):
    out = journal.with_name("r.mcap")
    assert run(journal, "--out", out, *TASK) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[:3] == [f"replay    {out}", "session   only",
                         "journal   2 messages, byte for byte"]  # fmt: skip
    assert "added     /replay/log (2)" in lines and "added     /replay/scene (1)" in lines
    assert out.is_file()


def test_what_is_there_stays_unless_it_may_be_replaced(journal, capsys):
    out = journal.with_name("r.mcap")
    out.write_bytes(b"mine")
    line = refused(capsys, run(journal, "--out", out, *TASK))
    assert "there already" in line and "--force" in line and out.read_bytes() == b"mine"
    assert run(journal, "--out", out, *TASK, "--force") == 0
    assert out.read_bytes() != b"mine"


@pytest.mark.parametrize("link", [None, os.link, os.symlink])
def test_the_journal_is_never_replaced(journal, capsys, link):
    out = journal
    if link is not None:
        out = journal.with_name("link.mcap")
        link(journal, out)
    before = journal.read_bytes()
    assert "the journal itself" in refused(capsys, run(journal, "--out", out, *TASK, "--force"))
    assert journal.read_bytes() == before


def test_a_folder_is_no_place(journal, capsys):
    line = refused(capsys, run(journal, "--out", journal.parent, *TASK, "--force"))
    assert "a folder, expected a new file" in line


@pytest.mark.parametrize("text", [b"", b"no journal", b"\x89MCAP0\r\n"])
def test_what_is_no_journal_is_refused(tmp_path, capsys, text):
    (tmp_path / "x.mcap").write_bytes(text)
    line = refused(capsys, run(tmp_path / "x.mcap", "--out", tmp_path / "r.mcap", *TASK))
    assert "no journal" in line and "a whole MCAP journal" in line
    assert [path.name for path in tmp_path.iterdir()] == ["x.mcap"]


def test_a_journal_that_is_not_there_is_refused(tmp_path, capsys):
    line = refused(capsys, run(tmp_path / "x.mcap", "--out", tmp_path / "r.mcap"))
    assert "x.mcap is not readable" in line


def test_a_place_where_nothing_can_be_written_is_refused(journal, capsys):
    journal.with_name("file").write_text("")
    for place in ("file/r.mcap", f"{'x' * 300}.mcap"):
        refused(capsys, run(journal, "--out", journal.parent / place, *TASK))
