"""What the baselines reach on held-out data: errors, modes, and what a latent depends on.

Before anything is counted, each is drawn from twice under the same key: what comes out differently
cannot be made again, and nothing that is measured with it proves anything.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from genpolicy.candidates.judged import JudgedPolicy, sampling_by
from genpolicy.compute import map_shards
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.settings import Settings
from genpolicy.data.dataset import load_dataset
from genpolicy.errors import ContractError
from genpolicy.evidence.admission_context import make_checker
from genpolicy.evidence.documents.need import LATENT, LatentDependence
from genpolicy.evidence.need.held_out import HeldOut, held_out_situations, modes_of_policy
from genpolicy.evidence.need.latent import latent_dependence
from genpolicy.evidence.need.offline import offline_rows
from genpolicy.evidence.rows.need import ModeRow, OfflineRow
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.integrity.rows import write_rows
from genpolicy.policies.policy import NetworkPolicy
from genpolicy.policies.protocol import Policy
from genpolicy.policies.settings import SamplerConfig
from genpolicy.tasks.api import load_task

DRAWN_TWICE = 4
"""Situations at which each policy is drawn from twice."""
Measured = tuple[list[OfflineRow], list[ModeRow], list[LatentDependence]]


class LatentTest(Settings):
    """What is asked of a latent: whether its samples depend on the observation.

    Attributes:
        method: Method with a latent.
        convention: The convention of `conventions` that draws it.
        permutations: Permutations of the test.
    """

    method: str
    convention: str
    permutations: int


@dataclass(frozen=True)
class BaselinePlan:
    """What is measured of every baseline.

    Attributes:
        task: Registered name of the task.
        dataset: Folder of the dataset.
        audit: Folder of the audit, which names the situations with several modes.
        horizons: Common horizons.
        feasibility: Thresholds of the six layers.
        conventions: Further samplers to count modes with, by method and name.
        samples: Candidates per situation; of the latent's test, latents.
        latent: Method whose latent is tested; None tests none.
        root_seed: Root seed.
    """

    task: str
    dataset: Path
    audit: Path
    horizons: HorizonConfig
    feasibility: FeasibilitySettings
    conventions: Mapping[str, Mapping[str, SamplerConfig]]
    samples: int
    latent: LatentTest | None
    root_seed: int


def write_baselines(
    plan: BaselinePlan,
    baselines: Sequence[JudgedPolicy],
    folder: Path,
    *,
    workers: int,
    scheduler: str,
) -> None:
    """Measure every baseline in a process of its own; write the tables and `latent.json`."""
    jobs = [(plan, baseline) for baseline in baselines]
    parts = map_shards(measure_baseline, jobs, workers=workers, scheduler=scheduler)
    offline = [row for part in parts for row in part[0]]
    modes = [row for part in parts for row in part[1]]
    latent = [row for part in parts for row in part[2]]
    write_rows(folder / "offline.parquet", OfflineRow, offline)
    write_rows(folder / "modes.parquet", ModeRow, modes)
    LATENT.write(folder, latent)


def measure_baseline(job: tuple[BaselinePlan, JudgedPolicy]) -> Measured:
    """Rows of `offline.parquet`, `modes.parquet` and `latent.json` of one baseline."""
    plan, baseline = job
    data, policy = load_dataset(plan.dataset), baseline.load()
    held_out = held_out_situations(plan.audit, data, horizons=plan.horizons)
    return (
        offline_rows(policy, data, seed=baseline.seed, horizons=plan.horizons),
        mode_rows(plan, policy, held_out, seed=baseline.seed),
        latent_rows(plan, policy, held_out, seed=baseline.seed),
    )


def mode_rows(
    plan: BaselinePlan, policy: NetworkPolicy, held_out: HeldOut, *, seed: int
) -> list[ModeRow]:
    """Modes that one checkpoint reaches, under each sampling convention.

    Raises:
        ContractError: A sample is another one when it is drawn again under the same key.
    """
    task = load_task(plan.task)
    checker = make_checker(task, plan.feasibility, action_period_s=plan.horizons.action_period_s)
    conventions = {policy.sampler.name: policy.sampler, **plan.conventions.get(policy.method, {})}
    for convention, sampler in conventions.items():
        require_repeatable(sampling_by(policy, sampler), held_out, convention)
    return [
        row
        for convention, sampler in conventions.items()
        for row in modes_of_policy(
            sampling_by(policy, sampler),
            held_out,
            seed=seed,
            convention=convention,
            samples=plan.samples,
            task=task,
            checker=checker,
        )
    ]


def require_repeatable(policy: Policy, held_out: HeldOut, convention: str) -> None:
    """Refuse a policy whose noise is no function of its key.

    Raises:
        ContractError: A sample is another one when it is drawn again under the same key.
    """
    seen = held_out.observations[:DRAWN_TWICE]
    if not len(seen):
        return
    names = [("drawn twice", row) for row in range(len(seen))]
    first, again = (policy.sample(seen, noise_names=names, candidates=2).actions for _ in range(2))
    if np.array_equal(first, again, equal_nan=True):
        return
    raise ContractError(
        where=f"samples of {policy.method} drawn by {convention}",
        found=f"others when drawn again under the same key, by up to "
        f"{np.nanmax(np.abs(first - again)):.3g}",
        expected="the same bits, since noise is a function of its key",
        action="Draw noise with genpolicy.seeds.counter_noise; nothing measured without a key can "
        "be made again.",
    )


def latent_rows(
    plan: BaselinePlan, policy: NetworkPolicy, held_out: HeldOut, *, seed: int
) -> list[LatentDependence]:
    """Whether the tested method's latent depends on the observation; nothing for the others."""
    test = plan.latent
    if test is None or test.method != policy.method or len(held_out.situations) < 2:
        return []
    found = latent_dependence(
        sampling_by(policy, plan.conventions[test.method][test.convention]),
        held_out,
        samples=plan.samples,
        permutations=test.permutations,
        root_seed=plan.root_seed,
    )
    return [
        LatentDependence(**vars(found), method=policy.method, convention=test.convention, seed=seed)
    ]
