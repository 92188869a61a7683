"""The state of a scene is finite and names what it holds."""

import numpy as np
import pytest
from near import HOME

from genpolicy.errors import ContractError, NonFiniteError
from genpolicy.robot.scene_state import SceneState


def test_bad_scene_states_are_refused(model):
    with pytest.raises(NonFiniteError):
        SceneState({"post": ((np.nan, 0, 0), (1, 0, 0, 0))})
    with pytest.raises(ContractError, match="stand upright"):
        SceneState({"post": ((0, 0, 0), (0.7071067811865476, 0.7071067811865476, 0, 0))})
    with pytest.raises(ContractError, match="bodies out of"):
        model.in_collision(HOME, SceneState({"wall": ((0, 0, 0), (1, 0, 0, 0))}))
