"""What is asked of one training."""

from dataclasses import dataclass

from genpolicy.contract.horizons import HorizonConfig
from genpolicy.policies.checkpoint import Provenance
from genpolicy.policies.normalisation import Normalisation
from genpolicy.policies.settings import HeadConfig, NetworkConfig, SamplerConfig, TrainingConfig


@dataclass(frozen=True)
class TrainingRequest:
    """Everything that decides the bytes of a checkpoint.

    Attributes:
        method: Registered name.
        horizons: Common horizons; `bc` shortens them to one action itself.
        normalisation: Statistics of the training split.
        network: Sizes, equal for all methods.
        head: Head settings.
        training: Optimisation, equal for all methods.
        sampler: Sampler that the checkpoint will name as its own.
        provenance: Dataset and contracts.
        seed: Root seed of this training.
        phase_columns: Numbers of an observation that name the phase.
        keep_earlier: Whether the averaged weights at three quarters of the training are kept.
    """

    method: str
    horizons: HorizonConfig
    normalisation: Normalisation
    network: NetworkConfig
    head: HeadConfig
    training: TrainingConfig
    sampler: SamplerConfig
    provenance: Provenance
    seed: int
    phase_columns: tuple[int, ...] = ()
    keep_earlier: bool = False
