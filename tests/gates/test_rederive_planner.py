"""The planner of the task is compared where there is one, whatever the parameters say since."""

from pathlib import Path

import pytest
import yaml

from gates.rederive_planner import planner_of_ladder, rederive_planner
from genpolicy.contract.planner import PLANNER, planner_sha256
from genpolicy.errors import ConfigError
from genpolicy.tasks.identity import task_identity

PARAMS = yaml.safe_load((Path(__file__).parents[2] / "params.yaml").read_text())
LEFT = [name for name in PARAMS["stress"]["baselines"] if name != PLANNER]


def test_a_ladder_that_left_it_out_is_refused_and_a_rehearsal_is_not():
    rederive_planner(PARAMS)
    without = PARAMS | {"stress": PARAMS["stress"] | {"baselines": LEFT}}
    with pytest.raises(ConfigError, match=f"stress.baselines is without {PLANNER}"):
        rederive_planner(without)
    rederive_planner(without | {"rehearsal": True})


def test_it_is_that_of_the_task_as_it_is_installed():
    own = planner_of_ladder(PARAMS)
    assert own.sha256 == planner_sha256(task_identity(PARAMS["task"]["name"])["sha256"])
