"""The horizons: what conditions a chunk, how long it is, and how much of it is executed."""

from pydantic import Field, model_validator

from genpolicy.contract.settings import Settings
from genpolicy.errors import ConfigError


class HorizonConfig(Settings):
    """Horizons in action steps; the executed part never exceeds the predicted one.

    Attributes:
        observation_horizon: H_o, observations that condition one invocation.
        prediction_horizon: K, actions in one generated chunk.
        execution_horizon: H_e <= K, actions executed before re-planning.
        action_period_s: Time between actions, s.
    """

    observation_horizon: int = Field(le=64)
    prediction_horizon: int = Field(le=512)
    execution_horizon: int
    action_period_s: float = Field(gt=0.0, le=10.0)

    @model_validator(mode="after")
    def _ordered(self) -> "HorizonConfig":
        if self.observation_horizon < 1:
            _refuse("observation_horizon", self.observation_horizon, "at least 1")
        if self.execution_horizon < 1:
            _refuse("execution_horizon", self.execution_horizon, "at least 1")
        if self.prediction_horizon < self.execution_horizon:
            _refuse(
                "prediction_horizon",
                self.prediction_horizon,
                f"at least execution_horizon = {self.execution_horizon}",
            )
        return self

    def single_action(self) -> "HorizonConfig":
        """The same observations and period with K = H_e = 1, for methods without chunks."""
        return HorizonConfig(
            observation_horizon=self.observation_horizon,
            prediction_horizon=1,
            execution_horizon=1,
            action_period_s=self.action_period_s,
        )


def _refuse(field: str, found: int, expected: str) -> None:
    raise ConfigError(
        where=f"horizons.{field}",
        found=str(found),
        expected=expected,
        action="Correct the horizons in params.yaml; a chunk must cover what is executed of it.",
    )
