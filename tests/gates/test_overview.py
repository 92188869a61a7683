"""The table at the end of a run."""

import json
from pathlib import Path

import pytest

from gates.overview import as_text, overview
from gates.proof import STAGE_REQUIRES, prove_all


def _record(root: Path, stage: str, **values: object) -> None:
    folder = root / "build" / "times"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{stage}.json").write_text(json.dumps({"stage": stage, **values}))


def test_every_stage_has_a_line_and_what_did_not_run_is_empty(tmp_path: Path) -> None:
    _record(tmp_path, "record", seconds=12.3, peak_mib=145, exit_code=0)
    lines = {line.stage: line for line in overview(tmp_path, prove_all(tmp_path))}
    assert list(lines) == list(STAGE_REQUIRES)
    assert (lines["record"].verdict, lines["record"].seconds) == ("done", 12.3)
    assert (lines["ingest"].verdict, lines["ingest"].seconds) == ("", None)
    assert lines["gate_a"].verdict == "NOT JUDGED"


def test_a_refused_stage_says_so_and_the_times_add_up(tmp_path: Path) -> None:
    _record(tmp_path, "record", seconds=12.3, peak_mib=145, exit_code=0)
    _record(tmp_path, "train_generators", seconds=1.0, peak_mib=99, exit_code=3)
    text = as_text(overview(tmp_path, prove_all(tmp_path)))
    assert any(line.split()[:2] == ["train_generators", "REFUSED"] for line in text.splitlines())
    assert text.splitlines()[-1].split() == ["13.3", "s"]


@pytest.mark.parametrize("content", ["", "{}", "[1]", '{"exit_code": 0, "seconds": "x"}'])
def test_a_broken_record_of_a_time_is_unknown_never_zero(tmp_path: Path, content: str) -> None:
    folder = tmp_path / "build" / "times"
    folder.mkdir(parents=True)
    (folder / "record.json").write_text(content)
    lines = overview(tmp_path, prove_all(tmp_path))
    assert lines[0].seconds is None
