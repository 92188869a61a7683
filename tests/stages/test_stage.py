"""What every stage does around its work: settings with a place, exit codes, times."""

import contextlib
import json
import os
import re
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import pytest
import yaml
from _beside import BESIDE

from genpolicy.errors import ContractError, RefusedError
from genpolicy.evidence.stress.latency import LatencySection
from genpolicy.progress import STAGE
from stages._stage import SHARED, STAGES, load_params, main

BAD_SETTINGS = {
    "unknown section": (
        lambda p: p.update(recrod={}), r"params\.yaml: recrod is an unknown section, expected one",
    ),
    "missing section": (
        lambda p: p.pop("record"), r"params\.yaml: record is missing, expected a section of keys",
    ),
    "section without keys": (
        lambda p: p.update(record=12), r"params\.yaml: record is 12, expected a section of keys",
    ),
    "missing shared section": (
        lambda p: p.pop("horizons"), r"params\.yaml: horizons is missing, expected a section",
    ),
    "misspelt key": (
        lambda p: p["record"].update(episode=3),
        r"params\.yaml: record\.episode is 3, expected Extra inputs are not permitted",
    ),
    "misspelt key of a shared section": (
        lambda p: p["compute"].update(worker=3),
        r"params\.yaml: compute\.worker is 3, expected Extra inputs are not permitted",
    ),
    "missing key": (
        lambda p: p["record"].pop("episodes"), r"params\.yaml: record\.episodes is .*required",
    ),
    "text for a number": (
        lambda p: p["record"].update(episodes="10"),
        r"params\.yaml: record\.episodes is '10', expected Input should be a valid integer",
    ),
    "a count of nothing": (
        lambda p: p["record"].update(episodes=0),
        r"params\.yaml: record\.episodes is 0, expected .*greater than or equal to 1",
    ),
    "not a number": (
        lambda p: p["horizons"].update(action_period_s=float("nan")),
        r"params\.yaml",
    ),
    "chunk shorter than what is executed": (
        lambda p: p["horizons"].update(prediction_horizon=4),
        r"horizons\.prediction_horizon is 4, expected at least execution_horizon = 8\. Correct",
    ),
    "no observation": (
        lambda p: p["horizons"].update(observation_horizon=0),
        r"horizons\.observation_horizon is 0, expected at least 1",
    ),
    "seed as text": (
        lambda p: p.update(seed="20261121"), r"params\.yaml: seed is '20261121', expected a whole",
    ),
    "seed as truth": (
        lambda p: p.update(seed=True), r"params\.yaml: seed is True, expected a whole number",
    ),
    "seed with a fraction": (
        lambda p: p.update(seed=1.5), r"params\.yaml: seed is 1\.5, expected a whole number",
    ),
    "no seed": (
        lambda p: p.pop("seed"), r"params\.yaml: seed is None, expected a whole number",
    ),
    "no worker": (
        lambda p: p["compute"].update(workers=0), r"params\.yaml: compute\.workers is 0, expected",
    ),
    "unknown task": (
        lambda p: p["task"].update(name="juggling"), r"juggling",
    ),
    "shares of nothing known": (
        lambda p: p["record"].update(shares={"nominall": 1.0}), r"nominall",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD_SETTINGS)
def test_a_bad_setting_ends_with_2_and_one_sentence_with_its_place(
    workspace, edit, stage, name
) -> None:
    change, sentence = BAD_SETTINGS[name]
    edit(workspace, change)
    code, said = stage("record")
    assert code == 2, said
    assert said.startswith("record: ")
    assert said.count("\n") == 1
    assert re.search(sentence, said), said
    left = [path for path in (workspace / "artifacts").rglob("*")]
    assert not left, "nothing is written for a bad setting"


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("- a\n- b\n", "is a list, expected a mapping of sections"),
        ("", "expected a mapping of sections"),
        ("seed: [1\n", "params.yaml"),
        ("seed: 1\nseed: 2\n", "params.yaml"),
        ("seed: !!python/object/apply:os.getpid []\n", "params.yaml"),
        (None, "params.yaml is"),
    ],
)
def test_a_broken_settings_file_is_bad_input(workspace, stage, text, sentence) -> None:
    path = workspace / "params.yaml"
    path.unlink()
    if text is not None:
        path.write_text(text)
    code, said = stage("record")
    assert (code, said.count("\n")) == (2, 1), said
    assert sentence in said


@pytest.mark.parametrize("name", STAGES)
def test_every_stage_refuses_a_section_that_nobody_reads(workspace, edit, stage, name) -> None:
    edit(workspace, lambda params: params.update(extra={}))
    code, said = stage(name)
    assert (code, said.count("\n")) == (2, 1)
    assert said.startswith(f"{name}: params.yaml: extra is an unknown section")
    assert not (workspace / "artifacts").exists()


@pytest.mark.parametrize(
    ("name", "gate"),
    [
        ("train_generators", "A"), ("reload", "A"), ("latency", "A"), ("shadow", "A"),
        ("stress", "A"), ("card", "A"),
    ],
)  # fmt: skip
def test_a_stage_behind_a_gate_refuses_where_no_gate_was_judged(
    workspace, stage, name, gate
) -> None:
    code, said = stage(name)
    assert (code, said.count("\n")) == (3, 1)
    assert said.startswith(f"{name}: Gate {gate} refuses: report is missing, required a report")
    assert f"Run `dvc repro gate_{gate.lower()}`" in said
    assert not (workspace / "artifacts").exists()


