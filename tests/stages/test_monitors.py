"""Stage `monitors`: what cannot be run is refused first, and nothing asked for runs nothing."""

from types import SimpleNamespace

import pytest

from genpolicy.integrity.tables import read_table
from stages import monitors as module

WRONG = {
    "a key": (lambda params: params["monitors"].update(kindz=[]), "monitors.kindz"),
    "a probe": (
        lambda params: params["monitors"]["probes"].update(fog={"severities": [1.0]}),
        "monitors.probes.fog",
    ),
    "a rule": (
        lambda params: params["stress"].update(joining={"rule": "real_time"}),
        "monitors is probes, and stress.joining: real_time",
    ),
    "its old place": (
        lambda params: params["stress"].update(monitors=params["monitors"]),
        "stress.monitors",
    ),
}


@pytest.fixture
def admitted(monkeypatch):
    """Gate C admits one candidate, and its contract is that of the task."""
    monkeypatch.setattr(module, "admit", lambda *_: SimpleNamespace(candidates=("flow",)))
    monkeypatch.setattr(module, "require_one_contract", lambda *_, **__: None)


@pytest.mark.parametrize("name", WRONG)
def test_what_cannot_be_run_ends_the_stage_before_a_rollout(workspace, edit, stage, admitted, name):
    """Nothing lies here that rollouts read: it would be missed if it were asked for."""
    change, place = WRONG[name]
    edit(workspace, change)
    code, said = stage("monitors")
    assert (code, f"params.yaml: {place}" in said) == (2, True), said
    assert not (workspace / "artifacts" / "monitors").exists()


def test_without_probes_there_are_tables_without_rows(workspace, edit, stage, admitted):
    edit(workspace, lambda params: params.update(monitors={}))
    assert stage("monitors")[0] == 0
    tables = sorted((workspace / "artifacts" / "monitors").iterdir())
    assert [path.stem for path in tables] == [
        "alarms", "rollouts", "scores", "thresholds", "unavailable",
    ]  # fmt: skip
    assert all(read_table(path).num_rows == 0 for path in tables)


def test_of_the_comparison_only_what_its_rollouts_share_is_read(
    workspace, edit, stage, admitted, monkeypatch
):
    """Starts, person, baselines and margin may move: rollouts under probes stay as they are."""
    seen = []
    monkeypatch.setattr(module, "_watch", lambda _, params, *__: seen.append(params))

    def comparison(**changes):
        edit(workspace, lambda params: params["stress"].update(changes))
        assert stage("monitors")[0] == 0
        return module._comparison(seen[-1])

    before = comparison()
    assert (before.starts, before.person, before.fixtures.size) == ((), None, 0)
    assert comparison(starts=3, baselines=[], person=None, margin=0.01) == before
    assert comparison(samples=9) != before
