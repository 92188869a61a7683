"""Which questions the audit could ask of these data, and which not, and why not.

A question that could not be asked looks like one that was answered well. So each stands here with
a word on it: what is not asked is for a person to ask otherwise, or to waive with their name.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from genpolicy.audit.data import AuditInput, recorded
from genpolicy.audit.predictability import HISTORY
from genpolicy.audit.question_names import CLOCK, COLUMN, FROZEN, PAST
from genpolicy.audit.rows import Asked, Prediction
from genpolicy.audit.semantics import Semantics
from genpolicy.audit.settings import AuditSettings
from genpolicy.audit.variable import EPISODE_VARIABLES


@dataclass(frozen=True)
class Given:
    """Episodes that were replayed, and whether chunks were held against limits."""

    replays: int
    feasibility: bool


def questions(
    data: AuditInput,
    settings: AuditSettings,
    semantics: Semantics,
    told: Sequence[Prediction],
    phases: Iterable[str],
    *,
    given: Given,
) -> tuple[Asked, ...]:
    """Every question that depends on what was recorded or given, asked or not.

    Args:
        data: Canonical audit input.
        settings: Names of the reference and of the calibration phase.
        semantics: What the layer of data semantics measured.
        told: What variables tell of the modes.
        phases: Phases with several modes.
        given: What the audit was given beside the data.
    """
    epochs = len(np.unique(data.episodes.calibration_epoch))
    alone = "" if epochs > 1 else "there is one calibration epoch: nothing to hold it against"
    pairs = "" if data.paired else "no action commands an observed number"
    clock = data.position_stream in data.delay_s or settings.declared_lag_rows is not None
    late = (
        "no receive times and no declared lag: a clock that is late everywhere looks like a robot"
    )
    found = {
        "units_frames_and_lag": pairs,
        "constant_lag": pairs or ("" if clock else late),
        "calibration_at_reference": _releases(data, settings, semantics) or alone,
        "calibration_at_rest": pairs or alone,
        "labels": "" if given.replays else "no episode was replayed",
        "feasibility": ""
        if given.feasibility
        else "neither the mean nor a mode was held against limits",
    }
    found |= {
        f"{CLOCK}{name}": "neither receive times nor motion that the arm's explains"
        for name in semantics.unclocked
    }
    found |= {
        f"{FROZEN}{name}": "stands still for long in most episodes: a freeze would look the same"
        for name in semantics.untold_freezes
    }
    for name in EPISODE_VARIABLES:
        values = getattr(data.episodes, name)
        known = recorded(values) or name in {item.name for item in data.variables}
        found[name] = "" if known else "not recorded, so it may decide modes unseen"
    found |= {f"{COLUMN}{item.name}": "" for item in data.variables}
    found |= {f"{COLUMN}{name}": reason for name, reason in data.left_out}
    ordered = bool(np.all(np.isfinite(data.episodes.order)))
    found["order"] = "" if ordered else "not recorded: habits and drifts cannot be seen"
    past = {row.phase for row in told if row.variable == HISTORY}
    for phase in sorted(phases):
        apart = "where modes are, the observation differs: what came before was not held to them"
        found[f"{PAST}{phase}"] = "" if phase in past else apart
    return tuple(Asked(name, not reason, reason) for name, reason in found.items())


def _releases(data: AuditInput, settings: AuditSettings, semantics: Semantics) -> str:
    """Why the releases of some epoch were not held against the pose of reference."""
    if data.reference is None:
        return "no pose of reference"
    if not settings.calibration_phase:
        return "no phase of calibration was named"
    empty = [row.epoch for row in semantics.calibrations if row.episodes == 0]
    if empty:
        return f"no undisturbed success of epoch {', '.join(empty)} reaches the phase " + repr(
            settings.calibration_phase
        )
    return ""
