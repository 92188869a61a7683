"""What is replayed: a recorded episode, one row per action period, on the clock of the wall."""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from pydantic import model_validator

from genpolicy.contract.settings import Settings
from genpolicy.errors import ContractError
from genpolicy.evidence.admission_context import COMMANDS_AT_THE_BOUNDARY

Array = NDArray[np.float64]


class Replay(Settings):
    """One recorded episode.

    Attributes:
        episode_uuid: Which.
        calibration_epoch: Its calibration.
        phases: Task phase of each row.
        observations: Each row, in the task's contract. Shape (n, D_o).
        actions: What the operator commanded at each row. Shape (n, 10).
        forces_n: Largest contact force that each row states, N.
    """

    episode_uuid: str
    calibration_epoch: str
    phases: tuple[str, ...]
    observations: tuple[tuple[float, ...], ...]
    actions: tuple[tuple[float, ...], ...]
    forces_n: tuple[float, ...]

    @model_validator(mode="after")
    def _whole(self) -> "Replay":
        columns = (self.observations, self.actions, self.forces_n)
        if not self.phases or any(len(column) != len(self.phases) for column in columns):
            raise ContractError(
                where=f"the replay of episode {self.episode_uuid}",
                found=f"of {len(self.phases)} phases and {[len(c) for c in columns]} rows",
                expected="one phase, observation, action and force per row, at least one row",
                action="Cut it from the dataset again.",
            )
        return self

    def __len__(self) -> int:
        return len(self.phases)

    def part(self, begin: int, rows: int) -> "Replay":
        """Some rows of it, from one on, as a replay of its own."""
        cut = slice(begin, begin + rows)
        return Replay(
            episode_uuid=self.episode_uuid, calibration_epoch=self.calibration_epoch,
            phases=self.phases[cut], observations=self.observations[cut],
            actions=self.actions[cut], forces_n=self.forces_n[cut],
        )  # fmt: skip

    @cached_property
    def observation_rows(self) -> Array:
        """Observations. Shape (n, D_o)."""
        return np.array(self.observations, dtype=np.float64)

    @cached_property
    def action_rows(self) -> Array:
        """The operator's commands. Shape (n, 10)."""
        return np.array(self.actions, dtype=np.float64)

    def history(self, row: int, horizon: int) -> Array:
        """The last observations up to a row; the first is repeated. Shape (horizon, D_o)."""
        return self.observation_rows[np.maximum(np.arange(row - horizon + 1, row + 1), 0)]

    def commanded(self, row: int) -> Array:
        """The operator's last commands up to a row, oldest first. Shape (n, 10)."""
        back = np.arange(row - COMMANDS_AT_THE_BOUNDARY + 1, row + 1)
        return self.action_rows[np.maximum(back, 0)]
