"""Settings of Gate A other than limits, and where its evidence lies."""

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import Field, ValidationInfo, field_validator

from gates.may_differ import PLACE, Listed
from gates.report import Owner
from gates.settings import GateSettings, Waiver, waived_question

AUDIT = "artifacts/audit"
TRAINED = "artifacts/train_baselines"
MEASURED = "artifacts/measure_baselines"
TRAINED_FACTORS = "artifacts/train_factors"
MEASURED_FACTORS = "artifacts/measure_factors"
VALID_CAUSE = "valid_modes"


class NeedSettings(GateSettings):
    """Section `gate_a` without its limits.

    Attributes:
        confidence: Coverage of every interval.
        held_out_splits: Splits whose situations are judged; never the one that trains.
        baselines: Simpler policies that must be there, frozen and matched.
        deployed_conventions: Sampling conventions under which a baseline is deployed, an unlearned
            offset among them; drawing from a latent is a generator's way, reported beside them.
        generative_baselines: Baselines that are drawn at random under every convention (an
            energy's candidates are), so that they are reported beside the deployed ones.
        chunked_baseline: Baseline that shows what chunking alone does.
        remedies: Baselines that learn all demonstrations and still may do without a density.
        one_mode: Baseline that knows the demonstrations of one mode only: shown, and judged by what
            it loses in Gate D.
        may_differ: Settings that may differ between methods, each with its reason.
        redraws: Candidates that a policy may draw until one is admissible, as in the comparison.
        samples: Candidates drawn at each two-mode situation.
        seeds: Numbers of the training seeds; the first is the one that is deployed.
        latent_convention: How the latent is drawn where it is tested.
        permutations: Of the test of the latent.
        latent_baseline: Baseline whose latent must answer the observation.
        factors: Factors of which each must have been changed alone.
        conditioning_factors: Factors that could make a density unnecessary; a head is what the
            gate is about, and a single action commits to no mode.
        waived_checks: Questions of the audit that could not be asked, by the owner who answers for
            leaving them unasked: question and reason. They stand as caveats in report and card.
        cause: Limits of the questions that only the cause asks, by owner: limit and reason; those
            that a criterion asks as well stand among the limits.
    """

    homes: ClassVar[Mapping[str, str]] = {
        "confidence": "confidence",
        "baselines": "train_baselines.samplers",
        "latent_baseline": "measure_baselines.latent.method",
        "may_differ": PLACE,
        "redraws": "stress.samples",
        "samples": "measure_baselines.samples",
        "seeds": "policy.seeds",
        "latent_convention": "measure_baselines.latent.convention",
        "permutations": "measure_baselines.latent.permutations",
    }

    confidence: float = Field(gt=0.5, lt=1.0)
    held_out_splits: tuple[Literal["validation", "test"], ...] = Field(min_length=1)
    baselines: tuple[str, ...]
    deployed_conventions: tuple[str, ...]
    generative_baselines: tuple[str, ...]
    chunked_baseline: str
    remedies: tuple[str, ...] = Field(default=("chunked_l1", "bc_noise"), min_length=1)
    one_mode: str = "one_mode_bc"
    may_differ: Listed
    redraws: int = Field(ge=1)
    samples: int = Field(ge=1)
    seeds: tuple[int, ...] = Field(min_length=1)
    latent_baseline: str
    latent_convention: str
    permutations: int = Field(ge=1)
    factors: tuple[str, ...] = ("reference", "representation", "trunk", "head", "temporal")
    conditioning_factors: tuple[str, ...] = ("representation", "trunk")
    waived_checks: dict[Owner, dict[str, Annotated[str, Field(pattern=r"\S")]]] = Field(
        default_factory=dict
    )
    cause: dict[str, dict[str, tuple[float, str]]]

    @field_validator("samples")
    @classmethod
    def _as_many_chances(cls, samples: int, info: ValidationInfo) -> int:
        """A remedy of which fewer samples were measured than a candidate draws gets fewer draws."""
        redraws = info.data.get("redraws", samples)
        if samples < redraws:
            raise ValueError(
                f"{samples} samples cannot show what {redraws} draws (stress.samples) reach: a "
                "simpler policy gets as many chances as a candidate"
            )
        return samples

    @property
    def caveats(self) -> tuple[str, ...]:
        """Who answers for which question that was not asked, and why."""
        return tuple(
            waived_question(check, Waiver(reason, owner))
            for owner, checks in self.waived_checks.items()
            for check, reason in checks.items()
        )
