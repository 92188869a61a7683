"""The shell of the commands: codes, one line per error."""

import pytest
import typer

from genpolicy.cli.shell import new_app, run_program
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
