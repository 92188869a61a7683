import numpy as np
import pytest

from genpolicy.errors import ConfigError
from genpolicy.tasks.api import Workspace, load_task


def test_the_default_task_is_found_by_its_entry_point():
    task = load_task("tabletop_insertion")
    assert task.name == "tabletop_insertion"
    assert task.observation.dim == 24
    assert task.contact_phases < set(task.phases)
    assert task.scene_path.is_file()


def test_an_unknown_task_is_refused_with_the_known_names():
    with pytest.raises(ConfigError, match=r"'no_such_task', expected one of .*tabletop_insertion"):
        load_task("no_such_task")


def test_workspace_margin():
    workspace = Workspace((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    points = np.array([[0.5, 0.5, 0.5], [0.9, 0.5, 0.5], [1.2, 0.5, 0.5], [np.nan, 0.5, 0.5]])
    margin = workspace.margin_m(points)
    np.testing.assert_allclose(margin[:3], [0.5, 0.1, -0.2])
    assert not margin[3] >= 0
