import importlib
import json
import re
import sys
from pathlib import Path

import pytest

from genpolicy import doctor
from genpolicy.cli import commands
from genpolicy.cli.shell import run_program


def test_pins_are_read_in_one_spelling() -> None:
    text = "# a comment\n\nPyYAML==6.0.3\nzc.lockfile==4.0\ntyping_extensions==4.16.0\n"
    expected = {"pyyaml": "6.0.3", "zc-lockfile": "4.0", "typing-extensions": "4.16.0"}
    assert doctor.pins(text) == expected


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("torch>=2", "line 1 is 'torch>=2', expected name==version"),
        ("a==1\nA==2", "line 2 names a a second time"),
        ("-e .", "expected name==version"),
    ],
)
def test_a_pin_that_is_none_is_refused(text: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        doctor.pins(text)


def test_another_version_a_missing_and_an_unpinned_package_are_named() -> None:
    finding = doctor.check_pins({"a": "1", "b": "2"}, {"a": "1", "b": "3"}, ["a", "b", "c"])
    assert finding.state == doctor.WRONG
    assert finding.found == "b 3 (pinned 2), c missing, c not pinned"
    fine = doctor.check_pins({"a": "1", "b": "2"}, {"a": "1"}, ["a"])
    assert (fine.state, fine.found) == (doctor.OK, "1 packages as pinned in constraints.txt")


@pytest.mark.parametrize(
    ("version", "state"),
    [
        ("0.138.9", "wrong"),
        ("0.139.0", "ok"),
        ("0.150.0", "ok"),
        ("0.150.9", "ok"),
        ("0.151.0", "wrong"),
        ("0.165.0", "wrong"),
        ("1.0.0", "wrong"),
        ("", "wrong"),
        (None, "wrong"),
    ],
)
def test_the_fastapi_that_breaks_prefect_is_named(version: str | None, state: str) -> None:
    finding = doctor.check_fastapi({} if version is None else {"fastapi": version})
    assert finding.state == state
    assert bool(finding.action) == (state == "wrong")


@pytest.mark.parametrize(
    ("version", "state"),
    [((3, 10), "wrong"), ((3, 11), "ok"), ((3, 12), "warning"), ((3, 13), "wrong")],
)
def test_python_versions(version: tuple[int, int], state: str) -> None:
    assert doctor.check_python(version).state == state


def test_free_space_is_held_against_the_need_and_nan_is_not_enough() -> None:
    assert doctor.check_space("disk", 5.0, 5.0, "x").state == "ok"
    assert doctor.check_space("disk", 4.9, 5.0, "x").state == "warning"
    assert doctor.check_space("disk", float("nan"), 5.0, "x").state == "warning"


@pytest.mark.parametrize(
    ("text", "state"),
    [
        ("[core]\nanalytics = false\ncheck_update = false\n", "ok"),
        ("[core]\nanalytics = false\n", "wrong"),
        ("[core]\nanalytics = true\ncheck_update = false\n", "wrong"),
        ("", "wrong"),
        ("not a configuration", "wrong"),
    ],
)
def test_telemetry_must_be_off_in_words(text: str, state: str) -> None:
    assert doctor.check_dvc_config(text).state == state


def test_a_lock_left_behind_is_told_from_one_that_is_held(tmp_path: Path) -> None:
    assert doctor.check_lock(tmp_path).found == "free"
    lock = tmp_path / ".dvc" / "tmp" / "rwlock"
    lock.parent.mkdir(parents=True)
    lock.write_text(json.dumps({"x": {"write": {"pid": 1, "cmd": "dvc repro"}}}))
    assert doctor.check_lock(tmp_path).found == "held by process 1"
    lock.write_text(json.dumps({"x": {"write": {"pid": 2**30, "cmd": "dvc repro"}}}))
    assert doctor.check_lock(tmp_path).found == "left behind by a process that has ended"


def test_the_table_the_json_and_the_exit_code_agree(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code = doctor.main(["--root", str(tmp_path), "--json"])
    findings = json.loads(capsys.readouterr().out)
    assert code == 2  # no constraints.txt and no .dvc/config here
    assert {"versions", "telemetry"} <= {f["item"] for f in findings if f["state"] == "wrong"}
    assert doctor.main(["--root", str(tmp_path)]) == 2
    table = capsys.readouterr().out
    assert all(finding["item"] in table for finding in findings)


def test_with_or_without_the_library_of_the_command_line_it_is_one_command(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    printed = []
    for run in (doctor.main, lambda words: run_program(commands.doctor, "doctor", words)):
        for words in (["--json"], []):
            assert run([*words, "--root", str(tmp_path)]) == 2
            printed.append(re.sub(r"[\d.]+ GiB", "GiB", capsys.readouterr().out))
    assert printed[:2] == printed[2:]


def test_the_program_without_its_library_still_examines(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in [name for name in sys.modules if name.startswith(("typer", "genpolicy.cli."))]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "typer", None)
    assert importlib.import_module("genpolicy.cli.main").main(["doctor"]) == 2
    printed = capsys.readouterr()
    assert "the environment is not whole" in printed.err
    assert "python" in printed.out
