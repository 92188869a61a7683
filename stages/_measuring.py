"""Section `measure_baselines`, read by the stages that measure baselines and variants."""

from pydantic import Field

from genpolicy.contract.settings import Settings
from genpolicy.evidence.need.baselines import LatentTest
from genpolicy.policies.settings import SamplerConfig


class MeasureBaselinesSection(Settings):
    """Section `measure_baselines`.

    Attributes:
        conventions: Further samplers to count modes with, by method and name.
        samples: Candidates per held-out situation; latents of the latent's test.
        latent: Method whose latent is tested for depending on the observation, if any.
    """

    conventions: dict[str, dict[str, SamplerConfig]] = Field(default_factory=dict)
    samples: int = Field(ge=1)
    latent: LatentTest | None = None
