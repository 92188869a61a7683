"""Latency of each part of an invocation, cold and warm, on this machine.

Warm: the same loaded policy again and again. Cold: the checkpoint loaded anew and the caches
filled with other bytes before each invocation; the first cold one of a fresh process also pays
for everything that the process does once.
"""

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from genpolicy.candidates.answering import AnsweringPolicy
from genpolicy.candidates.contenders import Running, joining_of
from genpolicy.candidates.joining import DRAWN_ON, REPLACE, JoiningSettings
from genpolicy.candidates.planned import PlannerPolicy
from genpolicy.candidates.votes import Prediction, Votes, join, prefix, rest_of_plan
from genpolicy.candidates.wire.policy import WirePolicy
from genpolicy.contract.action import join_action
from genpolicy.contract.chunk import Candidate, ChunkMetadata, Proposal
from genpolicy.contract.latency import Term
from genpolicy.evidence.reproducibility.processor import run_queue
from genpolicy.evidence.reproducibility.spans import Span, SpanClock
from genpolicy.policies.policy import NetworkPolicy, load_policy
from genpolicy.policies.prefix import Prefix
from genpolicy.policies.protocol import Policy
from genpolicy.policies.settings import SamplerConfig

Array = NDArray[np.float64]
Projection = Callable[[Proposal, int], object]
"""What becomes of a proposal; the number of the observation that it was drawn for comes with it."""
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
        waited_s: How much of it the call could have run and had no processor, s; None where nobody
            knows, as of what another process does.
    """

    component: str
    temperature: Temperature
    repeat: int
    seconds: float
    waited_s: float | None


def measure_policy(
    folder: Path,
    observations: Array,
    *,
    expected_sha256: str | None,
    sampler: SamplerConfig | None = None,
    device: str,
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
        policy = load_policy(
            folder, expected_sha256=expected_sha256, sampler=sampler, device=device
        )
        return AnsweringPolicy(policy)

    return measure_loaded(
        load,
        observations,
        cold_repeats=cold_repeats,
        warm_repeats=warm_repeats,
        discarded_repeats=discarded_repeats,
        candidates=candidates,
        project=project,
        joining=joining,
    )


def measure_loaded(
    load: Callable[[], NetworkPolicy | PlannerPolicy],
    observations: Array,
    *,
    cold_repeats: int,
    warm_repeats: int,
    discarded_repeats: int = DISCARDED,
    candidates: int,
    project: Projection | None,
    joining: JoiningSettings,
) -> list[Measurement]:
    """The same of whatever `load` gives, anew before each cold invocation."""
    results = []
    with run_queue() as queue:

        def timed(policy: NetworkPolicy | PlannerPolicy, index: int) -> dict[str, Span]:
            asked = _asked(observations, index, candidates)
            return _spans(SpanClock(queue), policy, asked, project, joining)

        for repeat in range(cold_repeats):
            policy = load()
            _evict_caches(repeat)
            results += _measurements("cold", repeat, timed(policy, repeat))
        policy = load()
        for index in range(discarded_repeats + warm_repeats):
            spans, repeat = timed(policy, index), index - discarded_repeats
            if repeat >= 0:
                results += _measurements("warm", repeat, spans)
    return results


def _measurements(
    temperature: Temperature, repeat: int, spans: dict[str, Span]
) -> list[Measurement]:
    return [
        Measurement(name, temperature, repeat, span.seconds, span.waited_s)
        for name, span in spans.items()
    ]


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

    Of waiting nothing is known: what the server does, and what it takes from us, is its own.

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
            asked = _asked(observations, index, candidates)
            spans = _spans(SpanClock(), policy, asked, project, own)
            temperature: Temperature = "warm" if index >= 0 else "cold"
            if index >= 0 or index == -1 - discarded_repeats:
                results += _measurements(temperature, max(index, 0), spans)
    return results


def invoke(
    policy: Running,
    row: Array,
    *,
    repeat: int,
    candidates: int,
    joining: JoiningSettings = REPLACING,
) -> dict[str, float]:
    """What the terms of an invocation took up to its selection, s; behind a plan, if it joins.

    That plan speaks for all that it may; what it is takes no time here, and would have been drawn
    by the invocation before.
    """
    asked = _Asked(row, 0, repeat, candidates)
    spans = _spans(SpanClock(), policy, asked, None, joining)
    return {name: span.seconds for name, span in spans.items()}


@dataclass(frozen=True)
class _Asked:
    """One observation (1, H_o, D_o), its number, which invocation, and how many candidates."""

    row: Array
    place: int
    repeat: int
    candidates: int


def _asked(observations: Array, repeat: int, candidates: int) -> _Asked:
    """Observations are taken in turn."""
    place = repeat % len(observations)
    return _Asked(observations[place][None], place, repeat, candidates)


def _spans(
    clock: SpanClock,
    policy: Running,
    asked: _Asked,
    project: Projection | None,
    joining: JoiningSettings,
) -> dict[str, Span]:
    metadata = _metadata(policy, asked.repeat)
    reach = policy.horizons.execution_horizon - 1
    votes = (
        []
        if joining.rule == REPLACE
        else [_plan_before(metadata, policy.prediction_horizon, reach)]
    )
    chunks = _drawn(clock, policy, asked, _guided(policy, votes, joining))
    with clock.timed(Term.SELECT):
        metadata = _metadata(policy, asked.repeat)
        drawn = [Candidate(metadata, actions) for actions in chunks]
        proposal = join(drawn, 0, votes, joining)
    if project is not None:
        with clock.timed(Term.PROJECT):
            project(proposal, asked.place)
    return clock.spans


def _drawn(clock: SpanClock, policy: Running, asked: _Asked, guided: Prefix | None) -> Array:
    """Chunks (N, K, D_a) of an observation, and what the terms of the model took."""
    name = ("latency", asked.repeat)
    if isinstance(policy, WirePolicy):
        terms, chunks = policy.timed(
            asked.row[0], noise=name, candidates=asked.candidates, prefix=guided
        )
        clock.spans.update({str(term): Span(seconds, None) for term, seconds in terms.items()})
        return chunks
    if isinstance(policy, PlannerPolicy):
        return _planned(clock, policy, asked)
    with clock.timed(Term.PREPROCESS):
        normalised = policy.preprocess(asked.row)
    with clock.timed(Term.ENCODE):
        condition = policy.encode(normalised)
        policy.synchronise()
    with clock.timed(Term.SAMPLE):
        samples = policy.sample_encoded(
            condition, noise_names=[name], candidates=asked.candidates, prefix=guided
        )
    own: Array = samples.actions[0]
    return own


def _planned(clock: SpanClock, policy: PlannerPolicy, asked: _Asked) -> Array:
    """Chunks (N, K, D_a) of a planner: it plans where others sample, and encodes nothing."""
    with clock.timed(Term.PREPROCESS):
        checked = policy.preprocess(asked.row)
    with clock.timed(Term.ENCODE):
        pass
    with clock.timed(Term.SAMPLE):
        chunks = policy.plan(checked)
    return np.repeat(chunks, asked.candidates, axis=0)


def _plan_before(metadata: ChunkMetadata, rows: int, reach: int) -> Votes:
    """A plan that began one period earlier, of which `reach` rows speak; what it says is no matter.

    It is not drawn: that would warm what a cold invocation pays for.
    """
    still = join_action(np.zeros((rows, 3)), np.broadcast_to(np.eye(3), (rows, 3, 3)), 0.0)
    shift = min(1, rows - 1)
    return Votes(Prediction("before", metadata, still, still), 0, min(reach, rows - shift), shift)


def _guided(policy: Policy, votes: list[Votes], joining: JoiningSettings) -> Prefix | None:
    if joining.rule not in DRAWN_ON:
        return None
    rows = policy.prediction_horizon
    if joining.starts_at is not None:
        actions, weights = rest_of_plan(votes, rows=rows)
    else:
        actions, weights = prefix(votes, rows=rows, frozen=1)
    return Prefix(actions[None], weights[None], joining.guidance, joining.starts_at)


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
