"""Stages that move the arm in simulation are held to the limits of the wall clock, as pinned."""

import shutil
from pathlib import Path

import pytest
import yaml

from genpolicy.cli.fixtures import run_fixtures
from genpolicy.errors import ConfigError
from genpolicy.wall_clock.limits import LIMITS
from stages import shadow, stress
from stages._limits import require_pinned_limits
from stages._stage import load_params

ROOT = Path(__file__).parents[2]


@pytest.fixture
def pinned(workspace):
    """A workspace with the limits of the checkout, which are pinned."""
    shutil.copy(ROOT / LIMITS, workspace)
    return workspace


def held(workspace):
    require_pinned_limits(load_params(), workspace)


def test_the_ladder_runs_with_what_is_pinned(pinned):
    held(pinned)


CHANGED = {
    "execution.watchdog_s": lambda p: p["execution"].update(watchdog_s=0.2),
    "execution.force_limit_n": lambda p: p["execution"]["force_limit_n"].update(insert=81.0),
    "execution.maximum_age_s": lambda p: p["execution"].update(maximum_age_s={"default": 0.31}),
    "execution.late_chunk": lambda p: p["execution"]["late_chunk"].update(
        {"continue": ["approach", "align", "retreat", "recover", "insert"], "hold": ["release"]}
    ),
    "execution.maximum_scene_shift_m": lambda p: p["execution"].update(maximum_scene_shift_m=0.03),
    "execution.recovery_plans": lambda p: p["execution"]["recovery_plans"].pop("approach"),
    "feasibility.condition_limit": lambda p: p["feasibility"].update(condition_limit=31.0),
    "horizons.execution_horizon": lambda p: p["horizons"].update(execution_horizon=7),
}


@pytest.mark.parametrize("place", CHANGED)
def test_a_limit_that_moves_in_one_file_alone_is_refused_by_name(pinned, edit, place):
    """The wall clock refused a byte of its limits; in simulation the same number moved unseen."""
    edit(pinned, CHANGED[place])
    with pytest.raises(ConfigError, match=rf"{place} is .* as pinned in .*fixtures --pin"):
        held(pinned)


def test_a_change_that_is_reviewed_and_pinned_is_the_limit(pinned, edit, capsys):
    edit(pinned, CHANGED["execution.watchdog_s"])
    limits = yaml.safe_load((pinned / LIMITS).read_text())
    limits["execution"]["watchdog_s"] = 0.2
    (pinned / LIMITS).write_text(yaml.safe_dump(limits))
    with pytest.raises(ConfigError, match="as pinned"):
        held(pinned)
    run_fixtures(pinned, task="tabletop_insertion", write=True)
    capsys.readouterr()
    held(pinned)


def test_what_only_one_clock_has_is_not_compared(pinned, edit):
    edit(pinned, lambda p: p["execution"].update(silence_stop_s=0.5, term_deadlines=[]))
    held(pinned)


def test_without_pinned_limits_nobody_knows_them(workspace):
    with pytest.raises(ConfigError, match=rf"{LIMITS} is missing, .*fixtures --pin"):
        held(workspace)


def test_a_rehearsal_may_differ_and_another_task_has_limits_of_its_own(pinned, edit):
    edit(pinned, lambda p: (CHANGED["execution.watchdog_s"](p), p.update(rehearsal=True)))
    held(pinned)
    edit(pinned, lambda p: (p.update(rehearsal=False), p["task"].update(name="another")))
    held(pinned)


@pytest.mark.parametrize("of", [shadow, stress], ids=lambda module: module.__name__)
def test_both_stages_ask_before_the_task_and_a_row_are_read(pinned, edit, monkeypatch, of):
    edit(pinned, CHANGED["execution.watchdog_s"])
    monkeypatch.setattr(of, "admit", lambda *_: type("A", (), {"candidates": ()}))

    def never(*_, **__):
        raise AssertionError("read before the limits were held")

    monkeypatch.setattr(of, "require_one_contract", lambda *_, **__: None)
    for name in ("load_task", "load_dataset", "read_brought"):
        monkeypatch.setattr(of, name, never)
    with pytest.raises(ConfigError, match=r"execution\.watchdog_s is 0\.2"):
        of.work(load_params())
