"""Controller, limits, supervisor and scene are pinned: another one stops the ladder."""

from pathlib import Path

import pytest
import yaml

from genpolicy.cli.fixtures import run_fixtures
from genpolicy.errors import ConfigError
from genpolicy.integrity.hashing import sha256_bytes
from genpolicy.tasks import fixtures
from genpolicy.tasks.fixtures import PINS, fixture_hashes, pin, require_pinned
from genpolicy.tasks.identity import task_identity

ROOT = Path(__file__).parents[2]
TASK = "tabletop_insertion"
KINDS = {"controller", "limits", "supervisor", "robot", "scene"}


@pytest.fixture(scope="module")
def found():
    return fixture_hashes(task_identity(TASK))


def test_the_fixtures_of_the_checkout_are_those_that_are_pinned(found):
    """After a deliberate change: `genpolicy fixtures --pin`, and say so in CHANGELOG.md."""
    assert set(found) == KINDS
    require_pinned(ROOT, TASK, found)


@pytest.mark.parametrize("kind", sorted(fixtures.FILES))
def test_an_edit_of_the_file_is_another_fixture(kind, found, tmp_path, monkeypatch):
    """One line more in controller, limits or supervisor."""
    home = Path(fixtures.genpolicy.__file__).parent
    for name in fixtures.FILES.values():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes((home / name).read_bytes())
    monkeypatch.setattr(fixtures.genpolicy, "__file__", str(tmp_path / "__init__.py"))
    file = tmp_path / fixtures.FILES[kind]
    file.write_bytes(file.read_bytes() + b"# stiffer\n")
    changed = fixture_hashes(task_identity(TASK))
    assert {name for name in found if changed[name] != found[name]} == {kind}
    assert changed[kind] == sha256_bytes(file.read_bytes())


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_each_fixture_that_differs_refuses_alone(kind, found):
    with pytest.raises(ConfigError, match=rf"{PINS}: {TASK}\.{kind} is 0000.* as pinned"):
        require_pinned(ROOT, TASK, {**found, kind: "0" * 64})


def test_a_fixture_too_many_or_too_few_refuses(found):
    with pytest.raises(ConfigError, match=r"\.scene/mesh\.stl is 1111.*expected nothing"):
        require_pinned(ROOT, TASK, {**found, "scene/mesh.stl": "1" * 64})
    with pytest.raises(ConfigError, match=r"\.robot is missing"):
        require_pinned(ROOT, TASK, {k: v for k, v in found.items() if k != "robot"})


def test_no_pins_is_no_permission(tmp_path, found):
    with pytest.raises(ConfigError, match=PINS):
        require_pinned(tmp_path, TASK, found)
    (tmp_path / PINS).write_text("other: {}\n")
    with pytest.raises(ConfigError, match="not pinned"):
        require_pinned(tmp_path, TASK, found)


def test_pinning_keeps_the_pins_of_other_tasks(tmp_path, found, capsys):
    (tmp_path / PINS).write_text("other: {scene: abc}\n")
    assert run_fixtures(tmp_path, task=TASK, write=True) == 0
    pins = yaml.safe_load((tmp_path / PINS).read_text())
    assert pins == {"other": {"scene": "abc"}, TASK: found}
    assert run_fixtures(tmp_path, task=TASK, write=False) == 0
    assert found["scene"] in capsys.readouterr().out


def test_the_task_is_that_of_the_settings(tmp_path):
    (tmp_path / "params.yaml").write_text(f"task: {{name: {TASK}}}\n")
    assert run_fixtures(tmp_path, task=None, write=True) == 0
    (tmp_path / "params.yaml").write_text("seed: 1\n")
    with pytest.raises(ConfigError, match=r"task\.name"):
        run_fixtures(tmp_path, task=None, write=False)


def test_a_foreign_task_is_pinned_like_ours(foreign_task, tmp_path):
    found = pin(tmp_path, foreign_task)
    require_pinned(tmp_path, foreign_task, found)
    assert set(found) >= KINDS
