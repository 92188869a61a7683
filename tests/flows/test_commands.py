"""Commands of the flows: their codes and sentences."""

from pathlib import Path

import pytest

from flows import commands
from flows.workspace import make_workspace
from genpolicy.cli.shell import run_program


def test_the_command_names_the_bad_key_and_ends_with_2(
    checkout: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    overrides = tmp_path / "overrides.yaml"
    overrides.write_text("record: {valeu: 1}\n")
    target = tmp_path / "target"
    arguments = [str(target), "--overrides", str(overrides), "--source", str(checkout)]
    assert run_program(commands.workspace, "workspace", arguments) == 2
    assert "override record.valeu is not a key of params.yaml" in capsys.readouterr().err
    assert not target.exists()


def main(arguments: list[str]) -> int:
    return run_program(commands.reproduce, "reproduce", arguments)


@pytest.mark.parametrize(("code", "expected"), [(2, 2), (1, 1), (7, 1)])
def test_the_command_ends_with_the_code_of_the_stage(
    checkout: Path, tmp_path: Path, code: int, expected: int, capfd: pytest.CaptureFixture[str]
) -> None:
    target = make_workspace(checkout, tmp_path / "run", {"record": {"code": code}})
    assert main(["--workspace", str(target)]) == expected
    assert "The ladder stopped: record: " in capfd.readouterr().err


def test_a_folder_without_a_pipeline_is_bad_input(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["--workspace", str(tmp_path)]) == 2
    assert "without dvc.yaml" in capsys.readouterr().err
