"""Calibration: does an epoch's frame lie where those of the others lie?"""

import numpy as np

from genpolicy.audit.data import Array, AuditInput, Integers
from genpolicy.audit.semantics.report import Calibration
from genpolicy.audit.settings import AuditSettings


def calibrations(data: AuditInput, settings: AuditSettings) -> tuple[Calibration, ...]:
    """Where each epoch releases, against the reference pose and the other epochs."""
    if data.reference is None:
        return ()
    releases = _first_rows(data, settings.calibration_phase)
    releases = releases[data.episodes.outcome[data.episode[releases]] == "success"]
    releases = releases[~data.episodes.is_recovery[data.episode[releases]]]
    start = data.reference.start
    planar = slice(start, min(data.reference.stop, start + 2))
    residual = data.position[releases][:, :2] - data.observation[releases][:, planar]
    epochs = data.episodes.calibration_epoch[data.episode[releases]]
    names = np.unique(data.episodes.calibration_epoch)
    medians = {
        str(name): np.median(residual[epochs == name], axis=0)
        for name in names
        if np.any(epochs == name)
    }
    return tuple(
        Calibration(
            epoch=str(name),
            episodes=int(np.count_nonzero(epochs == name)),
            residual_m=_epoch_residual(str(name), medians),
        )
        for name in names
    )


def _epoch_residual(name: str, medians: dict[str, Array]) -> float:
    """Distance to the median epoch; with two epochs to the other one; NaN without a release."""
    if name not in medians:
        return float("nan")
    others = [value for key, value in medians.items() if key != name]
    if not others:
        return 0.0
    pool = others if len(medians) == 2 else list(medians.values())
    return float(np.linalg.norm(medians[name] - np.median(np.stack(pool), axis=0)))


def start_drift(data: AuditInput) -> float:
    """Largest difference of the median start between training and held-out episodes."""
    first = data.position[np.unique(data.first_row)]
    training = data.episodes.split == "train"
    if training.all() or not training.any():
        return 0.0
    gap = np.median(first[training], axis=0) - np.median(first[~training], axis=0)
    return float(np.max(np.abs(gap)))


def _first_rows(data: AuditInput, phase: str) -> Integers:
    rows = np.flatnonzero(data.phase == phase)
    _, first = np.unique(data.episode[rows], return_index=True)
    return np.asarray(rows[first], dtype=np.int64)
