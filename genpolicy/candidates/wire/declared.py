"""What nobody but its maker can say of a policy: a part of its entry."""

from pydantic import Field

from genpolicy.contract.settings import Settings

DIGEST = r"^[0-9a-f]{64}$"


class Choice(Settings):
    """A setting of the sampler that an entry lets be asked for, beside the one that is judged.

    Attributes:
        sampler: Name of the sampler.
        sampler_steps: Its steps.
        eta: Share of the ancestral noise; None of a sampler that has none.
        tolerance: Error of a step; None of a sampler that does not choose its steps.
        nfe_cap: Network evaluations after which a sample is given up; None likewise.
    """

    sampler: str = Field(min_length=1)
    sampler_steps: int = Field(ge=1)
    eta: float | None = None
    tolerance: float | None = None
    nfe_cap: int | None = None


class Declared(Settings):
    """What nobody but its maker can say of a policy, for the identity card of Gate B.

    Attributes:
        dataset: SHA-256 of the manifest of the dataset that it was trained on.
        split: SHA-256 of the split of that dataset, whose training part trained it: what
            `check-candidate` prints.
        training_seed: Root seed of its training.
        architecture: Encoder, trunk and head with their sizes.
        parameters: Of the network that runs.
        path: Noise schedule, or path between noise and action; that there is none.
        sampler: Name of the sampler.
        sampler_steps: Its steps.
        eta: Share of the ancestral noise; None of a sampler that has none.
        tolerance: Error of a step; None of a sampler that does not choose its steps.
        evaluations: Network evaluations of a sample, by the definition of the sampler.
        precision: Number format of weights and arithmetic.
        device: Where it runs.
        threads: Threads of its arithmetic.
        cpu_capability: Instruction set of its kernels.
        batch_rows: Rows of a network call.
    """

    dataset: str = Field(pattern=DIGEST)
    split: str = Field(pattern=DIGEST)
    training_seed: int
    architecture: str = Field(min_length=1)
    parameters: int = Field(ge=1)
    path: str = Field(min_length=1)
    sampler: str = Field(min_length=1)
    sampler_steps: int = Field(ge=1)
    eta: float | None = None
    tolerance: float | None = None
    evaluations: int = Field(ge=1)
    precision: str = Field(min_length=1)
    device: str = Field(min_length=1)
    threads: int = Field(ge=1)
    cpu_capability: str = Field(min_length=1)
    batch_rows: int = Field(ge=1)
