"""The audit's evidence as files: the tables that the gate reads, and nothing that decides."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from genpolicy.audit.data import AuditInput, Integers
from genpolicy.audit.examples import (
    alignment,
    example_chunks,
    position_names,
    position_unit,
    support_points,
)
from genpolicy.audit.labels import disagreement
from genpolicy.audit.persistence import persistent
from genpolicy.audit.run import AuditResult
from genpolicy.audit.settings import AuditSettings
from genpolicy.audit.situations import Situation
from genpolicy.integrity.atomic import write_bytes
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.tables import write_table

TEXT, WHOLE, REAL, FLAG = pa.string(), pa.int64(), pa.float64(), pa.bool_()

CLOCKS = pa.schema(
    [
        ("stream", TEXT), ("epoch", TEXT), ("episodes", WHOLE), ("offset_before_s", REAL),
        ("offset_after_s", REAL), ("lag_steps", REAL), ("receive_delay_p50_s", REAL),
        ("receive_delay_p95_s", REAL), ("jitter_p95_s", REAL),
    ]
)  # fmt: skip
CALIBRATION = pa.schema([("epoch", TEXT), ("episodes", WHOLE), ("residual_m", REAL)])
NEIGHBOURHOODS = pa.schema(
    [
        ("split", TEXT), ("phase", TEXT), ("episode_uuid", TEXT), ("index", WHOLE),
        ("neighbours", WHOLE), ("clusters", WHOLE), ("cluster_sizes", pa.list_(WHOLE)),
        ("two_mode", FLAG), ("separation_m", REAL), ("mean_admissible", FLAG),
        ("mean_reason", TEXT), ("modes_admissible", WHOLE), ("mean_path", pa.list_(REAL)),
        ("mode_paths", pa.list_(pa.list_(REAL))), ("persistent", FLAG),
    ]
)  # fmt: skip
MODES = pa.schema(
    [
        ("mode", TEXT), ("phase", TEXT), ("episodes", WHOLE), ("successes", WHOLE),
        ("success_lower", REAL), ("success_upper", REAL), ("admissible", WHOLE),
        ("checked", WHOLE),
    ]
)  # fmt: skip
STRATA = pa.schema(
    [
        ("variable", TEXT), ("phase", TEXT), ("p_value", REAL), ("p_adjusted", REAL),
        ("effect", REAL), ("effect_lower", REAL), ("effect_upper", REAL), ("n", WHOLE),
        ("recorded", FLAG), ("observed", FLAG), ("detail", TEXT),
    ]
)  # fmt: skip
PREDICTIONS = pa.schema(
    [
        ("variable", TEXT), ("phase", TEXT), ("told", REAL), ("told_lower", REAL),
        ("told_upper", REAL), ("right", REAL), ("chance", REAL), ("n", WHOLE), ("detail", TEXT),
    ]
)  # fmt: skip
ASKED = pa.schema([("check", TEXT), ("asked", FLAG), ("reason", TEXT)])
REPLAY = pa.schema([("episode_uuid", TEXT), ("label", TEXT), ("replayed", TEXT), ("mode", TEXT)])
RECOVERY = pa.schema([("split", TEXT), ("mode", TEXT), ("episodes", WHOLE), ("successes", WHOLE)])

FINDINGS = pa.schema(
    [
        ("kind", TEXT), ("variable", TEXT), ("where", TEXT), ("question", TEXT),
        ("measured", REAL), ("floor", REAL), ("unit", TEXT), ("action", TEXT),
    ]
)  # fmt: skip
EXAMPLES = pa.schema(
    [
        ("example", WHOLE), ("phase", TEXT), ("two_mode", FLAG), ("query_uuid", TEXT),
        ("query_index", WHOLE), ("episode_uuid", TEXT), ("is_query", FLAG), ("distance", REAL),
        ("cluster", WHOLE), ("coordinate", REAL), ("path", pa.list_(REAL)),
    ]
)  # fmt: skip
RESAMPLES = pa.schema(
    [
        ("disagreements", WHOLE), ("disagreement_upper", REAL), ("two_mode", WHOLE),
        ("two_mode_episodes", WHOLE), ("incoherent", WHOLE), ("persistent", WHOLE),
        ("kept", REAL), ("kept_null_q95", REAL), ("kept_n", WHOLE),
        ("p_adjusted", pa.list_(REAL)), ("effect", pa.list_(REAL)),
        ("effect_lower", pa.list_(REAL)), ("told", pa.list_(REAL)),
        ("success_lower", pa.list_(REAL)), ("admissible", pa.list_(WHOLE)),
    ]
)  # fmt: skip
ALIGNMENT = pa.schema(
    [
        ("episode_uuid", TEXT), ("epoch", TEXT), ("order", REAL), ("lag_steps", REAL),
        ("offset_before_s", REAL), ("offset_after_s", REAL),
    ]
)  # fmt: skip
SUPPORT = pa.schema(
    [
        ("phase", TEXT), ("episode_uuid", TEXT), ("index", WHOLE), ("analysed", FLAG),
        ("two_mode", FLAG), ("position", pa.list_(REAL)),
    ]
)  # fmt: skip


def write_evidence(
    result: AuditResult,
    folder: Path,
    *,
    settings: AuditSettings,
    obstacles: Sequence[Mapping[str, float]] = (),
) -> None:
    """Write every table and document of the audit into an existing folder.

    Args:
        result: The audit.
        folder: Existing folder.
        settings: What the audit was made with; its floors stand beside the numbers.
        obstacles: Round obstacles in the base frame, for plots: `x_m`, `y_m`, `radius_m`.

    Raises:
        BadInputError: The place cannot be written.
    """
    tables = {
        "clocks": _table(result.semantics.clocks, CLOCKS),
        "calibration": _table(result.semantics.calibrations, CALIBRATION),
        "neighbourhoods": pa.Table.from_pylist(
            [_situation(result.data, item) for item in result.situations], NEIGHBOURHOODS
        ),
        "modes": _table(result.modes, MODES),
        "strata": _table(result.strata, STRATA),
        "predictions": _table(result.told, PREDICTIONS),
        "asked": _table(result.asked, ASKED),
        "replay": pa.Table.from_pylist(_replays(result), REPLAY),
        "recovery": _table(result.recovery, RECOVERY),
        "findings": _table(result.semantics.findings, FINDINGS),
        "resamples": _table(result.resamples, RESAMPLES),
        "examples": _table(example_chunks(result, settings), EXAMPLES),
        "alignment": _table(alignment(result, settings), ALIGNMENT),
        "support": _table(support_points(result), SUPPORT),
    }
    for name, table in tables.items():
        write_table(folder / f"{name}.parquet", table)
    write_bytes(folder / "persistence.json", canonical_json(asdict(result.persistence)))
    write_bytes(folder / "settings.json", canonical_json(settings.model_dump(mode="json")))
    write_bytes(
        folder / "summary.json",
        canonical_json(summary(result, settings) | {"obstacles": [dict(o) for o in obstacles]}),
    )


def summary(result: AuditResult, settings: AuditSettings) -> dict[str, Any]:
    """Counts and floors, as written to `summary.json`."""
    wrong, replays, upper = disagreement(result.replayed)
    several = [item for item in result.situations if item.two_mode]
    checked = [item for item in several if item.chunks.mean_admissible is not None]
    return {
        "modes_before_realignment": result.counts.two_mode_episodes,
        "modes_after_realignment": result.modes_after_realignment,
        "episodes": len(result.data.episodes),
        "floors": settings.floors,
        "metre": settings.metre,
        "primary_phase": result.primary_phase,
        "rows": len(result.data.observation),
        "counts": asdict(result.counts),
        **_by_phase(result),
        "position_names": position_names(result.data),
        "position_unit": position_unit(result.data),
        "support": [
            {"phase": item.phase, "queries": item.queries, "analysed": item.analysed}
            for item in result.support
        ],
        "two_mode_by_phase": {
            phase: sum(item.phase == phase for item in several)
            for phase in sorted({item.phase for item in several})
        },
        "mean_checked": len(checked),
        "mean_defeated": sum(_defeated(item) for item in checked),
        "median_defeated": sum(not item.chunks.median_admissible for item in checked),
        "label_disagreements": wrong,
        "label_replays": replays,
        "label_disagreement_upper": upper,
        "gaps": result.semantics.gaps,
        "negative_delays": result.semantics.negative_delays,
        "start_drift": result.semantics.start_drift,
        "notes": list(result.semantics.notes),
    }


def _by_phase(result: AuditResult) -> dict[str, int | None]:
    """Held-out episodes with several modes, with the phase looked at and without.

    With one phase only both are the same number, because there is nothing to look at.
    """
    here, other = result.counts.two_mode_episodes, result.modes_other_phases
    other = here if other is None else other
    seen = result.data.phase_observed
    return {
        "modes_with_phase": here if seen else other,
        "modes_without_phase": other if seen else here,
    }


def _defeated(item: Situation) -> bool:
    """The mean is refused and every modal chunk passes."""
    return not item.chunks.mean_admissible and all(item.chunks.mode_admissible)


def _situation(data: AuditInput, item: Situation) -> dict[str, Any]:
    query = item.neighbourhood.query
    episode = int(data.episode[query])
    position = data.action_position
    return {
        "split": str(data.episodes.split[episode]),
        "phase": item.phase,
        "episode_uuid": str(data.episodes.uuid[episode]),
        "index": int(data.index[query]),
        "neighbours": len(item.neighbourhood.rows),
        "clusters": item.clustering.count,
        "cluster_sizes": list(item.clustering.sizes),
        "two_mode": item.two_mode,
        "separation_m": item.clustering.separation,
        "mean_admissible": item.chunks.mean_admissible,
        "mean_reason": item.chunks.mean_reason,
        "modes_admissible": sum(item.chunks.mode_admissible),
        "mean_path": item.chunks.mean[:, position].ravel().tolist(),
        "mode_paths": [mode[:, position].ravel().tolist() for mode in item.chunks.modes],
        "persistent": persistent(item.identity),
    }


def _replays(result: AuditResult) -> list[dict[str, Any]]:
    """Replayed episodes with the mode that each followed, in the phase with most situations."""
    linked = result.links.get(result.primary_phase)
    places = {str(uuid): place for place, uuid in enumerate(result.data.episodes.uuid)}
    return [
        asdict(item) | {"mode": _mode(linked, places[item.episode_uuid])}
        for item in result.replayed
    ]


def _mode(linked: Integers | None, episode: int) -> str | None:
    return None if linked is None or linked[episode] < 0 else f"m{linked[episode]}"


def _table(rows: Sequence[Any], schema: pa.Schema) -> pa.Table:
    """Rows of dataclasses in the columns of `schema`; fields that it lacks are left out."""
    return pa.Table.from_pylist(
        [
            {name: _plain(value) for name, value in asdict(row).items() if name in schema.names}
            for row in rows
        ],
        schema,
    )


def _plain(value: Any) -> Any:
    """NaN is written as missing: unknown is never a number."""
    return None if isinstance(value, float) and np.isnan(value) else value
