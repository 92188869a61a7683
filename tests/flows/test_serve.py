"""Serving the ladder: without a server it says what to do, with one it serves one run at a time."""

from types import SimpleNamespace

import pytest

from flows import serve
from flows.reproduce import EXIT_FAULT


@pytest.fixture
def served(monkeypatch):
    calls = []
    monkeypatch.setattr(serve, "ladder", SimpleNamespace(serve=lambda **how: calls.append(how)))
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
    (how,) = served
    assert how["parameters"] == {"workspace": str(tmp_path / "inside")}
    assert (how["name"], how["cron"], how["limit"]) == ("nightly", "0 3 * * *", 1)
