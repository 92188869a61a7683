"""What is asked of the monitors is read before the comparison is run."""

from types import SimpleNamespace

import pytest

from stages import stress as module

WRONG = {
    "a key": (lambda stress: stress["monitors"].update(kindz=[]), "stress.monitors.kindz"),
    "a probe": (
        lambda stress: stress["monitors"]["probes"].update(fog={"severities": [1.0]}),
        "stress.monitors.probes.fog",
    ),
    "a rule": (
        lambda stress: stress.update(joining={"rule": "real_time"}),
        "stress.monitors is probes, and stress.joining: real_time",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_cannot_be_run_ends_the_stage_before_the_comparison(
    workspace, edit, stage, monkeypatch, name
):
    """Nothing lies here that the comparison reads: it would be missed if it were asked for."""
    change, place = WRONG[name]
    edit(workspace, lambda params: change(params["stress"]))
    monkeypatch.setattr(module, "admit", lambda *_: SimpleNamespace(candidates=("flow",)))
    monkeypatch.setattr(module, "require_one_contract", lambda *_, **__: None)
    code, said = stage("stress")
    assert (code, f"params.yaml: {place}" in said) == (2, True), said
    assert not (workspace / "artifacts").exists()
