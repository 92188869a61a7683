"""After a signature: where a run may wait for a card that passes it goes on, and only there."""

import subprocess
import sys
from types import SimpleNamespace

import pytest

from gates.card import resuming
from gates.card.resuming import ADDRESS, HOME, go_on
from genpolicy.errors import ConfigError


@pytest.fixture
def asked(monkeypatch):
    """The verdict that gate E has, and what was run with which exit code."""
    state = SimpleNamespace(verdict="PASS", code=0, ran=[])

    def run(command, **options):
        state.ran.append(command)
        if state.code is None:
            raise OSError("no such program")
        return SimpleNamespace(returncode=state.code)

    monkeypatch.delenv(ADDRESS, raising=False)
    monkeypatch.setattr(resuming, "judge", lambda root, gate: state)
    monkeypatch.setattr(subprocess, "run", run)
    return state


@pytest.fixture
def workspace(tmp_path):
    (tmp_path / HOME).mkdir()
    return tmp_path


def test_a_card_that_passes_resumes_the_run_that_waits(asked, workspace, capsys):
    go_on(workspace)
    words = ["-m", "genpolicy", "resume", "--if-waiting", "--workspace", str(workspace)]
    assert asked.ran == [[sys.executable, *words]]
    assert "The card is complete." in capsys.readouterr().out


@pytest.mark.parametrize("verdict", ["PENDING_REVIEW", "FAIL", "INCONCLUSIVE"])
def test_a_card_that_does_not_pass_resumes_nothing(asked, workspace, verdict, capsys):
    asked.verdict = verdict
    go_on(workspace)
    assert asked.ran == [] and capsys.readouterr().out == ""


def test_where_no_run_can_wait_nothing_is_judged_or_run(asked, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(resuming, "judge", None)
    go_on(tmp_path)
    assert asked.ran == [] and capsys.readouterr().out == ""


def test_a_server_that_is_named_is_asked(asked, tmp_path, monkeypatch):
    monkeypatch.setenv(ADDRESS, "http://127.0.0.1:1/api")
    go_on(tmp_path)
    assert len(asked.ran) == 1


@pytest.mark.parametrize("code", [1, 3, None])
def test_whatever_comes_of_it_the_signature_stands(asked, workspace, code, capsys):
    asked.code = code
    go_on(workspace)
    assert "The signature stands; try: genpolicy resume" in capsys.readouterr().out


def test_a_gate_that_cannot_be_judged_costs_no_signature(asked, workspace, monkeypatch, capsys):
    def judge(root, gate):
        raise ConfigError(where="params.yaml: gate_e", found="x", expected="y", action="Z.")

    monkeypatch.setattr(resuming, "judge", judge)
    go_on(workspace)
    said = capsys.readouterr().out
    assert asked.ran == [] and "The signature stands" in said and "params.yaml: gate_e" in said
