"""What `baselines` and `generators` share: one matched study each, from their sections."""

from pydantic import Field

from genpolicy.contract.settings import Settings
from genpolicy.evidence.need.study import LatentTest, Study
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.policies.matched_training import PolicySettings
from genpolicy.policies.settings import SamplerConfig
from stages._stage import Params


class StudySection(Settings):
    """Section `baselines` or `generators`.

    Attributes:
        samplers: Methods, and the sampler of each.
        conventions: Further samplers to count modes with, by method and name.
        latent: Method whose latent is tested for depending on the observation, if any.
        samples: Candidates per held-out situation.
        fixtures: Observations whose samples must be reproduced after reload.
    """

    samplers: dict[str, SamplerConfig]
    conventions: dict[str, dict[str, SamplerConfig]] = Field(default_factory=dict)
    latent: LatentTest | None = None
    samples: int
    fixtures: int


def study_of(params: Params, section: StudySection) -> Study:
    """The study that a section describes, with the shared sections of `params.yaml`."""
    return Study(
        task=params.task.name,
        samplers=section.samplers,
        conventions=section.conventions,
        settings=params.section("policy", PolicySettings),
        horizons=params.horizons,
        feasibility=params.section("feasibility", FeasibilitySettings),
        latent=section.latent,
        samples=section.samples,
        fixtures=section.fixtures,
        root_seed=params.seed,
        device=params.compute.device,
        workers=params.compute.workers,
        scheduler=params.compute.scheduler,
    )
