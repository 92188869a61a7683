"""Reading the audit's numbers, and those of its resamples, from its evidence."""

import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol, TypeVar

from gates.cause.numbers import Kept, Labels, Numbers, Residual
from gates.evidence import MissingEvidenceError
from genpolicy.audit.component_rows import ComponentModes, Tremor
from genpolicy.audit.documents import PERSISTENCE, SUMMARY, Summary
from genpolicy.audit.reach_rows import Alternative, FindingDraw, Reach, Side, StructureDraw
from genpolicy.audit.rows import (
    Calibration,
    Clock,
    Finding,
    ModeOutcome,
    Prediction,
    ReplayRow,
    Resample,
    Stratum,
)
from genpolicy.documents.document import Content, Document
from genpolicy.errors import BadInputError
from genpolicy.integrity.rows import Row, read_rows

RESIDUALS: tuple[tuple[str, str, type[Any], str], ...] = (
    ("clock_residual_s", "clocks.parquet", Clock, "offset_after_s"),
    ("calibration_residual_m", "calibration.parquet", Calibration, "residual_m"),
)
"""Question, table, its rows and the column that answers where no finding does."""
_OfPhase = TypeVar("_OfPhase", ModeOutcome, Alternative)


class Documents(Protocol):
    """A JSON document of the evidence by its kind, as its class."""

    def __call__(self, kind: Document[Content], /) -> Content:
        """The content."""


class Rows(Protocol):
    """A table of the evidence by file name, as rows of its class."""

    def __call__(self, name: str, row: type[Row], /) -> list[Row]:
        """The rows, possibly none."""


def read_numbers(documents: Documents, rows: Rows) -> tuple[Numbers, tuple[Numbers, ...]]:
    """The numbers of an audit, and those of its resamples.

    Args:
        documents: A JSON document of the evidence by its kind.
        rows: A table of the evidence by name and class of its rows.

    Raises:
        BadInputError: A document or table lacks something.
    """
    numbers = read_measured(documents, rows)
    with _written_by_this_version():
        drawn = _draws(
            numbers,
            rows("resamples.parquet", Resample),
            rows("structure_draws.parquet", StructureDraw),
            rows("finding_draws.parquet", FindingDraw),
        )
        return numbers, tuple(drawn)


def read_measured(documents: Documents, rows: Rows) -> Numbers:
    """The numbers of an audit without its resamples; arguments and errors as `read_numbers`."""
    summary, kept = documents(SUMMARY), documents(PERSISTENCE)
    with _written_by_this_version():
        sides, reach = rows("sides.parquet", Side), rows("reach.parquet", Reach)
        kind = next(side.kind for side in sides if side.followed)
        replayed = rows("replay.parquet", ReplayRow)
        numbers = Numbers(
            findings=tuple(rows("findings.parquet", Finding)),
            floors=summary.floors,
            ceilings=summary.ceilings,
            metre=summary.metre,
            unit=summary.position_unit,
            labels=_labels(len(replayed), sum(row.label != row.replayed for row in replayed)),
            counts=summary.counts,
            kept=Kept(kept.observed, kept.null_q95, kept.n),
            strata=tuple(rows("strata.parquet", Stratum)),
            told=tuple(rows("predictions.parquet", Prediction)),
            modes=tuple(
                _with_counts(mode, mode.successes, mode.admissible)
                for mode in _of_phase(rows("modes.parquet", ModeOutcome), summary)
            ),
            elsewhere=tuple(
                mode
                for mode in rows("modes.parquet", ModeOutcome)
                if mode.phase != summary.primary_phase
            ),
            components=tuple(rows("components.parquet", ComponentModes)),
            alternatives=_of_phase(rows("alternatives.parquet", Alternative), summary),
            reach=tuple(row for row in reach if row.kind == kind),
            kind=kind,
            other=next((side for side in sides if not side.followed), None),
            other_reach=tuple(row for row in reach if row.kind != kind),
            residuals=_residuals(rows),
            tremors=tuple(rows("tremor.parquet", Tremor)),
        )
        _check_alternatives(numbers)
        _check_known((*numbers.told, *reach, *sides))
        _check_tests(numbers.strata)
        return numbers


def _labels(replays: int, disagreements: int) -> Labels:
    _check_counts("replayed labels", disagreements, replays)
    return Labels(replays, disagreements)


def _with_counts(mode: ModeOutcome, successes: int, admissible: int) -> ModeOutcome:
    _check_counts(f"episodes of {mode.mode}", successes, mode.episodes)
    _check_counts(f"chunks of {mode.mode}", admissible, mode.checked)
    return replace(mode, successes=successes, admissible=admissible)


