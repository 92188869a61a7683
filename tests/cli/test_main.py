"""The program: bad usage in one line, and the commands that other packages register."""

import sys
import types

import pytest

from genpolicy.cli.main import main
from genpolicy.cli.shell import GROUP


def test_without_a_command_it_says_how(capsys):
    assert main([]) == 2
    assert "Commands:" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["frob"], "genpolicy: No such command 'frob'. See `genpolicy --help`.\n"),
        (["ingset"], "genpolicy: No such command 'ingset'. Did you mean 'ingest'? "
         "See `genpolicy --help`.\n"),
        (["ingest"], "genpolicy ingest: Missing argument 'PATH'. See `genpolicy ingest --help`.\n"),
        (["gates", "show"],
         "genpolicy gates show: Missing argument 'letter'. See `genpolicy gates show --help`.\n"),
    ],
)  # fmt: skip
def test_bad_usage_is_one_line_and_code_two(arguments, said, capsys):
    assert main(arguments) == 2
    assert capsys.readouterr().err == said


def fine() -> int:
    """Ends."""
    return 0


@pytest.fixture
def registered(tmp_path, monkeypatch):
    """A package above this one registers two commands, one of which cannot be loaded."""
    info = tmp_path / "above-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: above\nVersion: 1\n")
    (info / "entry_points.txt").write_text(f"[{GROUP}]\nfine = above:fine\nbroken = absent:x\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    module = types.ModuleType("above")
    module.fine = fine
    monkeypatch.setitem(sys.modules, "above", module)


@pytest.mark.usefixtures("registered")
def test_a_registered_command_runs_and_a_broken_one_is_named(capsys):
    assert main(["fine"]) == 0
    assert main(["broken"]) == 2
    printed = capsys.readouterr().err
    assert printed.startswith("genpolicy broken: command broken is absent:x, which cannot be")
    assert len(printed.splitlines()) == 1


@pytest.mark.usefixtures("registered")
def test_a_broken_command_does_not_take_the_help_away(capsys):
    assert main(["--help"]) == 0
    printed = capsys.readouterr().out
    assert "Ends." in printed and "cannot be loaded" in printed
