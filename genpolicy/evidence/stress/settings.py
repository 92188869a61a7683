"""Section `stress`: the matched comparison, registered before it runs."""

from pydantic import Field

from genpolicy.contract.settings import Settings
from genpolicy.evidence.stress.perturbations import Perturbation


class StressSettings(Settings):
    """Section `stress`.

    Attributes:
        starts: Initial states, equal for all methods.
        episode_limit_s: Longest rollout.
        samples: Candidates per invocation of a stochastic method.
        baselines: Simpler methods in the comparison, timed and run beside the candidates.
        perturbations: What is injected, by name; `nominal` is one of them.
        margin: Pre-registered gain in success.
        alpha: Pre-registered family-wise error; each candidate gets its equal share.
    """

    starts: int = Field(ge=1)
    episode_limit_s: float = Field(gt=0)
    samples: int = Field(ge=1)
    baselines: list[str]
    perturbations: dict[str, Perturbation]
    margin: float
    alpha: float = Field(gt=0.0, lt=1.0)

    def alpha_of_each(self, candidates: int) -> float:
        """Error that one of so many pre-registered candidates may spend (Bonferroni)."""
        return self.alpha / candidates
