"""Which part earns what: variants of one reference, measured on the same rows and situations.

The variants and their training: `genpolicy.policies.variants`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from genpolicy.candidates.judged import JudgedPolicy, sampling_by
from genpolicy.compute import map_shards
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.data.dataset import Dataset, load_dataset
from genpolicy.evidence.admission_context import make_checker
from genpolicy.evidence.need.effects import Compared, effect_rows
from genpolicy.evidence.need.held_out import held_out_situations, modes_of_policy
from genpolicy.evidence.need.offline import SPLITS
from genpolicy.evidence.rows.need import EffectRow, FactorErrorRow, FactorModeRow
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.integrity.rows import write_rows
from genpolicy.policies.matched_training import training_windows
from genpolicy.policies.offline import numbers_or_nan
from genpolicy.policies.policy import NetworkPolicy
from genpolicy.policies.settings import SamplerConfig
from genpolicy.policies.variants import Variant, reference_of, resolved
from genpolicy.tasks.api import load_task


@dataclass(frozen=True)
class FactorPlan:
    """What is measured of every variant.

    Attributes:
        task: Registered name of the task.
        dataset: Folder of the dataset.
        audit: Folder of the audit, which names the situations with several modes.
        horizons: Common horizons; a variant may see another H_o.
        feasibility: Thresholds of the six layers.
        variants: Variants by name, exactly one of them the reference.
        samplers: Samplers of the baselines, for variants that name none.
        conventions: Further samplers to measure a checkpoint with, by method and name.
        samples: Candidates per situation of a convention that draws.
        stride: Every so many held-out windows are compared.
        confidence: Coverage of the interval of an effect.
    """

    task: str
    dataset: Path
    audit: Path
    horizons: HorizonConfig
    feasibility: FeasibilitySettings
    variants: Mapping[str, Variant]
    samplers: Mapping[str, SamplerConfig]
    conventions: Mapping[str, Mapping[str, SamplerConfig]]
    samples: int
    stride: int
    confidence: float

    def samplers_of(self, name: str) -> dict[str, SamplerConfig]:
        """Samplers that a variant is measured with, its own first, by convention."""
        variant, own = resolved(self.variants, self.samplers)[name]
        return {own.name: own, **self.conventions.get(variant.method, {})}


@dataclass(frozen=True)
class FactorRows:
    """Rows of `errors.parquet` and `modes.parquet`."""

    errors: list[FactorErrorRow]
    modes: list[FactorModeRow]


def write_factors(
    plan: FactorPlan, trained: Sequence[JudgedPolicy], folder: Path, *, workers: int, scheduler: str
) -> None:
    """Measure all variants; write tables of errors, modes and effects.

    Args:
        plan: What to measure.
        trained: The checkpoint of every variant and seed, named as the variant.
        folder: Existing folder to write into.
        workers: Local processes.
        scheduler: `local` or the address of a Dask scheduler.

    Raises:
        ConfigError: Not exactly one reference, or a variant without a sampler.
    """
    reference = reference_of(plan.variants)
    jobs = [(plan, checkpoint) for checkpoint in trained]
    parts = map_shards(measure_variant, jobs, workers=workers, scheduler=scheduler)
    rows = FactorRows(
        [row for part in parts for row in part.errors],
        [row for part in parts for row in part.modes],
    )
    write_rows(folder / "errors.parquet", FactorErrorRow, rows.errors)
    write_rows(folder / "modes.parquet", FactorModeRow, rows.modes)
    write_rows(folder / "effects.parquet", EffectRow, effects(plan, rows, reference=reference))


def effects(plan: FactorPlan, rows: FactorRows, *, reference: str) -> list[EffectRow]:
    """Rows of `effects.parquet`: what each variant and convention changes, paired by episode."""
    base = (reference, next(iter(plan.samplers_of(reference))))
    return [
        row
        for name, variant in plan.variants.items()
        for convention in plan.samplers_of(name)
        for row in effect_rows(
            rows.errors,
            rows.modes,
            Compared(
                variant=name,
                convention=convention,
                factor=variant.factor,
                reference=base,
                error="first_error" if variant.factor == "temporal" else "chunk_error",
                confidence=plan.confidence,
            ),
        )
    ]


def measure_variant(job: tuple[FactorPlan, JudgedPolicy]) -> FactorRows:
    """Errors and modes of one checkpoint under each convention."""
    plan, trained = job
    data, own = load_dataset(plan.dataset), trained.load()
    task = load_task(plan.task)
    checker = make_checker(task, plan.feasibility, action_period_s=plan.horizons.action_period_s)
    # Not the checkpoint's own: a policy of one action is compared on the same windows.
    seen = {"observation_horizon": own.horizons.observation_horizon}
    horizons = plan.horizons.model_copy(update=seen)
    held_out = held_out_situations(plan.audit, data, horizons=horizons)
    factor = plan.variants[trained.name].factor
    found = FactorRows([], [])
    for convention, sampler in plan.samplers_of(trained.name).items():
        policy = sampling_by(own, sampler)
        errors = episode_errors(data, policy, horizons, stride=plan.stride)
        found.errors.extend(
            FactorErrorRow(trained.name, factor, trained.seed, convention, **asdict(item))
            for item in errors
        )
        modes = modes_of_policy(
            policy,
            held_out,
            seed=trained.seed,
            convention=convention,
            samples=plan.samples if policy.stochastic else 1,
            task=task,
            checker=checker,
        )
        found.modes.extend(FactorModeRow(trained.name, factor, **asdict(row)) for row in modes)
    return found


@dataclass(frozen=True)
class EpisodeError:
    """Error of one held-out episode; see `FactorErrorRow`."""

    split: str
    episode_uuid: str
    windows: int
    chunk_error: float
    first_error: float


def episode_errors(
    data: Dataset, policy: NetworkPolicy, horizons: HorizonConfig, *, stride: int
) -> list[EpisodeError]:
    """Errors of one sampled chunk per held-out window, mean per episode, normalised units.

    The error of the first action stands beside that of the chunk: it is what a policy of one
    action can be compared by. A chunk that is no numbers makes those of its episode NaN.
    """
    some, steps = slice(None, None, stride), policy.prediction_horizon
    scale = data.normalisation.action
    uuids = data.episodes["episode_uuid"].to_numpy()
    rows = []
    for split in SPLITS:
        cut = data.windows(
            split,
            observation_horizon=horizons.observation_horizon,
            prediction_horizon=horizons.prediction_horizon,
        )
        windows = training_windows(data, split, horizons)
        sampled = policy.sample(
            windows.observations[some],
            noise_names=[
                ("factors", int(e), int(i))
                for e, i in zip(cut.episode[some], cut.index[some], strict=True)
            ],
            candidates=1,
        )  # fmt: skip
        drawn = numbers_or_nan(sampled.actions[:, 0])
        target = scale.normalise(windows.actions[some, :steps])
        error = np.abs(scale.normalise(drawn) - target).mean(axis=2)
        counts = ~windows.is_pad[some, :steps]
        for episode in np.unique(cut.episode[some]):
            inside = cut.episode[some] == episode
            rows.append(
                EpisodeError(
                    split=split,
                    episode_uuid=str(uuids[episode]),
                    windows=int(inside.sum()),
                    chunk_error=float(error[inside][counts[inside]].mean()),
                    first_error=float(error[inside, 0].mean()),
                )
            )
    return rows
