"""Before the first stage one line says how long all may take, and what nobody knows."""

import json

import pytest

from flows import commands
from flows.estimate import estimate
from flows.workspace import make_workspace
from genpolicy.cli.shell import run_program

PIPELINE = "stages:\n  record: {}\n  audit: {}\n  gate_a: {}\n"


@pytest.fixture
def workspace(tmp_path):
    (tmp_path / "build" / "times").mkdir(parents=True)
    (tmp_path / "dvc.yaml").write_text(PIPELINE)
    return tmp_path


def took(workspace, stage, seconds, code=0):
    path = workspace / "build" / "times" / f"{stage}.json"
    path.write_text(json.dumps({"stage": stage, "seconds": seconds, "exit_code": code}))


def test_a_first_run_is_told_what_is_documented(workspace):
    assert estimate(workspace).startswith("Estimate: nothing has run here.")
    assert "about an hour up to gate A" in estimate(workspace)


def test_stages_that_have_run_are_summed_and_the_others_counted(workspace):
    took(workspace, "record", 100.0)
    took(workspace, "audit", 80.0)
    took(workspace, "gate_a", 900.0, code=3)
    took(workspace, "retired", 900.0)
    assert estimate(workspace) == (
        "Estimate: 3 min for 2 of 3 stages, as last time here; what is up to date is skipped. "
        "The other 1 have no finished run here, and nobody knows."
    )
    took(workspace, "gate_a", 20.0)
    assert estimate(workspace) == (
        "Estimate: 3 min for all 3 stages, as last time here; what is up to date is skipped."
    )


@pytest.mark.parametrize("text", ["", "{}", "[]", '{"exit_code": 0, "seconds": "x"}', "nonsense"])
def test_a_time_that_cannot_be_read_is_no_time(workspace, text):
    took(workspace, "record", 30.0)
    (workspace / "build" / "times" / "audit.json").write_text(text)
    assert estimate(workspace).startswith("Estimate: 30 s for 1 of 3 stages")


@pytest.mark.parametrize("text", ["stages: [", "[]", "other: 1\n"])
def test_a_pipeline_that_cannot_be_read_is_refused_by_dvc_and_not_here(workspace, text):
    (workspace / "dvc.yaml").write_text(text)
    assert estimate(workspace).startswith("Estimate: nothing has run here.")


@pytest.mark.parametrize(("named", "said"), [([], True), (["record"], False)])
def test_a_whole_ladder_begins_with_it_and_a_named_stage_does_not(
    checkout, tmp_path, capfd, named, said
):
    target = make_workspace(checkout, tmp_path / "run", {})
    arguments = ["--workspace", str(target), *named]
    assert run_program(commands.reproduce, "reproduce", arguments) == 0
    first = capfd.readouterr().out.splitlines()[0]
    assert first.startswith("Estimate: ") == said
