"""Limits that moved are told before anything trains, in the words of the stage that refuses."""

import shutil
from pathlib import Path

import pytest

from genpolicy.wall_clock.limits import LIMITS
from stages._beforehand import main

ROOT = Path(__file__).parents[2]


@pytest.fixture
def pinned(workspace):
    shutil.copy(ROOT / LIMITS, workspace)
    return workspace


def test_what_is_pinned_may_run(pinned, capsys):
    assert main() == 0
    assert capsys.readouterr().err == ""


def test_a_limit_that_moved_is_named(pinned, edit, capsys):
    edit(pinned, lambda p: p["execution"].update(watchdog_s=0.2))
    assert main() == 2
    assert "execution.watchdog_s is 0.2, expected 0.1, as pinned" in capsys.readouterr().err


def test_limits_that_are_no_file_are_refused(pinned, capsys):
    (pinned / LIMITS).write_text("task: none\n")
    assert main() == 2
    assert LIMITS in capsys.readouterr().err


def test_parameters_that_cannot_be_read_are_left_to_the_first_stage(pinned, edit, capsys):
    edit(pinned, lambda p: p.update(nobody_knows=1))
    assert main() == 0
    assert capsys.readouterr().err == ""
