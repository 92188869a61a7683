"""The shell of the commands: codes, one line per error, commands of other packages."""

import sys
import types

import pytest
import typer

from genpolicy.cli.main import main
from genpolicy.cli.shell import GROUP, new_app, run_program
from genpolicy.errors import BadInputError, RefusedError

REFUSAL = RefusedError(
    gate="A", criterion="share", measured="0.1", limit=">= 0.5", report="r.json", action="Stop."
)
BAD = BadInputError(where="x", found="1", expected="2", action="Correct it.")


def ends(outcome):
    def command() -> int:
        """Ends."""
        if isinstance(outcome, BaseException):
            raise outcome
        return outcome

    return command


@pytest.mark.parametrize(
    ("outcome", "code", "said"),
    [
        (0, 0, ""),
        (3, 3, ""),
        (BAD, 2, "prog: x is 1, expected 2. Correct it.\n"),
        (REFUSAL, 3, "prog: Gate A refuses: share is 0.1, required >= 0.5; see r.json. Stop.\n"),
        (typer.Exit(3), 3, ""),
        (KeyboardInterrupt(), 130, "prog: interrupted; nothing was written\n"),
    ],
)
def test_one_meaning_per_code_and_one_line_per_error(outcome, code, said, capsys):
    assert run_program(ends(outcome), "prog", []) == code
    assert capsys.readouterr().err == said


def test_a_fault_keeps_its_traceback(capsys):
    assert run_program(ends(ZeroDivisionError("unforeseen")), "prog", []) == 1
    printed = capsys.readouterr().err
    assert "ZeroDivisionError: unforeseen" in printed
    assert printed.splitlines()[-1].startswith("prog: this is a fault of genpolicy")


def test_the_command_of_a_group_stands_in_the_error(capsys):
    app = new_app("Two.")
    app.command("one")(ends(BAD))
    app.command("two")(ends(0))
    assert run_program(app, "prog", ["one"]) == 2
    assert capsys.readouterr().err.startswith("prog one: x is 1")


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


@pytest.fixture
def registered(tmp_path, monkeypatch):
    """A package above this one registers two commands, one of which cannot be loaded."""
    info = tmp_path / "above-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: above\nVersion: 1\n")
    (info / "entry_points.txt").write_text(f"[{GROUP}]\nfine = above:fine\nbroken = absent:x\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    module = types.ModuleType("above")
    module.fine = ends(0)
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
