"""Gate B's evidence of a policy that was brought: does it answer, and again the same?

It is started twice. Between the two nothing is left of it, and the second time it is asked in the
opposite order: what depends on who was asked before, or on a seed of its own, answers otherwise.
A third start has other threads, and is asked alone, beside others and in another order.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from genpolicy.candidates import selector
from genpolicy.candidates.brought import BroughtPolicy
from genpolicy.candidates.conformance.recorded_starts import recorded_starts
from genpolicy.candidates.contenders import joining_of
from genpolicy.candidates.wire.entry import Entry
from genpolicy.candidates.wire.faults import Fault
from genpolicy.candidates.wire.policy import WirePolicy, running
from genpolicy.contract.chunk import actions_sha256
from genpolicy.data.dataset import Dataset
from genpolicy.evidence.documents.brought import Failed
from genpolicy.evidence.documents.conformance import Conformance
from genpolicy.evidence.documents.reproducibility import CandidateIdentity, IdentityCard
from genpolicy.evidence.fixtures_again import brought_fixtures, fixture_name
from genpolicy.evidence.need.held_out import HeldOut, modes_of_policy
from genpolicy.evidence.reproducibility.benchmark import DISCARDED
from genpolicy.evidence.reproducibility.conformance import (
    answer_rows,
    conformance_of,
    drawn,
    first_session,
    second_session,
)
from genpolicy.evidence.reproducibility.identity import Deployment, invocation_rate_hz, rule_sha256
from genpolicy.evidence.reproducibility.sweep import drawn_by, quality_of, swept_windows
from genpolicy.evidence.reproducibility.swept import told_apart
from genpolicy.evidence.reproducibility.variations import wire_otherwise
from genpolicy.evidence.rows.brought import AnswerRow
from genpolicy.evidence.rows.need import ModeRow
from genpolicy.evidence.rows.reproducibility import (
    CoverageRow,
    NfeRow,
    SampleRow,
    VariationRow,
)
from genpolicy.feasibility.admission import FeasibilityChecker
from genpolicy.policies.fixtures import CANDIDATES
from genpolicy.tasks.api import Task

Array = NDArray[np.float64]

UNSAID = "unsaid"


@dataclass(frozen=True)
class Asked:
    """What everybody who was brought is asked.

    Attributes:
        data: The dataset.
        task: The task.
        checker: The six layers.
        held_out: Two-mode situations.
        samples: Candidates per situation.
        deployment: Horizons, deadline and candidates of an invocation.
        root_seed: Of the recorded moments.
    """

    data: Dataset
    task: Task
    checker: FeasibilityChecker
    held_out: HeldOut
    samples: int
    deployment: Deployment
    root_seed: int


@dataclass
class Answered:
    """What one of them answered.

    Attributes:
        identity: What pins and names it.
        failed: Its faults.
        conformance: What its answers at recorded moments say.
        answers: These answers.
        samples: Fixtures, before and after the new start.
        variations: The same asked for in other ways.
        nfe: Counted network evaluations; empty where its server does not count.
        modes: Two-mode situations.
        coverage: The same in one row, where a sampler is declared; and one of each further setting.
    """

    identity: CandidateIdentity
    failed: Failed
    conformance: Conformance
    answers: list[AnswerRow] = field(default_factory=list)
    samples: list[SampleRow] = field(default_factory=list)
    variations: list[VariationRow] = field(default_factory=list)
    nfe: list[NfeRow] = field(default_factory=list)
    modes: list[ModeRow] = field(default_factory=list)
    coverage: list[CoverageRow] = field(default_factory=list)


@dataclass(frozen=True)
class _Session:
    """Fixtures of one start. Shape (F, N, K, D_a), evaluations, and what it told of itself."""

    chunks: Array
    evaluations: int
    told: object


def ask_brought(candidate: BroughtPolicy, asked: Asked) -> Answered:
    """Start it, ask, end it, start it again, ask again; a server that does not start answers none.

    Raises:
        IntegrityError: A file of it is another one.
        ConfigError: Its program is not there.
    """
    seen = brought_fixtures(asked.data, asked.deployment.horizons)
    contract = asked.data.observation_contract
    starts = recorded_starts(asked.data, asked.deployment.horizons, seed=asked.root_seed)
    with running(candidate, contract, scene=asked.task.scene_path) as policy:
        own = replace(asked.deployment, joining=joining_of(asked.deployment.joining, policy))
        first = _fixtures(policy, seen, range(len(seen)))
        modes = modes_of_policy(
            policy, asked.held_out, seed=candidate.seed, convention=_sampler(candidate.entry),
            samples=asked.samples, task=asked.task, checker=asked.checker,
        )  # fmt: skip
        coverage = _coverage(policy, candidate, asked, modes)
        session, told = first_session(policy, starts), policy.told
    before = policy
    with running(candidate, contract, scene=asked.task.scene_path) as policy:
        again = _fixtures(policy, seen, range(len(seen))[::-1])
        # What somebody else runs is not started anew by us, and nothing is known of that.
        anew = second_session(policy, starts, session) if candidate.entry.started_here else None
    failed = _failed(before, policy)
    # On a start of its own too: how it fares otherwise is no fault of who is asked as declared.
    varied = wire_otherwise(candidate, contract, seen, first.chunks, scene=asked.task.scene_path)
    if candidate.entry.samplers:
        # Behind all that is judged, on a start of its own: one of these settings may hang or die.
        with running(candidate, contract, scene=asked.task.scene_path) as further:
            coverage = coverage + _swept(further, candidate, asked)
    broken = sum(failed.faults.values())
    number = drawn(stochastic=candidate.entry.stochastic)
    # Chunks that came and hold a number that is none, beside questions that got no chunk.
    broken += int((~np.isfinite(first.chunks)).any(axis=(2, 3)).sum())
    return Answered(
        identity=_identity(candidate, own, broken, int(first.told != again.told)),
        failed=failed,
        conformance=conformance_of(starts, told, session, anew, candidates=number),
        answers=answer_rows(candidate.name, starts, session, anew),
        samples=_compared(candidate, first.chunks, again.chunks),
        variations=varied.rows(candidate.name, seed=candidate.seed, device=_device(candidate)),
        nfe=_evaluations(candidate, first.evaluations, again.evaluations),
        modes=modes,
        coverage=coverage,
    )


def _failed(*starts: WirePolicy) -> Failed:
    """Faults over all starts; the last words are those of the last that failed."""
    counted = sum((policy.faults for policy in starts), Counter[Fault]())
    words = [policy.last_words for policy in starts if policy.last_words]
    return Failed(
        asked=sum(policy.asked for policy in starts),
        faults={str(kind): number for kind, number in sorted(counted.items())},
        last_words=words[-1] if words else "",
    )


def _fixtures(policy: WirePolicy, seen: Array, order: Sequence[int]) -> _Session:
    parts, evaluations = {}, 0
    for row in order:
        drawn = policy.sample(
            seen[row][None], noise_names=[fixture_name(row)], candidates=CANDIDATES
        )
        parts[row] = drawn.actions[0]
        evaluations = max(evaluations, drawn.nfe)
    return _Session(np.stack([parts[row] for row in sorted(parts)]), evaluations, policy.told)


def _compared(candidate: BroughtPolicy, first: Array, again: Array) -> list[SampleRow]:
    return [
        SampleRow(
            method=candidate.name,
            seed=candidate.seed,
            device=_device(candidate),
            row=row,
            sha256_trained=actions_sha256(before),
            sha256_reloaded=actions_sha256(after),
            max_abs_difference=float(np.abs(before - after).max()),
        )
        for row, (before, after) in enumerate(zip(first, again, strict=True))
    ]


def _device(candidate: BroughtPolicy) -> str:
    declared = candidate.entry.declared
    return declared.device if declared else ""


def _evaluations(candidate: BroughtPolicy, first: int, again: int) -> list[NfeRow]:
    """One row where it is counted and declared; else nothing is known."""
    declared = candidate.entry.declared
    if declared is None or not (first and again):
        return []
    expected = declared.evaluations
    return [NfeRow(candidate.name, candidate.seed, first, again, expected, expected, expected)]


def _coverage(
    policy: WirePolicy, candidate: BroughtPolicy, asked: Asked, modes: Sequence[ModeRow]
) -> list[CoverageRow]:
    declared = candidate.entry.declared
    if not modes or declared is None:
        return []
    quality = quality_of(policy, swept_windows(asked.data, asked.deployment.horizons), asked.data)
    return [
        drawn_by(
            modes, steps=declared.sampler_steps, sampler_sha256=candidate.sampler_sha256,
            settings=_beside_steps(declared.eta, None), tolerance=declared.tolerance,
            quality=quality,
        )
    ]  # fmt: skip


def _swept(policy: WirePolicy, candidate: BroughtPolicy, asked: Asked) -> list[CoverageRow]:
    """A row of each further setting that its entry names; one of no answer counts as no numbers."""
    rows, windows = [], swept_windows(asked.data, asked.deployment.horizons)
    for name, choice in sorted(candidate.entry.samplers.items()):
        tried = policy.sampling_by(name)
        modes = modes_of_policy(
            tried, asked.held_out, seed=candidate.seed, convention=choice.sampler,
            samples=asked.samples, task=asked.task, checker=asked.checker,
        )  # fmt: skip
        if modes:
            rows.append(
                drawn_by(
                    modes, steps=choice.sampler_steps, sampler_sha256=tried.sampler_config_hash,
                    settings=_beside_steps(choice.eta, choice.nfe_cap), tolerance=choice.tolerance,
                    quality=quality_of(tried, windows, asked.data),
                )
            )  # fmt: skip
    return rows


def _beside_steps(eta: float | None, nfe_cap: int | None) -> str:
    """What an entry says of a sampler that has no column; what it leaves out is not told."""
    said = {"eta": eta, "nfe_cap": nfe_cap}
    return told_apart({name: value for name, value in said.items() if value})


def _sampler(entry: Entry) -> str:
    return entry.declared.sampler if entry.declared else UNSAID


def _identity(
    candidate: BroughtPolicy, deployment: Deployment, broken: int, differing: int
) -> CandidateIdentity:
    declared = candidate.entry.declared
    return CandidateIdentity(
        checkpoint=candidate.sha256,
        checkpoints=[candidate.sha256],
        config=[candidate.sha256],
        dataset=declared.dataset if declared else "",
        normalisation=candidate.sha256,
        seed=[declared.training_seed] if declared else [],
        sampler=candidate.sampler_sha256,
        metadata_mismatches=differing,
        nonfinite_weights=broken,
        nonfinite_chunks=0,  # among the invocations of `broken`
        given_up=0,  # by a server, which says no more than that it failed
        card=card_of_brought(candidate, deployment),
    )


def card_of_brought(candidate: BroughtPolicy, deployment: Deployment) -> IdentityCard:
    """The card of a brought policy, from what its maker declares; the rest is empty."""
    said, horizons = candidate.entry.declared, candidate.entry.horizons
    period_s = horizons.action_period_s
    return IdentityCard(
        architecture=said.architecture if said else "",
        parameters=said.parameters if said else 0,
        training_seeds=[str(said.training_seed)] if said else [],
        dataset=said.dataset if said else "",
        split=said.split if said else "",
        action_semantics=candidate.sha256,
        observation_semantics=candidate.sha256,
        observation_horizon=horizons.observation_horizon,
        prediction_horizon=horizons.prediction_horizon,
        execution_horizon=horizons.execution_horizon,
        control_rate_hz=1.0 / period_s,
        invocation_rate_hz=invocation_rate_hz(
            horizons, replan_lead_rows=deployment.replan_lead_rows
        ),
        deadline_s=deployment.deadline_s,
        path=said.path if said else "",
        sampler=said.sampler if said else "",
        sampler_steps=said.sampler_steps if said else 0,
        eta=said.eta if said else None,
        tolerance=said.tolerance if said else None,
        evaluations=str(said.evaluations) if said else "",
        precision=said.precision if said else "",
        device=_device(candidate),
        threads=said.threads if said else 0,
        cpu_capability=said.cpu_capability if said else "",
        warm_up=DISCARDED,
        batch_rows=said.batch_rows if said else 0,
        candidates=deployment.samples if candidate.entry.stochastic else 1,
        selector=deployment.joining.said(),
        selector_owner=selector.OWNER,
        selector_sha256=rule_sha256(deployment.joining),
    )
