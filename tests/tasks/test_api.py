import pytest

from genpolicy.errors import ConfigError
from genpolicy.tasks.api import load_task


def test_the_default_task_is_found_by_its_entry_point():
    task = load_task("tabletop_insertion")
    assert task.name == "tabletop_insertion"
    assert task.observation.dim == 24
    assert task.contact_phases < set(task.phases)
    assert task.scene_path.is_file()


def test_an_unknown_task_is_refused_with_the_known_names():
    with pytest.raises(ConfigError, match=r"'no_such_task', expected one of .*tabletop_insertion"):
        load_task("no_such_task")
