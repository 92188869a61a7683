"""The table at the end of a run."""

import hashlib
import json
import os
import re
from pathlib import Path
from types import SimpleNamespace

import evidence
import pytest
import yaml
from test_verdicts import criterion

from gates.overview import Line, _stopped, as_text, overview
from gates.present import present_runs
from gates.proof import STAGE_REQUIRES, Rung, judge, prove_all
from gates.report import report_bytes, report_path
from genpolicy.integrity.atomic import write_bytes


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


@pytest.mark.parametrize(
    ("code", "said"), [(0, "done"), (1, "FAULT"), (2, "BAD INPUT"), (3, "REFUSED")]
)
def test_each_exit_code_has_its_word(tmp_path: Path, code: int, said: str) -> None:
    _record(tmp_path, "record", seconds=1.0, peak_mib=1, exit_code=code)
    lines = {line.stage: line for line in overview(tmp_path, prove_all(tmp_path))}
    assert lines["record"].verdict == said


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
    for second, seconds in ((1005, 1.0), (1002, 1.0), (1001, None)):  # gate_b was at 1002
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


WHOLE = [
    Line("audit", "done", "", 12.34, 99),
    Line("gate_a", "FAIL", "told_share", 1.0, 123456, ("act FAIL: x 1",), "OVERRIDDEN by ada"),
    Line("card", "", "", None, None),
]
ROWS = (
    "stage  verdict             time   memory",
    "audit  done              12.3 s   99 MiB",
    "gate_a FAIL               1.0 s 123456 MiB",
    "card",
    "                         13.3 s",
)


def test_the_whole_table_is_told() -> None:
    head, audit, gate, card, total = ROWS
    assert as_text(WHOLE).splitlines() == [
        f"{head}  decided by", audit, f"{gate}  told_share; act FAIL: x 1; OVERRIDDEN by ada", card,
        total,
    ]  # fmt: skip
    below = ("  told_share", "  act FAIL: x 1", "  OVERRIDDEN by ada")
    assert as_text(WHOLE, terminal=True).splitlines() == [head, audit, gate, *below, card, total]


def test_what_is_red_and_what_is_green_fills_its_column() -> None:
    green, red = "\x1b[32m", "\x1b[31m"
    text = as_text(WHOLE, terminal=True, colour=True)
    assert f"audit  {green}done           \x1b[0m   12.3 s" in text
    assert f"gate_a {red}FAIL           \x1b[0m    1.0 s" in text
    assert f"{red}  OVERRIDDEN by ada\x1b[0m" in text and text.count("\x1b[0m") == 3


LONG = "a_name_without_a_space_" * 9
FELL = (f"{LONG} FAIL: projection_p95_m 0.026, required <= 0.02", "act FAIL: x 1, required <= 0")


@pytest.mark.parametrize("colour", [False, True])
def test_no_line_of_a_terminal_is_longer_than_it_whatever_the_names(colour: bool) -> None:
    lines = [
        Line("gate_c", "PASS", f"Go on with {LONG}.", 1234.5, 123456, FELL),
        *(Line(stage, "PENDING_REVIEW", "", 1e5, 1, ()) for stage in STAGE_REQUIRES),
    ]
    text = as_text(lines, terminal=True, colour=colour)
    plain = re.sub("\x1b\\[[0-9]+m", "", text)
    assert max(map(len, plain.splitlines())) <= 80
    assert (plain != text) == colour
    whole = "".join(line.strip() for line in plain.splitlines())
    assert LONG in whole and "act FAIL: x 1, required <= 0" in plain


def test_where_nobody_looks_each_stage_has_one_line_with_all_of_it() -> None:
    line = Line("gate_c", "PASS", "Go on.", 1.0, 1, FELL)
    text = as_text([line, Line("card", "", "", None, None)])
    assert "\x1b" not in text and len(text.splitlines()) == 4
    assert text.splitlines()[0].split() == ["stage", "verdict", "time", "memory", "decided", "by"]
    assert as_text([line], terminal=True).splitlines()[0].split() == text.split()[:4]
    assert text.splitlines()[1].endswith(f"  Go on.; {'; '.join(FELL)}")


def test_each_verdict_is_coloured_as_it_is_meant() -> None:
    text = as_text([Line("a", "FAIL", "", None, None), Line("b", "PASS", "", None, None)],
                   terminal=True, colour=True)  # fmt: skip
    assert text.splitlines()[1].startswith("a     \x1b[31mFAIL")
    assert text.splitlines()[2].startswith("b     \x1b[32mPASS")


def test_who_fell_is_named_with_number_and_limit_where_another_passes(ladder: Path) -> None:
    def slow(frame):  # type: ignore[no-untyped-def]
        late = (frame["method"] == "diffusion") & (frame["invocation"] > 0)
        return frame.assign(latency_s=frame["latency_s"].where(~late, 9.0))

    evidence.edit_table(ladder, "stress/invocations.parquet", slow)
    write_bytes(ladder / report_path("D"), report_bytes(judge(ladder, "D")))
    lines = {line.stage: line for line in overview(ladder, prove_all(ladder))}
    assert lines["gate_d"].verdict == "PASS"
    assert lines["gate_d"].stopped == (
        "diffusion FAIL: latency_p95_s 9 s (80 starts), required <= 400 ms",
    )
    assert lines["gate_c"].stopped == ()


def test_who_fell_did_not_fall_by_what_is_overridden(monkeypatch) -> None:
    rows = tuple(criterion("FAIL", "flow", name) for name in ("excepted", "broken"))
    entry = SimpleNamespace(gate="D", criterion="excepted", candidate="flow", instead="PASS")
    report = SimpleNamespace(
        gate="D", criteria=rows, candidates={"flow": "FAIL"}, overrides=(entry,)
    )
    monkeypatch.setattr("gates.overview.read_report", lambda root, gate: (report, ""))
    (text,) = _stopped(Path(), Rung("D", "n", "PASS", "", "", "", 0))
    assert text.startswith("flow FAIL: broken 1")


def test_a_report_that_is_refused_does_not_say_who_fell(ladder: Path) -> None:
    path = ladder / report_path("D")
    path.write_bytes(path.read_bytes().replace(b'"flow": "PASS"', b'"flow": "FAIL"'))
    lines = {line.stage: line for line in overview(ladder, prove_all(ladder))}
    assert lines["gate_d"].verdict == "REFUSED" and lines["gate_d"].stopped == ()


def test_what_is_overridden_is_red_and_below_its_gate_whatever_the_verdict() -> None:
    """The sentence is the decision's own; it stands apart from what decided."""
    told = "OVERRIDDEN: hold_share_upper of flow by rita; without, gate D FAIL."
    line = Line("gate_d", "PASS", "promote flow", 1.0, 1, (), told)
    for terminal in (False, True):
        plain = as_text([line], terminal=terminal)
        assert told in plain and "\x1b" not in plain
        coloured = as_text([line], terminal=terminal, colour=True)
        assert f"\x1b[31m{'  ' * terminal}{told}\x1b[0m" in coloured
