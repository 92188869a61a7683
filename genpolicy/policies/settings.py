"""Settings of networks, training and sampling; the same sections for every method."""

from typing import Literal

from pydantic import Field

from genpolicy.contract.settings import Settings
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.hashing import sha256_bytes

# Widths are multiples of a vector register: kernels treat the odd rest of a row differently from
# its body, and the same row then differs in its last bit with its place in the batch.
WIDTH_UNIT = 16


class NetworkConfig(Settings):
    """Size of the shared encoder and trunk, and the parameter budget that each head fills.

    Attributes:
        encoder: `mlp` with one hidden layer, or `linear` on the flattened observations.
        trunk: `mlp` (residual, modulated by the condition) or `transformer` (tokens); both have
            the same number of parameters.
        encoder_width: Hidden width of the observation encoder.
        condition_dim: Length of the condition vector that it makes.
        trunk_width: Width of the residual trunk.
        trunk_blocks: Residual blocks of the trunk.
        time_features: Sinusoidal features of the sampler time; even.
        head_parameters: Budget of the head; its hidden width is solved from it, to the nearest
            multiple of 16, so that heads with and without an input cost the same.
    """

    encoder: Literal["mlp", "linear"] = "mlp"
    trunk: Literal["mlp", "transformer"] = "mlp"
    encoder_width: int = Field(default=256, ge=16, le=4096, multiple_of=WIDTH_UNIT)
    condition_dim: int = Field(default=128, ge=16, le=4096, multiple_of=WIDTH_UNIT)
    trunk_width: int = Field(default=384, ge=16, le=4096, multiple_of=WIDTH_UNIT)
    trunk_blocks: int = Field(default=2, ge=1, le=64)
    time_features: int = Field(default=64, ge=2, le=1024, multiple_of=2)
    head_parameters: int = Field(default=220_000, ge=100, le=100_000_000)


class HeadConfig(Settings):
    """Settings that only some heads read; recorded for all, so that they can be compared.

    Attributes:
        diffusion_levels: Noise levels T of DDPM training.
        prediction: What the diffusion's network is trained to say of a noisy chunk: its `noise`,
            the clean chunk `x0`, or `v`, which is between the two (`predictions`).
        conditional_std: Assumed spread of normalised actions at one observation; sets the fixed
            gains around the networks of diffusion and flow (`schedules.Gains`).
        flow_segments: Segments of the flow in which `flow_policy` is consistent: its fewest
            network evaluations.
        latent_dim: Length of ACT's latent z. Small, because z = 0 is one of the two conventions:
            training draws z near a sphere of radius sqrt(latent_dim), and the more dimensions,
            the further from anything seen is its centre.
        posterior_width: Hidden width of ACT's training-only posterior encoder.
        kl_weight: Weight of ACT's KL term against the L1 error per action number.
        code_dim: Length of the code that the energy head scores, at most the chunk's numbers.
            Uniform candidates thin out with every number more; 16 keep a chunk of the default
            task within 5 mm.
        energy_negatives: Negatives per demonstrated chunk in the energy head's training.
    """

    diffusion_levels: int = Field(default=100, ge=1, le=10_000)
    prediction: Literal["noise", "v", "x0"] = "noise"
    conditional_std: float = Field(default=0.2, gt=0.0, le=10.0)
    flow_segments: int = Field(default=2, ge=1, le=64)
    latent_dim: int = Field(default=2, ge=1, le=1024)
    posterior_width: int = Field(default=256, ge=4, le=4096)
    kl_weight: float = Field(default=0.01, ge=0.0)
    code_dim: int = Field(default=16, ge=1, le=256)
    energy_negatives: int = Field(default=16, ge=1, le=4096)


class TrainingConfig(Settings):
    """Optimisation, equal for every method.

    Attributes:
        updates: Optimiser updates; also the stopping rule.
        batch_size: Windows per update.
        learning_rate: Peak of the schedule, after a linear warm-up, before the cosine decay.
        warmup_updates: Updates of the warm-up.
        weight_decay: AdamW's weight decay.
        beta_1: AdamW's first-moment decay.
        beta_2: AdamW's second-moment decay.
        gradient_clip: Largest global gradient norm.
        ema_power: Exponent of the averaging decay `1 - (1 + update)^-power`.
        ema_cap: Largest averaging decay.
        mask_padding: Whether padded actions stay out of the loss.
        validation_every: Updates between two measurements of the averaged weights.
    """

    updates: int = Field(default=5000, ge=1, le=10_000_000)
    batch_size: int = Field(default=256, ge=1, le=65_536)
    learning_rate: float = Field(default=1e-3, gt=0.0)
    warmup_updates: int = Field(default=300, ge=0)
    weight_decay: float = Field(default=1e-6, ge=0.0)
    beta_1: float = Field(default=0.95, ge=0.0, lt=1.0)
    beta_2: float = Field(default=0.999, ge=0.0, lt=1.0)
    gradient_clip: float = Field(default=1.0, gt=0.0)
    ema_power: float = Field(default=0.75, gt=0.0, le=1.0)
    ema_cap: float = Field(default=0.9999, ge=0.0, lt=1.0)
    mask_padding: bool = True
    validation_every: int = Field(default=500, ge=1)


class SamplerConfig(Settings):
    """How a trained network is turned into chunks.

    Attributes:
        name: The sampler.
        steps: Sampler steps (not NFE: Heun evaluates the network twice a step); of an adaptive
            solver, one over the first step that it tries.
        clip: Bound of the predicted clean chunk, normalised units; diffusion samplers only.
        eta: Share of the ancestral step's noise that `ddim` adds: 0 none, 1 makes it `ddpm`.
        population: Candidates that every pass of the energy's search scores; other samplers draw
            none and leave it at 1.
        batch_rows: Rows of every network call; shorter batches are padded, so that one row's
            sample does not depend on how many others there are.
        tolerance: Error of one step that an adaptive solver accepts, normalised units; of the
            defaults' kind a thousandth of the action's range, far below what a controller sees.
        nfe_cap: Network evaluations after which a sample is given up, with an error; an adaptive
            solver must have one. Set it by what the deadline has time for.
    """

    name: Literal[
        "direct", "z_zero", "z_prior", "ddpm", "ddim", "dpm_1", "dpm_2m", "dpm_sde", "euler",
        "midpoint", "heun", "rk4", "bosh3", "consistency", "derivative_free", "offset",
        "multistep_consistency", "langevin",
    ]  # fmt: skip
    steps: int = Field(default=1, le=10_000)
    clip: float | None = Field(default=1.0, gt=0.0)
    eta: float = Field(default=0.0, ge=0.0, le=1.0)
    population: int = Field(default=1, ge=1, le=65_536)
    batch_rows: int = Field(default=16, ge=1, le=65_536)
    tolerance: float = Field(default=1e-3, gt=0.0, le=1.0)
    nfe_cap: int | None = Field(default=None, ge=1, le=1_000_000)

    def hash(self) -> str:
        """SHA-256 of the settings."""
        return sha256_bytes(canonical_json(self.model_dump()))
