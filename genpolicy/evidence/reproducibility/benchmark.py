"""Latency of each part of an invocation, cold and warm, on this machine.

Warm: the same loaded policy again and again. Cold: the checkpoint loaded anew and the caches
filled with other bytes before each invocation; the first cold one of a fresh process also pays
for everything that the process does once.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from genpolicy.candidates.contenders import joining_of
from genpolicy.candidates.joining import REAL_TIME, REPLACE, JoiningSettings
from genpolicy.candidates.votes import Prediction, Votes, join, prefix
from genpolicy.candidates.wire.policy import WirePolicy
from genpolicy.contract.action import join_action
from genpolicy.contract.chunk import Candidate, ChunkMetadata, Proposal
from genpolicy.contract.latency import Term
from genpolicy.policies.guidance import Prefix
from genpolicy.policies.policy import NetworkPolicy, load_policy
from genpolicy.policies.protocol import Policy
from genpolicy.policies.settings import SamplerConfig

Array = NDArray[np.float64]
Projection = Callable[[Proposal], object]
Temperature = Literal["cold", "warm"]

REPLACING = JoiningSettings()
CACHE_BYTES = 64 << 20
DISCARDED = 10
"""Invocations of a process before the first that is timed as warm."""


@dataclass(frozen=True)
class Measurement:
    """One timed component of one invocation.

    Attributes:
        component: Term of the latency.
        temperature: `cold` or `warm`.
        repeat: Which invocation of its temperature.
        seconds: Wall time, s.
    """

    component: str
    temperature: Temperature
    repeat: int
    seconds: float


def measure_policy(
    folder: Path,
    observations: Array,
    *,
    expected_sha256: str | None,
    sampler: SamplerConfig | None = None,
    device: str = "cpu",
    cold_repeats: int = 5,
    warm_repeats: int = 200,
    discarded_repeats: int = DISCARDED,
    candidates: int = 1,
    project: Projection | None = None,
    joining: JoiningSettings = REPLACING,
) -> list[Measurement]:
    """Time invocations component by component.

    Args:
        folder: Checkpoint folder.
        observations: Observations to take in turn, physical units. Shape (M, H_o, D_o).
        expected_sha256: Identity of the checkpoint.
        sampler: Sampler override.
        device: `cpu` or a CUDA device; timed up to the result on the host.
        cold_repeats: Cold invocations.
        warm_repeats: Warm invocations.
        discarded_repeats: Invocations between them that are not recorded.
        candidates: Candidates drawn by an invocation, as where it is deployed.
        project: Projection of a proposal; without it the term `project` stays unknown.
        joining: How chunks join where they are deployed.

    Returns:
        One measurement per component and invocation; an invocation's components share a repeat.
    """

    def load() -> NetworkPolicy:
        return load_policy(folder, expected_sha256=expected_sha256, sampler=sampler, device=device)

    results = []
    for repeat in range(cold_repeats):
        policy = load()
        _evict_caches(repeat)
        row = observations[repeat % len(observations)][None]
        spans = invoke(
            policy, row, repeat=repeat, candidates=candidates, project=project, joining=joining
        )
        results += [Measurement(name, "cold", repeat, value) for name, value in spans.items()]
    policy = load()
    for index in range(discarded_repeats + warm_repeats):
        row = observations[index % len(observations)][None]
        spans = invoke(
            policy, row, repeat=index, candidates=candidates, project=project, joining=joining
        )
        repeat = index - discarded_repeats
        if repeat >= 0:
            results += [Measurement(name, "warm", repeat, value) for name, value in spans.items()]
    return results


def measure_running(
    start: Callable[[], AbstractContextManager[WirePolicy]],
    observations: Array,
    *,
    warm_repeats: int,
    discarded_repeats: int = DISCARDED,
    candidates: int,
    project: Projection | None,
    joining: JoiningSettings,
) -> list[Measurement]:
    """The same of a policy behind the wire: the first answer of a new server is the cold one.

    Args:
        start: Starts the server, and ends it.
        observations: As in `measure_policy`.
        warm_repeats: Warm invocations.
        discarded_repeats: Invocations between the first and them that are not recorded.
        candidates: Candidates drawn by an invocation.
        project: Projection of a proposal.
        joining: How chunks of all methods join where they are deployed.
    """
    results = []
    with start() as policy:
        own = joining_of(joining, policy)
        _evict_caches(0)
        for index in range(-1 - discarded_repeats, warm_repeats):
            spans = invoke(
                policy, observations[index % len(observations)][None], repeat=index,
                candidates=candidates, project=project, joining=own,
            )  # fmt: skip
            temperature: Temperature = "warm" if index >= 0 else "cold"
            if index >= 0 or index == -1 - discarded_repeats:
                results += [
                    Measurement(name, temperature, max(index, 0), value)
                    for name, value in spans.items()
                ]
    return results


def invoke(
    policy: NetworkPolicy | WirePolicy,
    row: Array,
    *,
    repeat: int,
    candidates: int,
    project: Projection | None,
    joining: JoiningSettings = REPLACING,
) -> dict[str, float]:
    """Spans of one invocation, s; by a rule that joins, behind a plan that speaks for all it may.

    What that plan is takes no time here, and would have been drawn by the invocation before.
    """
    spans: dict[str, float] = {}
    metadata = _metadata(policy, repeat)
    reach = policy.horizons.execution_horizon - 1
    votes = (
        []
        if joining.rule == REPLACE
        else [_plan_before(metadata, policy.prediction_horizon, reach)]
    )
    asked = _Asked(row, repeat, candidates, _guided(policy, votes, joining))
    chunks = _drawn(policy, asked, spans)
    with _timed(spans, Term.SELECT):
        metadata = _metadata(policy, repeat)
        drawn = [Candidate(metadata, actions) for actions in chunks]
        proposal = join(drawn, 0, votes, joining)
    if project is not None:
        with _timed(spans, Term.PROJECT):
            project(proposal)
    return spans


@dataclass(frozen=True)
class _Asked:
    """One observation (1, H_o, D_o), which invocation, its candidates and what they go on from."""

    row: Array
    repeat: int
    candidates: int
    guided: Prefix | None


def _drawn(policy: NetworkPolicy | WirePolicy, asked: _Asked, spans: dict[str, float]) -> Array:
    """Chunks (N, K, D_a) of an observation, and what the terms of the model took."""
    name = ("latency", asked.repeat)
    if isinstance(policy, WirePolicy):
        terms, chunks = policy.timed(
            asked.row[0], noise=name, candidates=asked.candidates, prefix=asked.guided
        )
        spans.update({str(term): seconds for term, seconds in terms.items()})
        return chunks
    with _timed(spans, Term.PREPROCESS):
        normalised = policy.preprocess(asked.row)
    with _timed(spans, Term.ENCODE):
        condition = policy.encode(normalised)
        policy.synchronise()
    with _timed(spans, Term.SAMPLE):
        samples = policy.sample_encoded(
            condition, noise_names=[name], candidates=asked.candidates, prefix=asked.guided
        )
    own: Array = samples.actions[0]
    return own


@contextmanager
def _timed(spans: dict[str, float], term: Term) -> Iterator[None]:
    start = time.perf_counter()
    yield
    spans[str(term)] = time.perf_counter() - start


def _plan_before(metadata: ChunkMetadata, rows: int, reach: int) -> Votes:
    """A plan that began one period earlier, of which `reach` rows speak; what it says is no matter.

    It is not drawn: that would warm what a cold invocation pays for.
    """
    still = join_action(np.zeros((rows, 3)), np.broadcast_to(np.eye(3), (rows, 3, 3)), 0.0)
    shift = min(1, rows - 1)
    return Votes(Prediction("before", metadata, still, still), 0, min(reach, rows - shift), shift)


def _guided(policy: Policy, votes: list[Votes], joining: JoiningSettings) -> Prefix | None:
    if joining.rule != REAL_TIME:
        return None
    actions, weights = prefix(votes, rows=policy.prediction_horizon, frozen=1)
    return Prefix(actions[None], weights[None], joining.guidance)


def _evict_caches(fill: int) -> None:
    """Fill the processor's caches with other bytes."""
    np.full(CACHE_BYTES // 8, float(fill)).sum()


def _metadata(policy: Policy, repeat: int) -> ChunkMetadata:
    period_s = policy.horizons.action_period_s
    return ChunkMetadata(
        chunk_id=f"latency-{repeat}",
        condition_observation_event_time_s=0.0,
        policy_checkpoint_hash=policy.checkpoint_hash,
        sampler_config_hash=policy.sampler_config_hash,
        action_start_time_s=0.0,
        action_period_s=period_s,
        valid_until_s=period_s * policy.prediction_horizon,
        task_phase="benchmark",
        calibration_epoch="benchmark",
        predecessor_chunk_id="",
        session_epoch=0,
        method=policy.method,
        candidate_index=0,
    )
