"""What is judged: a policy by name, with the files that are it and their identity."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from genpolicy.errors import ConfigError
from genpolicy.policies.checkpoint import load_checkpoint
from genpolicy.policies.determinism import require_device
from genpolicy.policies.policy import NetworkPolicy, load_policy
from genpolicy.policies.protocol import Policy
from genpolicy.policies.settings import SamplerConfig

BASELINES = "train_baselines"
GENERATORS = "train_generators"


@dataclass(frozen=True)
class JudgedPolicy:
    """One policy that is measured, compared or promoted.

    Attributes:
        name: Its name in every table.
        seed: Number of its training seed.
        folder: Its files.
        sha256: Its identity; `load` refuses other files.
        device: Torch device that it runs on, `compute.device`.
        kind: Where it comes from; `trained` here, with the training in `folder`'s config.
    """

    name: str
    seed: int
    folder: Path
    sha256: str
    device: str
    kind: Literal["trained"] = "trained"

    def load(self) -> NetworkPolicy:
        """The policy, from its files, on its device.

        Raises:
            ConfigError: This machine has no such device.
            IntegrityError: The files are not those of the identity.
            BadInputError: The files are missing or malformed.
        """
        return loaded_on(self.device, self.folder, sha256=self.sha256)


def loaded_on(device: str, folder: Path, *, sha256: str | None = None) -> NetworkPolicy:
    """A checkpoint on a device: the one way in which whoever asks a policy loads it.

    Args:
        device: Torch device.
        folder: Its files.
        sha256: Its identity, where it is known.

    Raises:
        ConfigError: This machine has no such device.
        IntegrityError: The files are not those of the identity.
        BadInputError: The files are missing or malformed.
    """
    require_device(device)
    return load_policy(folder, expected_sha256=sha256, device=device)


def sampling_by(policy: NetworkPolicy, sampler: SamplerConfig) -> NetworkPolicy:
    """The same weights on the same device, under another sampler."""
    return NetworkPolicy(policy.checkpoint, sampler=sampler, device=policy.device)


def candidates_of(policy: Policy, samples: int) -> int:
    """Candidates that an invocation draws: one of a policy that always draws the same."""
    return samples if policy.stochastic else 1


def trained(
    root: Path, names: Iterable[str], *, seeds: Iterable[int], device: str
) -> list[JudgedPolicy]:
    """Checkpoints `<name>/seed_<n>` below a root, names outermost.

    Args:
        root: Folder of a stage that trains.
        names: Whose.
        seeds: Numbers of the training seeds.
        device: Torch device that they run on.

    Raises:
        BadInputError: A checkpoint is missing or malformed.
    """
    numbers = list(seeds)
    found = []
    for name in names:
        for seed in numbers:
            folder = root / name / f"seed_{seed}"
            found.append(JudgedPolicy(name, seed, folder, load_checkpoint(folder).sha256, device))
    return found


def compared(
    artifacts: Path,
    *,
    baselines: Sequence[str],
    generators: Iterable[str],
    seed: int,
    device: str,
) -> list[JudgedPolicy]:
    """Baselines, then generators, of one training seed: who stands in the comparison.

    Args:
        artifacts: Folder of the stages' outputs.
        baselines: Simpler methods in it.
        generators: Candidates in it.
        seed: The training seed that is promoted.
        device: Torch device that they run on.

    Raises:
        ConfigError: A method stands on both sides; its rows could not be told apart.
        BadInputError: A checkpoint is missing or malformed.
    """
    candidates = list(generators)
    if twice := sorted({*baselines} & {*candidates}):
        raise ConfigError(
            where="params.yaml: stress.baselines",
            found=f"{', '.join(twice)}, also in train_generators.samplers",
            expected="each method on one side of the comparison",
            action="Let it stand for promotion or be what candidates are held against, not both.",
        )
    return [
        *trained(artifacts / BASELINES, baselines, seeds=[seed], device=device),
        *trained(artifacts / GENERATORS, candidates, seeds=[seed], device=device),
    ]
