"""Serving the ladder: without a server it says what to do, with one it serves one run at a time."""

import pytest

from flows import serve
from flows.reproduce import EXIT_FAULT


@pytest.fixture
def served(monkeypatch):
    calls = []
    monkeypatch.setattr(serve, "serve", lambda *which, limit: calls.append((which, limit)))
    return calls


@pytest.mark.parametrize(("url", "said"), [("", "not set"), ("http://nowhere/api", "nowhere")])
def test_without_a_server_it_says_how_and_serves_nothing(
    served, monkeypatch, capsys, tmp_path, url, said
):
    monkeypatch.setattr(serve, "server_url", lambda: url)
    monkeypatch.setattr(serve, "server_answers", lambda url: False)
    assert serve.serve_ladder("nightly", workspace=tmp_path, cron=None) == EXIT_FAULT
    error = capsys.readouterr().err
    assert said in error and "prefect server start" in error and served == []


def test_one_run_at_a_time_in_a_workspace_that_does_not_depend_on_where_it_was_started(
    served, monkeypatch, tmp_path
):
    monkeypatch.setattr(serve, "server_url", lambda: "http://here/api")
    monkeypatch.setattr(serve, "server_answers", lambda url: True)
    monkeypatch.chdir(tmp_path)
    inside = type(tmp_path)("inside")
    assert serve.serve_ladder("nightly", workspace=inside, cron="0 3 * * *") == 0
    (((ladder, gate_e), limit),) = served
    assert ladder.parameters == {"workspace": str(tmp_path / "inside")}
    assert (ladder.name, ladder.schedules[0].schedule.cron, limit) == ("nightly", "0 3 * * *", 1)
    assert (gate_e.flow_name, gate_e.name, gate_e.schedules) == ("gate-e", "nightly", [])
    assert ladder.flow_name == "ladder"
    assert [one.entrypoint.rpartition("/")[2] for one in (ladder, gate_e)] == [
        "ladder.py:ladder",
        "card_gate.py:gate_e",
    ], "whoever runs it loads it from there"