def _check_counts(what: str, count: int, total: int) -> None:
    if not 0 <= count <= total:
        raise ValueError(f"{count} of {total} {what}, which cannot be")


def _residuals(rows: Rows) -> dict[str, Residual]:
    """Largest residual of each question; a table that is not there leaves only its own open."""
    found: dict[str, Residual] = {}
    for question, name, kind, column in RESIDUALS:
        try:
            found[question] = _largest(getattr(row, column) for row in rows(name, kind))
        except MissingEvidenceError as error:
            found[question] = Residual(None, str(error))
    return found


def _largest(values: Iterable[float | None]) -> Residual:
    """Largest absolute value; not known of none, and where one is not known or not finite."""
    found = [math.nan if value is None else abs(value) for value in values]
    if not found or not all(math.isfinite(value) for value in found):
        return Residual(None, "not measured in every epoch")
    return Residual(max(found))


@contextmanager
def _written_by_this_version() -> Iterator[None]:
    try:
        yield
    except (KeyError, StopIteration, TypeError, ValueError) as error:
        raise BadInputError(
            where="the audit's evidence",
            found=f"{type(error).__name__}: {error}",
            expected="what this version of the audit writes",
            action="Run the audit again.",
        ) from error


def _of_phase(rows: Sequence[_OfPhase], summary: Summary) -> tuple[_OfPhase, ...]:
    """Those of the phase with most situations."""
    return tuple(row for row in rows if row.phase == summary.primary_phase)


def _check_known(rows: Iterable[object]) -> None:
    """These are numbers throughout; one that is not there is no number."""
    for row in rows:
        for name, value in vars(row).items():
            if value is None:
                raise ValueError(f"{type(row).__name__}.{name} is not known")


def _check_tests(rows: Iterable[Stratum]) -> None:
    """Of a recorded variable all that its test gives is known, of another one nothing."""
    for row in rows:
        found = (row.p_value, row.p_adjusted, row.effect, row.effect_lower, row.effect_upper)
        known = {value is not None and math.isfinite(value) for value in found}
        if known != {row.recorded}:
            raise ValueError(f"the test of {row.variable} in {row.phase} is not known")


def _check_alternatives(numbers: Numbers) -> None:
    known = {mode.mode for mode in numbers.modes}
    named = {name for row in numbers.alternatives for name in (row.mode, row.other)}
    if not named <= known:
        raise ValueError(f"alternatives names the modes {sorted(named - known)}, which are none")
    for row in numbers.alternatives:
        if row.mode == row.other:  # one good mode would be a choice between two
            raise ValueError(f"alternatives has the mode {row.mode} beside itself")


def folder_numbers(folder: Path) -> tuple[Numbers, tuple[Numbers, ...]]:
    """`read_numbers` of an evidence folder.

    Raises:
        BadInputError: A file is missing or damaged.
    """
    return read_numbers(
        lambda kind: kind.read(folder),
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
        strata = tuple(
            replace(stratum, p_adjusted=p, effect=effect, effect_lower=lower)
            for stratum, (p, effect, lower) in zip(measured.strata, tests, strict=True)
        )
        _check_tests(strata)
        outcomes = zip(drawn.successes, row.admissible, strict=True)
        yield replace(
            measured,
            findings=measured.findings
            if drawn.findings < 0
            else tuple(halves.get(drawn.findings, ())),
            reach=_reach(measured.reach, drawn),
            labels=_labels(measured.labels.replays, row.disagreements),
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
            strata=strata,
            told=tuple(
                _moved(told, value) for told, value in zip(measured.told, row.told, strict=True)
            ),
            modes=tuple(
                _with_counts(mode, successes, admissible)
                for mode, (successes, admissible) in zip(measured.modes, outcomes, strict=True)
            ),
        )


def _reach(measured: tuple[Reach, ...], drawn: StructureDraw) -> tuple[Reach, ...]:
    """The fifths of the way with the numbers of a draw."""
    numbers = zip(measured, drawn.reach_queries, drawn.reach_spoke, strict=True)
    return tuple(replace(row, queries=queries, spoke=spoke) for row, queries, spoke in numbers)


def _moved(row: Prediction, told: float) -> Prediction:
    """The same row with another number, and the interval about it."""
    away = told - row.told
    return replace(
        row, told=told, told_lower=row.told_lower + away, told_upper=row.told_upper + away
    )
