"""The identity card of a candidate: what a reviewer must know to speak of the same thing."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from genpolicy.candidates import selector, votes
from genpolicy.candidates.joining import REPLACE, JoiningSettings
from genpolicy.candidates.judged import JudgedPolicy, candidates_of
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.data.dataset import Dataset
from genpolicy.evidence.documents.reproducibility import CandidateIdentity, IdentityCard
from genpolicy.evidence.reproducibility.benchmark import DISCARDED
from genpolicy.evidence.split import split_sha256
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.hashing import sha256_bytes, sha256_file
from genpolicy.policies.checkpoint import CONFIG_FILE, CheckpointConfig
from genpolicy.policies.determinism import regime
from genpolicy.policies.diffusion_samplers import DIFFUSION_SAMPLERS
from genpolicy.policies.distillation import GRID_STEPS, MULTISTEP
from genpolicy.policies.evaluations import allowed_evaluations
from genpolicy.policies.ode_samplers import ADAPTIVE_TABLEAUS, ODE_SAMPLERS
from genpolicy.policies.policy import NetworkPolicy
from genpolicy.policies.settings import SamplerConfig

WITH_ETA = ("ddim",)


@dataclass(frozen=True)
class Deployment:
    """How a candidate is used, beside what its checkpoint says.

    Attributes:
        horizons: Horizons of the ladder.
        deadline_s: Time after which an answer is given up.
        samples: Candidates of an invocation of a stochastic method.
        joining: How its chunks join.
    """

    horizons: HorizonConfig
    deadline_s: float
    samples: int
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
            card=card_of(policies, data, deployment),
        )
    return result


def card_of(
    policies: Sequence[NetworkPolicy], data: Dataset, deployment: Deployment
) -> IdentityCard:
    """The card of one candidate, from the policies of its training seeds."""
    policy = policies[0]
    config, sampler = policy.checkpoint.config, policy.sampler
    horizons, runs = config.horizons, regime(policy.device)
    period_s = horizons.action_period_s
    evaluations = allowed_evaluations(sampler)
    joining = deployment.joining.of(config.method, guided=policy.guided)
    counts = dict.fromkeys((evaluations.least, evaluations.most))
    return IdentityCard(
        architecture=_architecture(config),
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
        invocation_rate_hz=1.0 / (horizons.execution_horizon * period_s),
        deadline_s=deployment.deadline_s,
        path=_path(config, sampler),
        sampler=sampler.name,
        sampler_steps=sampler.steps,
        eta=sampler.eta if sampler.name in WITH_ETA else None,
        tolerance=sampler.tolerance if sampler.name in ADAPTIVE_TABLEAUS else None,
        evaluations=" to ".join(map(str, counts)),
        precision=_precision(policy),
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


def _architecture(config: CheckpointConfig) -> str:
    net = config.network
    return (
        f"{net.encoder} encoder of width {net.encoder_width} to {net.condition_dim}; {net.trunk} "
        f"trunk of {net.trunk_blocks} blocks of width {net.trunk_width}; head of "
        f"{config.parameters['head']} parameters"
    )


def _path(config: CheckpointConfig, sampler: SamplerConfig) -> str:
    """Between noise and action; of a method without either, that there is none."""
    if sampler.name in DIFFUSION_SAMPLERS:
        levels, said = config.head.diffusion_levels, config.head.prediction
        return f"squared-cosine schedule of {levels} levels, network predicts {said}"
    if sampler.name == MULTISTEP:
        levels, said = config.head.diffusion_levels, config.head.prediction
        return (
            f"squared-cosine schedule of {levels} levels, consistent at {GRID_STEPS} of them, "
            f"network predicts {said}"
        )
    if sampler.name in ODE_SAMPLERS:
        return "straight path from Gaussian noise, network predicts velocity"
    if sampler.name == "consistency":
        return f"straight path, consistent in {config.head.flow_segments} segments"
    return "none: no transport from noise"


def _precision(policy: NetworkPolicy) -> str:
    found = {str(values.dtype) for values in policy.checkpoint.network.state_dict().values()}
    return ", ".join(sorted(name.removeprefix("torch.") for name in found))
