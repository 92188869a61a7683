"""The audit's numbers: only what a cause is named from."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from genpolicy.audit.component_rows import ComponentModes, Tremor
from genpolicy.audit.documents import Counts
from genpolicy.audit.reach_rows import LOCAL, Alternative, Reach, Side
from genpolicy.audit.rows import Finding, ModeOutcome, Prediction, Stratum


@dataclass(frozen=True)
class Labels:
    """Labels against replay."""

    replays: int
    disagreements: int


@dataclass(frozen=True)
class Kept:
    """Share of episodes that keep their mode, what chance reaches, and in how many situations."""

    observed: float
    null_q95: float
    n: int


@dataclass(frozen=True)
class Residual:
    """Largest residual over epochs; None where it is not known, and then why."""

    value: float | None
    why: str = ""


@dataclass(frozen=True)
class Numbers:
    """All that a cause is named from.

    Attributes:
        findings: Deviations of the data, in the order of diagnosis.
        floors: Where the audit begins to report, by question.
        ceilings: Where the audit takes modes back, by question.
        metre: How much of the position's unit stands for a metre.
        unit: Unit of the position.
        labels: Labels against replay.
        counts: Support and modes.
        kept: Identity over time.
        strata: Tests of variables.
        told: What variables, order and past tell of the modes.
        modes: Modes of the phase with most situations.
        alternatives: Which of them stand beside each other in a situation.
        elsewhere: Modes of the other phases, which name no cause.
        components: Where in the action modes were looked for; counts, strata and modes are about
            the one followed.
        reach: How far the evidence that is followed reaches in each fifth of the way; none where
            it was not measured.
        kind: Which that is, `local` or `learned`.
        other: What the other one found; None where there is none.
        other_reach: How far that reaches.
        residuals: By question, of those that are measured whether or not they stand out.
        tremors: White noise on single numbers of the action.
    """

    findings: tuple[Finding, ...]
    floors: Mapping[str, float]
    ceilings: Mapping[str, float]
    metre: float
    unit: str
    labels: Labels
    counts: Counts
    kept: Kept
    strata: tuple[Stratum, ...]
    told: tuple[Prediction, ...]
    modes: tuple[ModeOutcome, ...]
    components: tuple[ComponentModes, ...]
    alternatives: tuple[Alternative, ...] = ()
    elsewhere: tuple[ModeOutcome, ...] = ()
    reach: tuple[Reach, ...] = ()
    kind: str = LOCAL
    other: Side | None = None
    other_reach: tuple[Reach, ...] = ()
    residuals: Mapping[str, Residual] = field(default_factory=dict)
    tremors: tuple[Tremor, ...] = ()


def turned(numbers: Numbers) -> Numbers:
    """The same with the other evidence, which there must be, in place of the one followed."""
    side, fields = numbers.other, Counts.__dataclass_fields__
    assert side is not None, "no other evidence to turn to"
    own = {name: getattr(numbers.counts, name) for name in fields}
    kept = numbers.kept
    return replace(
        numbers,
        counts=Counts(**{name: getattr(side, name) for name in fields}),
        kept=Kept(side.kept, side.kept_null_q95, side.kept_n),
        reach=numbers.other_reach,
        kind=side.kind,
        other=Side(
            kind=numbers.kind, followed=True, **own, kept=kept.observed,
            kept_null_q95=kept.null_q95, kept_n=kept.n, confirmed=0, contradicted=0,
        ),
        other_reach=numbers.reach,
    )  # fmt: skip
