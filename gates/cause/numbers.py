"""The audit's numbers, read from its evidence: only what a cause is named from."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol, TypeVar

from genpolicy.audit.component_rows import ComponentModes
from genpolicy.audit.reach_rows import (
    LOCAL,
    Alternative,
    FindingDraw,
    Reach,
    Side,
    StructureDraw,
)
from genpolicy.audit.rows import Finding, ModeOutcome, Prediction, Resample, Stratum
from genpolicy.errors import BadInputError
from genpolicy.integrity.documents import read_json
from genpolicy.integrity.rows import Row, read_rows

_OfPhase = TypeVar("_OfPhase", ModeOutcome, Alternative)


class Rows(Protocol):
    """A table of the evidence by file name, as rows of its class."""

    def __call__(self, name: str, row: type[Row], /) -> list[Row]:
        """The rows, possibly none."""


@dataclass(frozen=True)
class Labels:
    """Labels against replay; `upper` is the exact upper bound of the share that disagrees."""

    replays: int
    disagreements: int
    upper: float


@dataclass(frozen=True)
class Counts:
    """Situations and distinct held-out episodes; meanings as in `genpolicy.audit.counts`."""

    queries: int
    analysed: int
    analysed_episodes: int
    two_mode: int
    two_mode_episodes: int
    primary_episodes: int
    resolved: int
    incoherent: int
    persistent: int
    noise_ratio: float
    noise_spread: float
    white_share: float

    @property
    def share(self) -> float:
        """Share of the situations with enough neighbours."""
        return self.analysed / self.queries if self.queries else 0.0


@dataclass(frozen=True)
class Kept:
    """Share of episodes that keep their mode, what chance reaches, and in how many situations."""

    observed: float
    null_q95: float
    n: int


@dataclass(frozen=True)
class Numbers:
    """All that a cause is named from.

    Attributes:
        findings: Deviations of the data, in the order of diagnosis.
        floors: Where the audit begins to report, by question.
        metre: How much of the position's unit stands for a metre.
        unit: Unit of the position.
        labels: Labels against replay.
        counts: Support and modes.
        kept: Identity over time.
        strata: Tests of variables.
        told: What variables, order and past tell of the modes.
        modes: Modes of the phase with most situations.
        alternatives: Which of them stand beside each other in a situation.
        components: Where in the action modes were looked for; counts, strata and modes are about
            the one followed.
        reach: How far the evidence that is followed reaches in each fifth of the way; none where
            it was not measured.
        kind: Which that is, `local` or `learned`.
        other: What the other one found; None where there is none.
        other_reach: How far that reaches.
    """

    findings: tuple[Finding, ...]
    floors: Mapping[str, float]
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
    reach: tuple[Reach, ...] = ()
    kind: str = LOCAL
    other: Side | None = None
    other_reach: tuple[Reach, ...] = ()


def read_numbers(
    document: Callable[[str], Mapping[str, Any]], rows: Rows
) -> tuple[Numbers, tuple[Numbers, ...]]:
    """The numbers of an audit, and those of its resamples.

    Args:
        document: A JSON document of the evidence by name.
        rows: A table of the evidence by name and class of its rows.

    Raises:
        BadInputError: A document or table lacks something.
    """
    summary, kept = document("summary.json"), document("persistence.json")
    try:
        sides, reach = rows("sides.parquet", Side), rows("reach.parquet", Reach)
        kind = next(side.kind for side in sides if side.followed)
        numbers = Numbers(
            findings=tuple(rows("findings.parquet", Finding)),
            floors={str(key): float(value) for key, value in summary["floors"].items()},
            metre=float(summary["metre"]),
            unit=str(summary["position_unit"]),
            labels=Labels(
                int(summary["label_replays"]),
                int(summary["label_disagreements"]),
                float(summary["label_disagreement_upper"]),
            ),
            counts=_of(Counts, summary["counts"]),
            kept=_of(Kept, kept),
            strata=tuple(rows("strata.parquet", Stratum)),
            told=tuple(rows("predictions.parquet", Prediction)),
            modes=_of_phase(rows("modes.parquet", ModeOutcome), summary),
            components=tuple(rows("components.parquet", ComponentModes)),
            alternatives=_of_phase(rows("alternatives.parquet", Alternative), summary),
            reach=tuple(row for row in reach if row.kind == kind),
            kind=kind,
            other=next((side for side in sides if not side.followed), None),
            other_reach=tuple(row for row in reach if row.kind != kind),
        )
        _check_alternatives(numbers)
        return numbers, tuple(
            _draws(
                numbers,
                rows("resamples.parquet", Resample),
                rows("structure_draws.parquet", StructureDraw),
                rows("finding_draws.parquet", FindingDraw),
            )
        )
    except (KeyError, StopIteration, TypeError, ValueError) as error:
        raise BadInputError(
            where="the audit's evidence",
            found=f"{type(error).__name__}: {error}",
            expected="what this version of the audit writes",
            action="Run the audit again.",
        ) from error


def _of_phase(rows: Sequence[_OfPhase], summary: Mapping[str, Any]) -> tuple[_OfPhase, ...]:
    """Those of the phase with most situations."""
    return tuple(row for row in rows if row.phase == summary["primary_phase"])


def _check_alternatives(numbers: Numbers) -> None:
    known = {mode.mode for mode in numbers.modes}
    named = {name for row in numbers.alternatives for name in (row.mode, row.other)}
    if not named <= known:
        raise ValueError(f"alternatives names the modes {sorted(named - known)}, which are none")


def folder_numbers(folder: Path) -> tuple[Numbers, tuple[Numbers, ...]]:
    """`read_numbers` of an evidence folder.

    Raises:
        BadInputError: A file is missing or damaged.
    """
    return read_numbers(
        lambda name: read_json(folder / name),
        lambda name, row: read_rows(folder / name, row),
    )


def _draws(
    measured: Numbers,
    rows: Iterable[Resample],
    structures: Iterable[StructureDraw],
    findings: Iterable[FindingDraw],
) -> Iterator[Numbers]:
    """What was measured, with the numbers of each resample in their places."""
    halves: dict[int, list[Finding]] = {}
    for item in findings:
        halves.setdefault(item.draw, []).append(item.finding)
    for row, drawn in zip(rows, structures, strict=True):
        tests = zip(row.p_adjusted, row.effect, row.effect_lower, strict=True)
        outcomes = zip(row.success_lower, row.admissible, strict=True)
        yield replace(
            measured,
            findings=measured.findings
            if drawn.findings < 0
            else tuple(halves.get(drawn.findings, ())),
            reach=_reach(measured.reach, drawn),
            labels=replace(
                measured.labels,
                disagreements=row.disagreements,
                upper=row.disagreement_upper,
            ),
            counts=replace(
                measured.counts,
                queries=drawn.queries,
                analysed=drawn.analysed,
                analysed_episodes=drawn.analysed_episodes,
                primary_episodes=drawn.primary_episodes,
                resolved=drawn.resolved,
                noise_ratio=drawn.noise_ratio,
                noise_spread=drawn.noise_spread,
                white_share=drawn.white_share,
                two_mode=row.two_mode,
                two_mode_episodes=row.two_mode_episodes,
                incoherent=row.incoherent,
                persistent=row.persistent,
            ),
            kept=Kept(row.kept, row.kept_null_q95, row.kept_n),
            strata=tuple(
                replace(stratum, p_adjusted=p, effect=effect, effect_lower=lower)
                for stratum, (p, effect, lower) in zip(measured.strata, tests, strict=True)
            ),
            told=tuple(
                _moved(told, value) for told, value in zip(measured.told, row.told, strict=True)
            ),
            modes=tuple(
                replace(mode, success_lower=lower, admissible=admissible)
                for mode, (lower, admissible) in zip(measured.modes, outcomes, strict=True)
            ),
        )


def _reach(measured: tuple[Reach, ...], drawn: StructureDraw) -> tuple[Reach, ...]:
    """The fifths of the way with the numbers of a draw."""
    numbers = zip(measured, drawn.reach_queries, drawn.reach_spoke, strict=True)
    return tuple(replace(row, queries=queries, spoke=spoke) for row, queries, spoke in numbers)


def turned(numbers: Numbers) -> Numbers:
    """The same with the other evidence in place of the one that is followed."""
    side, fields = numbers.other, Counts.__dataclass_fields__
    if side is None:
        return numbers
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


def _moved(row: Prediction, told: float) -> Prediction:
    """The same row with another number, and the interval about it."""
    away = told - row.told
    return replace(
        row, told=told, told_lower=row.told_lower + away, told_upper=row.told_upper + away
    )


def _of(kind: Any, row: Mapping[str, Any]) -> Any:
    """A result class from the values of its fields; others are left out."""
    return kind(**{name: row[name] for name in kind.__dataclass_fields__})
