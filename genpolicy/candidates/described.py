"""What a checkpoint of ours says of itself, in the words of an identity card."""

from genpolicy.policies.checkpoint import CheckpointConfig
from genpolicy.policies.diffusion_samplers import DIFFUSION_SAMPLERS
from genpolicy.policies.distillation import GRID_STEPS, MULTISTEP
from genpolicy.policies.evaluations import allowed_evaluations
from genpolicy.policies.ode_samplers import ADAPTIVE_TABLEAUS, ODE_SAMPLERS
from genpolicy.policies.policy import NetworkPolicy
from genpolicy.policies.settings import SamplerConfig

WITH_ETA = ("ddim",)


def eta_of(sampler: SamplerConfig) -> float | None:
    """Share of the ancestral noise; None of a sampler that has none."""
    return sampler.eta if sampler.name in WITH_ETA else None


def tolerance_of(sampler: SamplerConfig) -> float | None:
    """Error of a step; None of a sampler that does not choose its steps."""
    return sampler.tolerance if sampler.name in ADAPTIVE_TABLEAUS else None


def evaluations_of(sampler: SamplerConfig) -> str:
    """Network evaluations of a sample: the count, or the least and the most."""
    allowed = allowed_evaluations(sampler)
    return " to ".join(map(str, dict.fromkeys((allowed.least, allowed.most))))


def architecture_of(config: CheckpointConfig) -> str:
    """Encoder, trunk and head with their sizes."""
    net = config.network
    return (
        f"{net.encoder} encoder of width {net.encoder_width} to {net.condition_dim}; {net.trunk} "
        f"trunk of {net.trunk_blocks} blocks of width {net.trunk_width}; head of "
        f"{config.parameters['head']} parameters"
    )


def path_of(config: CheckpointConfig, sampler: SamplerConfig) -> str:
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


def precision_of(policy: NetworkPolicy) -> str:
    """Number format of the weights."""
    found = {str(values.dtype) for values in policy.checkpoint.network.state_dict().values()}
    return ", ".join(sorted(name.removeprefix("torch.") for name in found))
