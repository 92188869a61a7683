"""Documents of ingest and training, as gates read them.

Their writers build them by hand, because whatever they import trains everything again. Tests hold
what the writers leave against these classes, to the byte.
"""

from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import Field

from genpolicy.documents.document import Count, Document


@dataclass(frozen=True)
class Refused:
    """One recording that did not pass: which, where in it, and why."""

    file: str
    where: str
    reason: str


@dataclass(frozen=True)
class Refusals:
    """`refusals.json`: what became of the recordings that ingest found."""

    found: Count
    accepted: Count
    refused: list[Refused]


@dataclass(frozen=True)
class Training:
    """Optimisation settings; meanings as in `genpolicy.policies.settings.TrainingConfig`.

    Not that class itself: a key that is missing there stands for its default.
    """

    updates: Count
    batch_size: Count
    learning_rate: float
    warmup_updates: Count
    weight_decay: float
    beta_1: float
    beta_2: float
    gradient_clip: float
    ema_power: float
    ema_cap: float
    mask_padding: bool
    validation_every: Count


@dataclass(frozen=True)
class TrainedConfig:
    """`config.json` of a checkpoint; fields as in `genpolicy.policies.checkpoint`.

    Whole where a gate reads it; a mapping elsewhere.
    """

    format_version: int
    method: str
    horizons: dict[str, Any]
    dimensions: dict[str, Any]
    normalisation: dict[str, Any]
    network: dict[str, Any]
    head: dict[str, Any]
    training: Training
    training_seed: int
    sampler: dict[str, Any]
    provenance: dict[str, str | None]
    parameters: dict[str, Count]
    training_only_parameters: Count
    flops: dict[str, Count]
    weights_sha256: str


Positive = Annotated[int, Field(ge=1)]


@dataclass(frozen=True)
class Distilled:
    """What stands behind a distilled checkpoint, and what both trainings took.

    Attributes:
        teacher: Registered method of the teacher.
        teacher_sha256: The teacher's checkpoint.
        updates: Optimiser updates of teacher and student.
        evaluations: Network evaluations of single windows in these updates.
        gradients: Those among them that were differentiated.
    """

    teacher: str
    teacher_sha256: str
    updates: Positive
    evaluations: Positive
    gradients: Positive


@dataclass(frozen=True)
class DistilledConfig(TrainedConfig):
    """`config.json` of a checkpoint that has a teacher."""

    distilled: Distilled


@dataclass(frozen=True)
class MatchedMethod:
    """One method of `matched.json`.

    Attributes:
        parameters: By part, and in total.
        training_only_parameters: Parameters that exist during training only.
        flops: Matrix-product operations for one row, by part.
        config: Its configuration.
    """

    parameters: dict[str, Count]
    training_only_parameters: Count
    flops: dict[str, Count]
    config: TrainedConfig | DistilledConfig


@dataclass(frozen=True)
class Matched:
    """`matched.json`: how the configurations of trained methods differ.

    Attributes:
        reference: The method that the others are held against.
        methods: By name.
        differing_keys: Settings in which each method differs from it.
        single_action_keys: Settings left out for methods that predict one action.
        one_mode_keys: Settings left out for methods trained on one mode.
    """

    reference: str
    methods: dict[str, MatchedMethod]
    differing_keys: dict[str, list[str]]
    single_action_keys: list[str]
    one_mode_keys: list[str]


@dataclass(frozen=True)
class TrainedVariant:
    """One variant of `variants.json`.

    Attributes:
        factor: The factor that it changes.
        method: Registered method.
        parameters: By part, and in total.
        changed: Settings in which it differs from the reference.
        allowed: Settings that its factor may change.
        prediction_horizon: Actions that it predicts.
    """

    factor: str
    method: str
    parameters: dict[str, Count]
    changed: list[str]
    allowed: list[str]
    prediction_horizon: Count


@dataclass(frozen=True)
class Variants:
    """`variants.json`: what every variant changes.

    Attributes:
        reference: The variant that the others are changes of.
        updates: Updates of each training.
        variants: By name.
    """

    reference: str
    updates: Count
    variants: dict[str, TrainedVariant]


REFUSALS = Document("refusals.json", Refusals)
MATCHED = Document("matched.json", Matched)
VARIANTS = Document("variants.json", Variants)
