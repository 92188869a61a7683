"""The audit's evidence as files: the tables that the gate reads, and nothing that decides."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from genpolicy.audit.component_rows import ComponentModes
from genpolicy.audit.data import AuditInput, Integers, commanded_path
from genpolicy.audit.documents import PERSISTENCE, SUMMARY, Obstacle, Summary
from genpolicy.audit.examples import (
    alignment,
    example_chunks,
    position_names,
    position_unit,
    support_points,
)
from genpolicy.audit.persistence import persistent
from genpolicy.audit.reach_rows import FURTHER_TABLES
from genpolicy.audit.rows import TABLES, Demonstration, ReplayRow, SituationRow
from genpolicy.audit.run import AuditResult
from genpolicy.audit.settings import AuditSettings
from genpolicy.audit.situations import Situation
from genpolicy.integrity.atomic import write_bytes
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.rows import write_rows


def write_evidence(
    result: AuditResult,
    folder: Path,
    *,
    settings: AuditSettings,
    obstacles: Sequence[Obstacle] = (),
) -> None:
    """Write every table and document of the audit into an existing folder.

    Args:
        result: The audit.
        folder: Existing folder.
        settings: What the audit was made with; its floors stand beside the numbers.
        obstacles: Round obstacles in the base frame, for plots.

    Raises:
        BadInputError: The place cannot be written.
    """
    rows: dict[str, Sequence[Any]] = {
        "alignment": alignment(result, settings),
        "alternatives": result.alternatives,
        "asked": result.asked,
        "calibration": result.semantics.calibrations,
        "clocks": result.semantics.clocks,
        "components": _components(result),
        "demonstrated": _demonstrated(result),
        "examples": example_chunks(result, settings),
        "finding_draws": result.finding_draws,
        "findings": result.semantics.findings,
        "modes": result.modes,
        "neighbourhoods": [_situation(result.data, item) for item in result.situations],
        "predictions": result.told,
        "recovery": result.recovery,
        "replay": _replays(result),
        "resamples": result.resamples,
        "reach": result.reach,
        "sides": result.sides,
        "strata": result.strata,
        "structure_draws": result.structure_draws,
        "support": support_points(result),
        "tremor": result.tremors,
    }
    for name, row in (TABLES | FURTHER_TABLES).items():
        write_rows(folder / f"{name}.parquet", row, [_known(item) for item in rows[name]])
    PERSISTENCE.write(folder, result.persistence)
    write_bytes(folder / "settings.json", canonical_json(settings.model_dump(mode="json")))
    SUMMARY.write(folder, summary(result, settings, obstacles))


def summary(
    result: AuditResult, settings: AuditSettings, obstacles: Sequence[Obstacle] = ()
) -> Summary:
    """Counts, floors and names; content of `summary.json`."""
    several = [item for item in result.situations if item.two_mode]
    checked = [item for item in several if item.chunks.mean_admissible is not None]
    inside, across = _by_phase(result)
    return Summary(
        episodes=len(result.data.episodes),
        rows=len(result.data.observation),
        floors=settings.floors,
        ceilings=settings.ceilings,
        metre=settings.metre,
        primary_phase=result.primary_phase,
        counts=result.counts,
        modes_before_realignment=result.counts.two_mode_episodes,
        modes_after_realignment=result.modes_after_realignment,
        modes_with_phase=inside,
        modes_without_phase=across,
        position_names=position_names(result.data),
        position_unit=position_unit(result.data),
        mean_checked=len(checked),
        mean_defeated=sum(_defeated(item) for item in checked),
        gaps=result.semantics.gaps,
        start_drift=result.semantics.start_drift,
        notes=list(result.semantics.notes),
        obstacles=list(obstacles),
    )


def _components(result: AuditResult) -> list[ComponentModes]:
    """Modes in every component; lengths along the path are in the unit of the position."""
    unit = position_unit(result.data)
    return [replace(item, unit=item.unit or unit) for item in result.components]


def _by_phase(result: AuditResult) -> tuple[int, int]:
    """Held-out episodes with several modes, with the phase looked at and without.

    With one phase only both are the same number, because there is nothing to look at.
    """
    here, other = result.counts.two_mode_episodes, result.modes_other_phases
    other = here if other is None else other
    return (here, other) if result.data.phase_observed else (other, here)


def _defeated(item: Situation) -> bool:
    """The mean is refused and every modal chunk passes."""
    return not item.chunks.mean_admissible and all(item.chunks.mode_admissible)


def _situation(data: AuditInput, item: Situation) -> SituationRow:
    query = item.neighbourhood.query
    episode = int(data.episode[query])

    def path(actions: np.ndarray) -> tuple[float, ...]:
        return tuple(commanded_path(data, actions, item.neighbourhood.query).ravel().tolist())

    return SituationRow(
        split=str(data.episodes.split[episode]),
        phase=item.phase,
        episode_uuid=str(data.episodes.uuid[episode]),
        index=int(data.index[query]),
        neighbours=len(item.neighbourhood.rows),
        clusters=item.clustering.count,
        cluster_sizes=item.clustering.sizes,
        two_mode=item.two_mode,
        separation_m=item.clustering.separation,
        mean_admissible=item.chunks.mean_admissible,
        mean_reason=item.chunks.mean_reason,
        median_admissible=item.chunks.median_admissible,
        modes_admissible=sum(item.chunks.mode_admissible),
        mean_path=path(item.chunks.mean),
        mode_paths=tuple(path(mode) for mode in item.chunks.modes),
        persistent=persistent(item.identity),
        component=item.component,
    )


def _replays(result: AuditResult) -> list[ReplayRow]:
    """Replayed episodes with the mode that each followed, in the phase with most situations."""
    linked = result.links.get(result.primary_phase)
    places = {str(uuid): place for place, uuid in enumerate(result.data.episodes.uuid)}
    return [
        ReplayRow(
            episode_uuid=item.episode_uuid,
            label=item.label,
            replayed=item.replayed,
            mode=_mode(linked, places[item.episode_uuid]),
        )
        for item in result.replayed
    ]


def _demonstrated(result: AuditResult) -> list[Demonstration]:
    """The mode that each episode followed, in the phase with most situations; unknown left out."""
    uuids = result.data.episodes.uuid
    return [
        Demonstration(str(uuids[place]), result.primary_phase, f"m{mode}")
        for place, mode in enumerate(result.demonstrated)
        if mode >= 0
    ]


def _mode(linked: Integers | None, episode: int) -> str | None:
    return None if linked is None or linked[episode] < 0 else f"m{linked[episode]}"


def _known(row: Any) -> Any:
    """The row with NaN as missing: unknown is never a number."""
    unknown = [
        name for name, value in vars(row).items() if isinstance(value, float) and np.isnan(value)
    ]
    return replace(row, **dict.fromkeys(unknown)) if unknown else row