@pytest.mark.parametrize("name", ["ingest", "audit", "train_baselines", "measure_baselines"])
def test_a_stage_without_its_input_is_bad_input(workspace, stage, name) -> None:
    code, said = stage(name)
    assert (code, said.count("\n")) == (2, 1), said
    assert not list((workspace / "artifacts").glob("*"))


def test_the_names_of_stages_are_those_of_params_and_files(workspace) -> None:
    assert set(load_params().raw) == {*STAGES, *SHARED}
    files = {path.stem for path in (Path(__file__).parents[2] / "stages").glob("[!_]*.py")}
    assert files == {*STAGES, *BESIDE}
    assert not set(BESIDE) & {*STAGES, *SHARED}


def refusal(_):
    raise RefusedError(
        gate="B", criterion="nfe_mismatch", measured="1", limit="<= 0",
        report="reports/gate_b.json", action="Look there.",
    )  # fmt: skip


def bad_input(_):
    raise ContractError(where="file", found="this", expected="that", action="Mend it.")


def fault(_):
    raise ZeroDivisionError("boom")


def worker_died(_):
    raise BrokenProcessPool("A process in the pool was terminated.")


@pytest.mark.parametrize(
    ("work", "code", "sentence"),
    [
        (lambda _: None, 0, ""),
        (fault, 1, "record: this is a fault of genpolicy, not of your input. Report the lines"),
        (worker_died, 1, "record: a process that worked for this stage was killed"),
        (bad_input, 2, "record: file is this, expected that. Mend it.\n"),
        (
            refusal, 3,
            "record: Gate B refuses: nfe_mismatch is 1, required <= 0; see reports/gate_b.json. "
            "Look there.\n",
        ),
    ],
)  # fmt: skip
def test_exit_codes_mean_one_thing_each(workspace, capsys, work, code, sentence) -> None:
    with pytest.raises(SystemExit) as end:
        main("record", work)
    assert end.value.code == code
    said = capsys.readouterr().err
    assert sentence in said and ("fault of genpolicy" in said) == (work is fault)
    assert ("Traceback" in said) == (code == 1)
    times = json.loads((workspace / "build" / "times" / "record.json").read_text())
    assert (times["stage"], times["exit_code"]) == ("record", code)
    assert times["seconds"] >= 0 and times["peak_mib"] > 0


@pytest.mark.parametrize(
    ("stage", "last", "usual_s", "every_s"),
    [
        ("record", {"seconds": 12.5, "exit_code": 0}, 12.5, 10.0),
        ("record", {"seconds": 1.5, "exit_code": 3}, None, 10.0),
        ("record", "[", None, 10.0),
        ("train_baselines", None, None, 60.0),
    ],
)
def test_a_stage_says_its_place_and_for_how_long_it_is_at_it(
    workspace, monkeypatch, stage, last, usual_s, every_s
) -> None:
    file = workspace / "build" / "times" / f"{stage}.json"
    file.parent.mkdir(parents=True)
    if last is not None:
        file.write_text(last if isinstance(last, str) else json.dumps(last))
    seen = []

    def spoken(usual, *, every_s):
        seen.append((usual, every_s))
        return contextlib.nullcontext()

    monkeypatch.setattr("stages._stage.still_at_it", spoken)
    with pytest.raises(SystemExit):
        main(stage, lambda _: seen.append(os.environ[STAGE]))
    assert seen == [(usual_s, every_s), f"[{STAGES.index(stage) + 1}/{len(STAGES)}] {stage}"]


def test_nothing_speaks_beside_what_measures_time(workspace, monkeypatch) -> None:
    def spoken(usual, *, every_s):
        raise AssertionError("a thread beside the clock")

    monkeypatch.setattr("stages._stage.still_at_it", spoken)
    with pytest.raises(SystemExit) as end:
        main("latency", lambda _: None)
    assert end.value.code == 0


def test_times_that_cannot_be_written_fail_no_stage(workspace, capsys) -> None:
    (workspace / "build").write_text("a file in the way")
    with pytest.raises(SystemExit) as end:
        main("record", lambda _: None)
    assert end.value.code == 0
    assert "time not recorded" in capsys.readouterr().err


def test_the_declared_bounds_of_the_ladder_are_read(workspace):
    section = load_params().section("latency", LatencySection)
    assert section.declared_terms["queue"].minimum_s == 0.0


def test_a_fixture_that_is_not_the_pinned_one_stops_the_ladder_at_its_first_stage(
    workspace, stage
) -> None:
    pins = yaml.safe_load((workspace / "fixtures.yaml").read_text())
    pins["tabletop_insertion"]["supervisor"] = "0" * 64
    (workspace / "fixtures.yaml").write_text(yaml.safe_dump(pins))
    code, said = stage("task")
    assert (code, said.count("\n")) == (2, 1)
    assert "fixtures.yaml: tabletop_insertion.supervisor" in said
    assert not (workspace / "artifacts" / "task").exists()
