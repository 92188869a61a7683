"""`genpolicy replay`: what it prints, and every mistake in one sentence with exit code 2."""

import os
import sys
from pathlib import Path

import pytest

from genpolicy.cli.main import main
from genpolicy.data.recording.writer import write_episode
from genpolicy.execution.journal import JOURNAL_VERSION, Journal, write_journal

sys.path.insert(0, str(Path(__file__).parents[1] / "data"))
import factory

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
    assert out.is_file() and f"layout    {out.with_name('r.layout.json')}" in lines


def test_what_is_there_stays_unless_it_may_be_replaced(journal, capsys):
    out = journal.with_name("r.mcap")
    out.write_bytes(b"mine")
    line = refused(capsys, run(journal, "--out", out, *TASK))
    assert "there already" in line and "--force" in line and out.read_bytes() == b"mine"
    assert run(journal, "--out", out, *TASK, "--force") == 0
    assert out.read_bytes() != b"mine"


def test_a_layout_of_ones_own_stays_too(journal, capsys):
    own = journal.with_name("r.layout.json")
    own.write_bytes(b"mine")
    line = refused(capsys, run(journal, "--out", journal.with_name("r.mcap"), *TASK))
    assert f"{own} is there already" in line and own.read_bytes() == b"mine"
    assert not journal.with_name("r.mcap").exists()


@pytest.mark.parametrize("link", [None, os.link, os.symlink])
def test_the_journal_is_never_replaced(journal, capsys, link):
    out = journal
    if link is not None:
        out = journal.with_name("link.mcap")
        link(journal, out)
    before = journal.read_bytes()
    assert "the file that is read" in refused(capsys, run(journal, "--out", out, *TASK, "--force"))
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


def test_a_recording_is_written_for_a_viewer_and_never_over_itself(tmp_path, capsys):
    recording, out = tmp_path / "e.mcap", tmp_path / "v.mcap"
    write_episode(recording, factory.episode(1))
    words = ["export", "recording", str(recording), "--out"]
    assert main([*words, str(out)]) == 0
    said = capsys.readouterr().out
    assert said.startswith(f"recording {out}\n") and "topic     /robot/tcp (" in said
    assert main([*words, str(out)]) == 2 and "there already" in capsys.readouterr().err
    assert main([*words, str(recording), "--force"]) == 2
    assert "the file that is read" in capsys.readouterr().err
    assert main(["export", "recording", str(tmp_path / "none"), "--out", str(out), "--force"]) == 2
    assert "none is not readable" in capsys.readouterr().err
