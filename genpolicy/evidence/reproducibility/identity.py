"""The identity card of a candidate: what a reviewer must know to speak of the same thing."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from genpolicy.candidates import selector, votes
from genpolicy.candidates.described import (
    architecture_of,
    eta_of,
    evaluations_of,
    path_of,
    precision_of,
    tolerance_of,
)
from genpolicy.candidates.joining import REPLACE, JoiningSettings
from genpolicy.candidates.judged import JudgedPolicy, candidates_of
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.data.dataset import Dataset
from genpolicy.evidence.documents.reproducibility import CandidateIdentity, IdentityCard
from genpolicy.evidence.reproducibility.benchmark import DISCARDED
from genpolicy.evidence.split import split_sha256
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.hashing import sha256_bytes, sha256_file
from genpolicy.policies.checkpoint import CONFIG_FILE
from genpolicy.policies.determinism import regime
from genpolicy.policies.policy import NetworkPolicy


@dataclass(frozen=True)
class Deployment:
    """How a candidate is used, beside what its checkpoint says.

    Attributes:
        horizons: Horizons of the ladder.
        deadline_s: Time after which an answer is given up.
        samples: Candidates of an invocation of a stochastic method.
        replan_lead_rows: Executable actions left at which the executor asks again.
        joining: How its chunks join.
    """

    horizons: HorizonConfig
    deadline_s: float
    samples: int
    replan_lead_rows: int
    joining: JoiningSettings = field(default_factory=JoiningSettings)


def identities(
    candidates: Sequence[JudgedPolicy], data: Dataset, deployment: Deployment
) -> dict[str, CandidateIdentity]:
    """What pins and names each candidate; nothing is counted yet."""
    result = {}
    for name in dict.fromkeys(candidate.name for candidate in candidates):
        own = [candidate for candidate in candidates if candidate.name == name]
        policies = [candidate.load() for candidate in own]
        first = policies[0].checkpoint.config
        result[name] = CandidateIdentity(
            checkpoint=own[0].sha256,
            checkpoints=[candidate.sha256 for candidate in own],
            config=[sha256_file(candidate.folder / CONFIG_FILE) for candidate in own],
            dataset=first.provenance.dataset_manifest_sha256,
            normalisation=sha256_bytes(canonical_json(first.normalisation.model_dump())),
            seed=[policy.checkpoint.config.training_seed for policy in policies],
            sampler=policies[0].sampler_config_hash,
            metadata_mismatches=0,
            nonfinite_weights=0,
            nonfinite_chunks=0,
            given_up=0,
            card=card_of(policies, data, deployment),
        )
    return result


def invocation_rate_hz(horizons: HorizonConfig, *, replan_lead_rows: int) -> float:
    """Invocations per second while every answer comes in time, 1/s.

    The executor asks again when `replan_lead_rows` actions of a chunk are left, and at no two
    moments of one action period. A chunk that comes late, is refused or is held makes it another.
    """
    rows = max(1, horizons.execution_horizon - replan_lead_rows)
    return 1.0 / horizons.action_period_s / rows


def card_of(
    policies: Sequence[NetworkPolicy], data: Dataset, deployment: Deployment
) -> IdentityCard:
    """The card of one candidate, from the policies of its training seeds."""
    policy = policies[0]
    config, sampler = policy.checkpoint.config, policy.sampler
    horizons, runs = config.horizons, regime(policy.device)
    period_s = horizons.action_period_s
    joining = deployment.joining.of(config.method, guided=policy.guided)
    return IdentityCard(
        architecture=architecture_of(config),
        parameters=config.parameters["total"],
        training_seeds=[str(each.checkpoint.config.training_seed) for each in policies],
        dataset=config.provenance.dataset_manifest_sha256,
        split=config.provenance.episodes_sha256 or split_sha256(data.manifest),
        action_semantics=config.provenance.action_contract_sha256,
        observation_semantics=config.provenance.observation_contract_sha256,
        observation_horizon=horizons.observation_horizon,
        prediction_horizon=horizons.prediction_horizon,
        execution_horizon=horizons.execution_horizon,
        control_rate_hz=1.0 / period_s,
        invocation_rate_hz=invocation_rate_hz(
            horizons, replan_lead_rows=deployment.replan_lead_rows
        ),
        deadline_s=deployment.deadline_s,
        path=path_of(config, sampler),
        sampler=sampler.name,
        sampler_steps=sampler.steps,
        eta=eta_of(sampler),
        tolerance=tolerance_of(sampler),
        evaluations=evaluations_of(sampler),
        precision=precision_of(policy),
        device=str(runs["device"]),
        threads=int(runs["threads"]),
        cpu_capability=str(runs["cpu_capability"]),
        warm_up=DISCARDED,
        batch_rows=sampler.batch_rows,
        candidates=candidates_of(policy, deployment.samples),
        selector=joining.said(),
        selector_owner=selector.OWNER,
        selector_sha256=rule_sha256(joining),
    )


def rule_sha256(joining: JoiningSettings) -> str:
    """The file that holds the rule; of a rule that joins chunks both files, and what it reads.

    One file holds several rules, so that without its name and numbers two would be one.
    """
    own = sha256_file(Path(selector.__file__))
    if joining.rule == REPLACE:
        return own
    return sha256_bytes((own + sha256_file(Path(votes.__file__)) + joining.said()).encode())
