"""`genpolicy shadow`: a trained policy in its own process, and the person at the terminal."""

import io
import os
from pathlib import Path
from types import SimpleNamespace

import pytest
import yaml

from genpolicy.cli.shadow import ShadowOptions, attend, run_shadow
from genpolicy.errors import ConfigError
from genpolicy.execution.journal import read_journal
from genpolicy.wall_clock import run as run_module
from genpolicy.wall_clock.limits import LIMITS, pin_limits
from genpolicy.wall_clock.messages import Order

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def root(fleet, dataset, tmp_path_factory):
    """A workspace with trained policies, a dataset and pinned limits."""
    folder = tmp_path_factory.mktemp("workspace")
    (folder / "artifacts").mkdir()
    (folder / "artifacts" / "train_generators").symlink_to(fleet[0])
    (folder / "artifacts" / "ingest").symlink_to(dataset)
    for name in (LIMITS, "fixtures.yaml", "params.yaml"):
        (folder / name).write_bytes((ROOT / name).read_bytes())
    return folder


def test_a_trained_policy_is_replayed_to_the_stub(root, tmp_path, monkeypatch, capsys):
    nothing_typed, writer = os.pipe()
    os.close(writer)
    monkeypatch.setattr("sys.stdin", os.fdopen(nothing_typed))
    assert run_shadow(ShadowOptions(root, tmp_path / "run", "flow"), ["flow"]) == 0
    said = capsys.readouterr().out
    assert "independent checker: 0 broken rules" in said
    (events,) = read_journal(tmp_path / "run" / "journal.mcap").values()
    answered = [e for e in events if e.kind == "candidate"]
    assert answered and {e.payload["method"] for e in answered} == {"flow"}


def test_only_an_admitted_method_is_replayed(root, tmp_path):
    with pytest.raises(ConfigError, match="one that gate B admits: diffusion"):
        run_shadow(ShadowOptions(root, tmp_path / "run", "flow"), ["diffusion"])
    assert not (tmp_path / "run").exists()


def test_a_policy_that_was_brought_is_refused_by_name(root, tmp_path):
    """It is under no folder of trained ones, and a missing file would say nothing of that."""
    other = tmp_path / "other"
    other.mkdir()
    (other / "artifacts").symlink_to(root / "artifacts")
    for name in (LIMITS, "fixtures.yaml"):
        (other / name).write_bytes((root / name).read_bytes())
    params = yaml.safe_load((root / "params.yaml").read_text())
    params["candidates"]["theirs"] = "own/theirs.yaml"
    (other / "params.yaml").write_text(yaml.safe_dump(params))
    with pytest.raises(ConfigError, match="theirs, a policy that was brought") as caught:
        run_shadow(ShadowOptions(other, tmp_path / "run", "theirs"), ["theirs"])
    assert caught.value.exit_code == 2 and not (tmp_path / "run").exists()


def test_other_horizons_than_those_of_the_limits_are_refused(root, tmp_path):
    limits = yaml.safe_load((root / LIMITS).read_text())
    limits["horizons"]["execution_horizon"] = 9
    other = tmp_path / "other"
    other.mkdir()
    for name in ("artifacts", "fixtures.yaml", "params.yaml"):
        (other / name).symlink_to(root / name)
    (other / LIMITS).write_text(yaml.safe_dump(limits))
    (other / "fixtures.yaml").unlink()
    (other / "fixtures.yaml").write_bytes((root / "fixtures.yaml").read_bytes())
    pin_limits(other)
    with pytest.raises(ConfigError, match="the horizons of flow"):
        run_shadow(ShadowOptions(other, tmp_path / "run", "flow"), ["flow"])


class Running:
    """Ends after so many looks; remembers what was said."""

    def __init__(self, looks, interrupted=()):
        self.said, self.looks, self.interrupted = [], looks, list(interrupted)

    def wait(self, timeout_s):
        self.looks -= 1
        if self.looks in self.interrupted:
            raise KeyboardInterrupt
        if self.looks > 0:
            raise run_module.subprocess.TimeoutExpired("run", timeout_s)
        return {"state": "run"}

    def say(self, order, person=""):
        self.said.append((order, person))
        return True


def typed(text, monkeypatch):
    monkeypatch.setattr("genpolicy.cli.shadow.select", SimpleNamespace(select=lambda r, *_: (r,)))
    return io.StringIO(text)


def test_what_a_person_types_is_passed_on(monkeypatch, capsys):
    running = Running(looks=9)
    text = "stop now\nreset Ada Lovelace\nreset\nhelp\n\nend\n"
    assert attend(running, typed(text, monkeypatch)) == {"state": "run"}
    assert running.said == [
        (Order.EMERGENCY_STOP, "at the terminal now"), (Order.RESET, "Ada Lovelace"),
        (Order.END, ""),
    ]  # fmt: skip
    assert capsys.readouterr().err.count("Type `stop`") == 2


def test_an_interrupt_stops_and_ends(monkeypatch):
    running = Running(looks=4, interrupted=[2])
    attend(running, typed("", monkeypatch))
    assert running.said == [
        (Order.EMERGENCY_STOP, "interrupt at the terminal"), (Order.END, ""),
    ]  # fmt: skip


def test_a_broken_rule_of_the_checker_is_told_and_is_a_fault_of_ours(
    root, tmp_path, monkeypatch, capsys
):
    nothing_typed, writer = os.pipe()
    os.close(writer)
    monkeypatch.setattr("sys.stdin", os.fdopen(nothing_typed))
    broken = SimpleNamespace(rule="P1.age", text="Too old.")
    monkeypatch.setattr(
        "genpolicy.cli.shadow._checked", lambda *_: SimpleNamespace(violations=[broken])
    )
    assert run_shadow(ShadowOptions(root, tmp_path / "run", "flow"), ["flow"]) == 1
    said = capsys.readouterr().out
    assert "independent checker: 1 broken rules\n  P1.age: Too old." in said
