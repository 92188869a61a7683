"""Stage `failure_search`: behind Gate D, for who passed it, and for nobody else."""

import importlib
from dataclasses import replace

import pytest

from stages import _beside
from stages import failure_search as module
from stages._stage import ARTIFACTS, load_params


@pytest.fixture
def beside(capsys):
    """Run the stage in this process; exit code and what it said."""

    def run():
        capsys.readouterr()
        with pytest.raises(SystemExit) as end:
            _beside.main("failure_search", importlib.import_module("stages.failure_search").work)
        return end.value.code, capsys.readouterr().err

    return run


def test_it_refuses_where_no_gate_was_judged(workspace, beside):
    code, said = beside()
    assert (code, said.count("\n")) == (3, 1)
    assert said.startswith("failure_search: Gate A refuses: report is missing")
    assert not (workspace / "artifacts").exists()


@pytest.fixture
def one_contract(monkeypatch):
    """Checkpoints of the task that is here; that others are refused is asked of all stages."""
    monkeypatch.setattr(module, "require_one_contract", lambda *_, **__: None)


@pytest.mark.usefixtures("one_contract")
@pytest.mark.parametrize("value", [-1, 1.5, "many"])
def test_a_bad_budget_is_bad_input(workspace, edit, beside, monkeypatch, value):
    monkeypatch.setattr(module, "admit", lambda *_: type("A", (), {"candidates": ("flow",)}))
    edit(workspace, lambda params: params["card"].update(failure_search={"evaluations": value}))
    code, said = beside()
    assert (code, said.count("\n")) == (2, 1)
    assert said.startswith("failure_search: params.yaml: card.failure_search")
    assert not (workspace / ARTIFACTS / "failure_search").exists()


def test_a_fault_of_ours_is_code_1_and_is_timed(workspace, beside, monkeypatch):
    def fault(*_):
        raise ZeroDivisionError("boom")

    monkeypatch.setattr(module, "admit", fault)
    code, said = beside()
    assert code == 1 and "this is a fault of genpolicy" in said
    assert (workspace / "build/times/failure_search.json").is_file()


@pytest.mark.usefixtures("one_contract")
@pytest.mark.parametrize("failed", [None, "diffusion", "flow"])
def test_who_gate_d_does_not_let_through_is_not_searched(evidence, monkeypatch, workspace, failed):
    passed = tuple(name for name in ("diffusion", "flow") if name != failed)
    monkeypatch.setattr(module, "admit", lambda *_: type("A", (), {"candidates": passed}))
    asked, written = [], []
    monkeypatch.setattr(module, "planned", lambda _, names, **__: asked.extend(names) or ["x"])
    monkeypatch.setattr(
        module, "write_searches", lambda _, searches, **__: written.append(list(searches))
    )
    found = load_params()
    params = replace(found, raw={**found.raw, "card": {"failure_search": {}}})
    module.work(params)
    assert (tuple(asked), written) == (passed, [["x"]])
    nobody = replace(params, raw={**params.raw, "card": {"failure_search": {"evaluations": 0}}})
    asked.clear()
    module.work(nobody)
    assert (asked, written[-1]) == ([], []), "0 looks for nothing"
