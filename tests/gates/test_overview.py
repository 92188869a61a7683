"""The table at the end of a run."""

import hashlib
import json
import os
from pathlib import Path

import pytest
import yaml

from gates.overview import Line, as_text, overview
from gates.present import present_runs
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


GATE_B, SHADOW = "reports/gate_b.json", "artifacts/shadow"


def _lock(root: Path, *, judged: str, read: str) -> None:
    """A lock of three stages: Gate B wrote `judged`, and shadow ran when it was `read`."""
    runs = {
        "gate_b": {"deps": [{"path": "gates", "md5": "g"}],
                   "outs": [{"path": GATE_B, "md5": judged}]},
        "shadow": {"deps": [{"path": GATE_B, "md5": read}],
                   "outs": [{"path": SHADOW, "md5": "s.dir"}]},
        "gate_c": {"deps": [{"path": SHADOW, "md5": "s.dir"}],
                   "outs": [{"path": "reports/gate_c.json", "md5": "c"}]},
    }  # fmt: skip
    (root / "dvc.lock").write_text(yaml.safe_dump({"schema": "2.0", "stages": runs}))
    for age, stage in enumerate(("shadow", "gate_c", "gate_b", "task")):
        _record(root, stage, seconds=10.0, peak_mib=1, exit_code=0)
        os.utime(root / "build/times" / f"{stage}.json", (1000 + age, 1000 + age))


def _shown(root: Path) -> dict[str, float | None]:
    return {line.stage: line.seconds for line in overview(root, prove_all(root))}


def test_a_run_that_a_refusal_left_behind_shows_no_time(tmp_path: Path) -> None:
    _lock(tmp_path, judged="b", read="b")
    shown = _shown(tmp_path)
    assert shown["gate_b"] == shown["shadow"] == shown["gate_c"] == 10.0
    _lock(tmp_path, judged="judged again", read="b")
    shown = _shown(tmp_path)
    assert shown["gate_b"] == 10.0  # ran in this ladder; those above stand on another report
    assert shown["shadow"] is shown["gate_c"] is None
    assert "shadow" in {line.stage for line in overview(tmp_path, prove_all(tmp_path))}
    assert _shown(tmp_path)["task"] is None  # the lock has no run of it


def test_a_refusal_is_shown_while_it_is_the_last_word(tmp_path: Path) -> None:
    _lock(tmp_path, judged="judged again", read="b")
    times = tmp_path / "build" / "times" / "shadow.json"
    _record(tmp_path, "shadow", seconds=1.0, peak_mib=1, exit_code=3)
    for second, seconds in ((1005, 1.0), (1001, None)):
        os.utime(times, (second, second))
        lines = {line.stage: line for line in overview(tmp_path, prove_all(tmp_path))}
        assert lines["shadow"].seconds == seconds
        assert lines["shadow"].verdict == ("REFUSED" if seconds else "")


def test_a_file_of_a_folder_that_another_stage_wrote_is_compared_by_its_bytes(
    tmp_path: Path,
) -> None:
    identity = tmp_path / "artifacts" / "task" / "identity.json"
    identity.parent.mkdir(parents=True)
    identity.write_text("{}")
    runs = {
        "task": {"outs": [{"path": "artifacts/task", "md5": "t.dir"}]},
        "record": {"deps": [{"path": "artifacts/task/identity.json",
                             "md5": hashlib.md5(b"{}").hexdigest()}]},
    }  # fmt: skip
    (tmp_path / "dvc.lock").write_text(yaml.safe_dump({"stages": runs}))
    assert present_runs(tmp_path) == {"task", "record"}
    identity.write_text("[]")
    assert present_runs(tmp_path) == {"task"}


def test_a_line_says_what_was_recorded_and_leaves_out_what_was_not() -> None:
    recorded = Line("audit", "done", "", 12.34, 99)
    text = as_text([recorded, Line("card", "", "", None, None)]).splitlines()
    assert text[1].split() == ["audit", "done", "12.3", "s", "99", "MiB"]
    assert text[2] == "card"
    assert text[3].split() == ["12.3", "s"]
