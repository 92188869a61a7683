"""Limits of the wall clock: pinned byte by byte, and those of the ladder."""

import pytest
import yaml
from arranged import ROOT, workspace

from genpolicy.cli.fixtures import run_fixtures
from genpolicy.errors import ConfigError, IntegrityError
from genpolicy.integrity.documents import read_yaml
from genpolicy.wall_clock.limits import LIMITS, pin_limits, read_limits, require_limits


def test_the_checkout_is_pinned():
    """After a deliberate change: `genpolicy fixtures --pin`."""
    limits = read_limits(ROOT)
    assert limits.silence_stop_s == limits.execution.silence_stop_s
    assert limits.cell.horizons == limits.horizons


def test_the_values_are_those_of_the_ladder_and_one_more():
    params, limits = read_yaml(ROOT / "params.yaml"), read_yaml(ROOT / LIMITS)
    silence_s = limits["execution"].pop("silence_stop_s")
    # By the wall clock whole answers are known, and no terms of them.
    assert params["execution"].pop("term_deadlines") and "term_deadlines" not in limits["execution"]
    assert limits["execution"] == params["execution"]
    assert limits["horizons"] == params["horizons"]
    assert limits["feasibility"] == params["feasibility"]
    assert limits["task"] == params["task"]["name"]
    # A healthy policy may need its deadline and a period more before the next command.
    least_s = params["execution"]["deadline_s"] + 2 * params["horizons"]["action_period_s"]
    assert least_s < silence_s <= params["execution"]["hold_before_recovery_s"]


def test_every_byte_of_the_file_is_pinned(tmp_path):
    root = workspace(tmp_path)
    read_limits(root)
    data = (root / LIMITS).read_bytes()
    for at in range(len(data)):
        (root / LIMITS).write_bytes(data[:at] + bytes([data[at] ^ 1]) + data[at + 1 :])
        with pytest.raises(ConfigError, match="as pinned"):
            require_limits(root)
    with pytest.raises(ConfigError, match="as pinned"):
        read_limits(root)


def test_other_fixtures_than_the_pinned_ones_refuse_too(tmp_path):
    root = workspace(tmp_path)
    pins = read_yaml(root / "fixtures.yaml")
    pins["tabletop_insertion"]["supervisor"] = "0" * 64
    (root / "fixtures.yaml").write_text(yaml.safe_dump(pins))
    with pytest.raises(ConfigError, match=r"fixtures\.yaml: tabletop_insertion\.supervisor"):
        read_limits(root)


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("- 1\n", "of type list"),
        ("task: tabletop_insertion\n", "limits.yaml.horizons"),
        (None, "without execution.silence_stop_s"),
    ],
)
def test_pinned_nonsense_is_refused(text, found, tmp_path):
    root = workspace(tmp_path)
    if text is None:
        document = read_yaml(root / LIMITS)
        del document["execution"]["silence_stop_s"]
        text = yaml.safe_dump(document)
    (root / LIMITS).write_text(text)
    pin_limits(root)
    with pytest.raises(ConfigError, match=found):
        read_limits(root)


def test_limits_without_a_pin_and_a_pin_without_limits_are_refused(tmp_path):
    root = workspace(tmp_path)
    (root / "fixtures.yaml").unlink()
    with pytest.raises(ConfigError, match=r"a hash in fixtures\.yaml: wall_clock"):
        read_limits(root)
    pin_limits(root)
    (root / LIMITS).unlink()
    with pytest.raises(IntegrityError, match="not readable"):
        require_limits(root)


def test_without_either_there_is_nothing_to_hold(tmp_path):
    require_limits(tmp_path)
    assert pin_limits(tmp_path) == {}
    with pytest.raises(IntegrityError):
        read_limits(tmp_path)


def test_the_command_pins_and_holds_them(tmp_path, capsys):
    root = workspace(tmp_path)
    assert run_fixtures(root, task="tabletop_insertion", write=False) == 0
    (root / LIMITS).write_bytes((root / LIMITS).read_bytes() + b"# looked at\n")
    with pytest.raises(ConfigError, match=LIMITS):
        run_fixtures(root, task="tabletop_insertion", write=False)
    assert run_fixtures(root, task="tabletop_insertion", write=True) == 0
    assert LIMITS in capsys.readouterr().out
    read_limits(root)
