"""The cell as a Gymnasium environment, registered as `genpolicy/TabletopInsertion-v0`.

Importing this module registers it; `gymnasium.make` also takes
`genpolicy.tasks.tabletop_insertion.environment:genpolicy/TabletopInsertion-v0`.
"""

from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import ACTION_DIM, GRIPPER, POSITION, ROTATION, split_action
from genpolicy.tasks.api import WorldSettings
from genpolicy.tasks.tabletop_insertion import scene
from genpolicy.tasks.tabletop_insertion.observation import OBSERVATION
from genpolicy.tasks.tabletop_insertion.picture import draw
from genpolicy.tasks.tabletop_insertion.probes import EPOCHS
from genpolicy.tasks.tabletop_insertion.start import sample_start
from genpolicy.tasks.tabletop_insertion.task import WORKSPACE
from genpolicy.tasks.tabletop_insertion.world import TabletopWorld

Array = NDArray[np.float64]

ENVIRONMENT_ID = "genpolicy/TabletopInsertion-v0"
MAXIMUM_STEPS = 300
FRAMES_PER_S = 20


class TabletopInsertionEnv(gymnasium.Env[Array, Array]):
    """Observation and action of the contracts; reward 1 at success, else 0.

    An episode terminates at success or at a forbidden contact. An action whose rotation columns
    span no plane keeps the last rotation.

    Args:
        render_mode: None or `rgb_array`.
        calibration_epoch: Camera calibration of the observations.
        probe: Out-of-distribution probe, or `nominal`.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 - declared so by Env
        "render_modes": ["rgb_array"],
        "render_fps": FRAMES_PER_S,
    }

    def __init__(
        self,
        render_mode: str | None = None,
        *,
        calibration_epoch: str = next(iter(EPOCHS)),
        probe: str = "nominal",
    ) -> None:
        self.render_mode = render_mode
        self._settings = WorldSettings(calibration_epoch, probe)
        low, high = np.full(ACTION_DIM, -1.0), np.full(ACTION_DIM, 1.0)
        low[POSITION], high[POSITION] = WORKSPACE.lower_m, WORKSPACE.upper_m
        low[GRIPPER], high[GRIPPER] = 0.0, scene.OPEN_OPENING_M
        self.action_space = gymnasium.spaces.Box(low, high, dtype=np.float64)
        self.observation_space = gymnasium.spaces.Box(
            -np.inf, np.inf, (OBSERVATION.dim,), dtype=np.float64
        )
        self._world: TabletopWorld | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """A new start, drawn from the environment's generator."""
        super().reset(seed=seed)
        self._world = TabletopWorld(sample_start(self.np_random), settings=self._settings)
        return self._world.observe(), {"state_sha256": self._world.state_sha256()}

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """One action period."""
        world = self._ready()
        world.command(_usable(action, world.last_action))
        world.advance()
        info = {
            "phase": world.phase,
            "collision": world.collision,
            "contact_force_n": world.contact_force_n,
            "is_success": world.success,
        }
        terminated = world.success or world.collision
        return world.observe(), float(world.success), terminated, False, info

    def render(self) -> NDArray[np.uint8] | None:
        """Picture by ray casting, or None without a render mode."""
        if self.render_mode is None:
            return None
        world = self._ready()
        return draw(world.model, world.data)

    def _ready(self) -> TabletopWorld:
        if self._world is None:
            raise gymnasium.error.ResetNeeded("Call reset before step or render.")
        return self._world


def _usable(action: Array, last_action: Array) -> Array:
    target = np.array(action, dtype=np.float64)
    _, rotation, _ = split_action(target)
    if not np.isfinite(rotation).all():
        target[ROTATION] = last_action[ROTATION]
    return target


if ENVIRONMENT_ID not in gymnasium.registry:
    gymnasium.register(
        id=ENVIRONMENT_ID,
        entry_point=f"{__name__}:TabletopInsertionEnv",
        max_episode_steps=MAXIMUM_STEPS,
    )
