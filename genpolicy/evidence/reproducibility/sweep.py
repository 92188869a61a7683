"""The sweep: other samplers and steps of a candidate, what they draw and how long they take.

What is drawn comes back byte for byte and is counted in `reload`; times are measured in `latency`.
A row of either names the sampler's settings by hash, which joins them.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from genpolicy.candidates.answering import AnsweringPolicy
from genpolicy.candidates.contenders import Contender, Running, opened
from genpolicy.candidates.judged import candidates_of, sampling_by
from genpolicy.candidates.wire.policy import WirePolicy
from genpolicy.contract.action import POSITION
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.data.dataset import Dataset, load_dataset
from genpolicy.evidence.reproducibility.benchmark import invoke
from genpolicy.evidence.reproducibility.latency import OBSERVATIONS, LatencyPlan
from genpolicy.evidence.reproducibility.measure import in_fresh_process
from genpolicy.evidence.reproducibility.swept import Sweep, beside_steps, swept_samplers
from genpolicy.evidence.rows.need import ModeRow
from genpolicy.evidence.rows.reproducibility import CoverageRow, SweepLatencyRow
from genpolicy.policies.fixtures import fixture_observations
from genpolicy.policies.matched_training import training_windows
from genpolicy.policies.ode_samplers import ADAPTIVE_TABLEAUS
from genpolicy.policies.policy import NetworkPolicy
from genpolicy.policies.protocol import NoiseName, Policy
from genpolicy.policies.settings import SamplerConfig
from genpolicy.policies.windows import Windows
from genpolicy.progress import counting
from genpolicy.statistics.intervals import clopper_pearson
from genpolicy.tasks.api import load_task

SPLIT, WINDOWS = "test", 256
JERK_LEVEL = 0.95
REPEATS, DISCARDED = 40, 3


@dataclass(frozen=True)
class Quality:
    """What one sampler draws on held-out windows.

    Attributes:
        chunk_error: Mean absolute error of the actions that are not padding, normalised units;
            NaN where a chunk is no numbers, since a mean over the others would flatter.
        jerk_p95_m_s3: Over chunks, of the largest jerk of the positions inside one, m/s^3; NaN
            there too.
        nonfinite: Chunks that hold a number that is none, or never came.
        given_up: Of these, those that were given up at the sampler's cap.
    """

    chunk_error: float
    jerk_p95_m_s3: float
    nonfinite: int
    given_up: int = 0


def swept_windows(data: Dataset, horizons: HorizonConfig) -> Windows:
    """Evenly spaced held-out windows that every sampler of the sweep answers."""
    whole = training_windows(data, SPLIT, horizons)
    count = len(whole.observations)
    rows = np.unique(np.linspace(0, count - 1, num=min(WINDOWS, count)).round().astype(np.int64))
    return Windows(whole.observations[rows], whole.actions[rows], whole.is_pad[rows])


def quality_of(policy: Policy, windows: Windows, data: Dataset) -> Quality:
    """One candidate per window, against the demonstrated chunk and in itself.

    The jerk is that of the chunk as it is drawn, before projection and without the boundary to
    the last command, which Gate C judges.
    """
    horizon = policy.prediction_horizon
    names: list[NoiseName] = [("sweep", row) for row in range(len(windows.observations))]
    before = _given_up(policy)
    drawn = policy.sample(windows.observations, noise_names=names, candidates=1).actions[:, 0]
    if diverged := int((~np.isfinite(drawn)).any(axis=(1, 2)).sum()):
        return Quality(math.nan, math.nan, diverged, _given_up(policy) - before)
    scale, wanted = data.normalisation.action, windows.actions[:, :horizon]
    error = np.abs(scale.normalise(drawn) - scale.normalise(wanted)).mean(axis=-1)
    return Quality(
        chunk_error=float(error[~windows.is_pad[:, :horizon]].mean()),
        jerk_p95_m_s3=jerk_p95_m_s3(
            drawn[:, :, POSITION], period_s=policy.horizons.action_period_s
        ),
        nonfinite=0,
    )


def jerk_p95_m_s3(path_m: NDArray[np.float64], *, period_s: float) -> float:
    """p95 over chunks of the largest third difference of positions (B, K, 3) over the period.

    Zero where a chunk has fewer than four actions, which have none.
    """
    if path_m.shape[1] < 4:
        return 0.0
    jerk = np.linalg.norm(np.diff(path_m, n=3, axis=1), axis=-1).max(axis=1) / period_s**3
    return float(np.quantile(jerk, JERK_LEVEL, method="higher"))


def coverage_row(
    found: Sequence[ModeRow], *, sampler: SamplerConfig, quality: Quality
) -> CoverageRow:
    """One row of `coverage.parquet` from the modes of every situation, at least one."""
    adaptive = sampler.name in ADAPTIVE_TABLEAUS
    return drawn_by(
        found, steps=sampler.steps, sampler_sha256=sampler.hash(), settings=beside_steps(sampler),
        tolerance=sampler.tolerance if adaptive else None, quality=quality,
    )  # fmt: skip


def drawn_by(
    found: Sequence[ModeRow],
    *,
    steps: int,
    sampler_sha256: str,
    settings: str,
    tolerance: float | None,
    quality: Quality,
) -> CoverageRow:
    """The same, of a sampler that is known by its steps, its settings and their hash."""
    whole = sum(row.modes_covered == row.modes_present for row in found)
    drawn = sum(row.samples for row in found)
    return CoverageRow(
        method=found[0].method,
        seed=found[0].seed,
        sampler=found[0].convention,
        steps=steps,
        sampler_sha256=sampler_sha256,
        settings=settings,
        tolerance=tolerance,
        nfe=max(row.nfe for row in found),
        situations=len(found),
        modes_covered_share=whole / len(found),
        coverage_lower=clopper_pearson(whole, len(found))[0],
        spread_m=float(np.mean([row.spread_m for row in found])),
        admissible_share=sum(row.admissible for row in found) / drawn,
        between_share=sum(row.between_modes for row in found) / drawn,
        chunk_error=quality.chunk_error,
        jerk_p95_m_s3=quality.jerk_p95_m_s3,
        nonfinite=quality.nonfinite,
        given_up=quality.given_up,
    )


def sweep_latency_rows(
    plan: LatencyPlan, policies: Sequence[Contender], sweep: Sweep
) -> list[SweepLatencyRow]:
    """What an invocation of each candidate takes with each sampler of its sweep.

    Who was brought has one setting, that of its entry, and stands on the front beside the others.
    """
    return [
        row
        for turn in counting(len(policies), "timed sweeps")
        for row in in_fresh_process(
            measure_sweep, plan, policies[turn], sweep.get(policies[turn].name, ())
        )
    ]


def measure_sweep(
    plan: LatencyPlan, judged: Contender, sweep: Sequence[int | SamplerConfig]
) -> list[SweepLatencyRow]:
    """Rows of one method, measured in this process; samplers take turns, call by call."""
    data = load_dataset(plan.dataset)
    seen = fixture_observations(data, horizons=plan.horizons, count=OBSERVATIONS)
    scene = load_task(plan.task).scene_path
    with opened(judged, data.observation_contract, scene=scene) as own:
        policies: list[Running] = [own]
        if isinstance(own, NetworkPolicy):
            tried = swept_samplers(own.sampler, sweep)
            policies = [AnsweringPolicy(sampling_by(own, sampler)) for sampler in tried]
        elif isinstance(own, WirePolicy):
            policies += [own.sampling_by(name) for name in own.samplers]
        return _in_turns(plan, judged.name, policies, seen)


def _given_up(policy: Policy) -> int:
    """Invocations so far that a sampler gave up at its cap."""
    return policy.given_up if isinstance(policy, AnsweringPolicy) else 0


def _faults(policy: Running) -> int:
    """Invocations without an answer: a fault or a cap; neither takes a time that counts."""
    faults = sum(policy.faults.values()) if isinstance(policy, WirePolicy) else 0
    return faults + _given_up(policy)


def _in_turns(
    plan: LatencyPlan, name: str, policies: Sequence[Running], seen: NDArray[np.float64]
) -> list[SweepLatencyRow]:
    rows = []
    for repeat in range(-DISCARDED, REPEATS):
        row = seen[repeat % len(seen)][None]
        for policy in policies:
            count = candidates_of(policy, plan.samples)
            before = _faults(policy)
            spans = invoke(policy, row, repeat=repeat, candidates=count)
            if repeat >= 0 and _faults(policy) == before:
                rows.append(
                    SweepLatencyRow(
                        method=name,
                        sampler_sha256=policy.sampler_config_hash,
                        candidates=count,
                        repeat=repeat,
                        # A term that nobody measures is in the term `sample`.
                        seconds=float(np.nansum(list(spans.values()))),
                    )
                )
    return rows
