"""Calibration: does an epoch's frame lie where those of the others lie?

With a pose of reference by where the arm releases, and without one by how far the observed position
stands beside its command where both rest.
"""

import numpy as np

from genpolicy.audit.data import Array, AuditInput, Integers, Text
from genpolicy.audit.rows import Calibration, Finding
from genpolicy.audit.semantics.motion import Motion
from genpolicy.audit.semantics.robust import densest_half, episode_deviation, episode_medians
from genpolicy.audit.settings import AuditSettings

LEAST_EPISODES = 4
# Offsets below this share of the usual motion are no calibration: another unit may be in use.
MOTION_SHARE = 0.02
# Rows at rest: the slowest part of an episode.
REST_SHARE = 0.3
# Of the releases, so many lie nearer to the pose of reference than what is reported; a few that
# were labelled wrongly do not count.
MISSING_SHARE = 0.75
# Nor does what a hand that trembles misses by, in standard deviations of its tremor.
TREMORS = 3.0
# Median of a second difference of white noise, in its standard deviations.
NORMAL_BEND = 0.6745 * 6.0**0.5


def calibrations(data: AuditInput, settings: AuditSettings) -> tuple[Calibration, ...]:
    """Where each epoch releases, against the reference pose and the other epochs."""
    if data.reference is None:
        return ()
    residual, epochs = _releases(data, settings)
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
            residual_m=_epoch_residual(str(name), medians) if str(name) in medians else None,
        )
        for name in names
    )


def release_findings(
    data: AuditInput, found: tuple[Calibration, ...], settings: AuditSettings
) -> list[Finding]:
    """Epochs that release elsewhere, beyond what their scatter allows."""
    if data.reference is None:
        return []
    residual, epochs = _releases(data, settings)
    spread = _scatter(residual, epochs)
    findings = _missed(data, residual, epochs, settings)
    if findings:
        return findings  # where single releases miss by that much, an epoch's median says nothing
    for row in found:
        if row.residual_m is None or not np.isfinite(row.residual_m):
            continue
        error = 1.2533 * spread * np.sqrt(2.0 / max(row.episodes, 1))
        limit = max(settings.calibration_floor_m, settings.significance * float(error))
        if not limit - row.residual_m >= 0:
            findings.append(
                Finding(
                    kind="calibration",
                    variable=row.epoch,
                    where=f"epoch {row.epoch or '-'}",
                    question="calibration_residual_m",
                    measured=row.residual_m,
                    floor=limit,
                    unit="unit of the position",
                    action=f"Recalibrate or leave out epoch {row.epoch or '-'}: its releases lie "
                    f"{row.residual_m:.4g} (unit of the position) from those of the others.",
                )
            )
    return findings


def _missed(
    data: AuditInput, residual: Array, epochs: Text, settings: AuditSettings
) -> list[Finding]:
    """Releases that miss the pose of reference, each another way: it is not where it was seen."""
    if len(residual) < LEAST_EPISODES:
        return []
    centre = np.zeros_like(residual)
    for name in np.unique(epochs):
        centre[epochs == name] = np.median(residual[epochs == name], axis=0)
    apart = np.linalg.norm(residual - centre, axis=1)
    measured = float(np.quantile(apart, MISSING_SHARE))
    limit = max(settings.calibration_floor_m, TREMORS * _tremor(data, settings.calibration_phase))
    if limit - measured >= 0:
        return []
    return [
        Finding(
            kind="calibration",
            variable="reference",
            where="all episodes",
            question="calibration_residual_m",
            measured=measured,
            floor=limit,
            unit="unit of the position",
            action=f"A quarter of the releases lie {measured:.4g} (unit of the position) or more "
            "beside the pose of reference, each another way: what is released into is not where "
            "it was seen. Observe it up to the release, and repeat the audit.",
        )
    ]


def _tremor(data: AuditInput, phase: str) -> float:
    """Standard deviation of white noise of the position in the phase, from second differences."""
    inside = (data.episode[2:] == data.episode[:-2]) & (data.phase[2:] == phase)
    inside &= data.phase[:-2] == phase
    bends = np.diff(data.position[:, :2], n=2, axis=0)[inside]
    if len(bends) == 0:
        return 0.0
    return float(np.linalg.norm(np.median(np.abs(bends), axis=0) / NORMAL_BEND))


def offset_findings(data: AuditInput, motion: Motion, settings: AuditSettings) -> list[Finding]:
    """Epochs in which the observed position stands beside its command as in no other."""
    if motion.commanded.shape[1] == 0 or len(np.unique(motion.epoch)) < 2:
        return []
    offsets = _rest_offsets(motion)
    floor = offset_floor(motion, settings)
    names = np.unique(motion.epoch)
    medians = {str(name): np.median(offsets[motion.epoch == name], axis=0) for name in names}
    spread = _scatter(offsets, motion.epoch)
    findings = []
    for name in names:
        count = int(np.count_nonzero(motion.epoch == name))
        gap = _epoch_residual(str(name), medians)
        error = 1.2533 * spread * np.sqrt(2.0 / count)
        limit = max(floor, settings.significance * float(error))
        if count >= LEAST_EPISODES and not limit - gap >= 0:
            findings.append(
                Finding(
                    kind="calibration",
                    variable=str(name),
                    where=f"epoch {name or '-'}",
                    question="calibration_residual_m",
                    measured=gap,
                    floor=limit,
                    unit="unit of the position",
                    action=f"Recalibrate or leave out epoch {name or '-'}: at rest its observed "
                    f"position stands {gap:.4g} (unit of the position) further from the command "
                    "than that of the others.",
                )
            )
    return findings


def offset_floor(motion: Motion, settings: AuditSettings) -> float:
    """Offsets below it are not looked for, unit of the position."""
    travel = np.median(np.linalg.norm(episode_deviation(motion.commanded, motion.starts), axis=1))
    return max(settings.calibration_floor_m, MOTION_SHARE * float(travel))


def start_drift(data: AuditInput) -> float:
    """Largest difference of the median start between training and held-out episodes."""
    first = data.position[np.unique(data.first_row)]
    training = data.episodes.split == "train"
    if training.all() or not training.any() or first.shape[1] == 0:
        return 0.0
    gap = np.median(first[training], axis=0) - np.median(first[~training], axis=0)
    return float(np.max(np.abs(gap)))


def start_note(data: AuditInput) -> str | None:
    """A sentence where starts wander over the recordings; wandering starts are no fault.

    A drifting start makes the held-out episodes unlike the training ones: that is a matter of
    support, which the neighbourhoods measure, and never makes a mode.
    """
    first = data.position[np.unique(data.first_row)]
    order = data.episodes.order
    if not np.all(np.isfinite(order)) or len(order) < 30 or first.shape[1] == 0:
        return None
    ranked = first[np.argsort(order)]
    third = len(ranked) // 3
    early, late = ranked[:third], ranked[-third:]
    gap = np.abs(np.median(early, axis=0) - np.median(late, axis=0))
    spread = np.array([densest_half(column)[1] for column in (ranked - np.median(ranked, 0)).T])
    worst = int(np.argmax(gap / np.maximum(spread, 1e-12)))
    if gap[worst] <= max(2.0 * spread[worst], 1e-9):
        return None
    return (
        f"Starts wander over the recordings: component {worst} of the position by "
        f"{gap[worst]:.4g}, {gap[worst] / max(spread[worst], 1e-12):.1f} times its spread."
    )


def _releases(data: AuditInput, settings: AuditSettings) -> tuple[Array, Text]:
    """Released position minus the pose of reference, and the epoch, of undisturbed successes."""
    releases = _first_rows(data, settings.calibration_phase)
    releases = releases[data.episodes.outcome[data.episode[releases]] == "success"]
    releases = releases[~data.episodes.is_recovery[data.episode[releases]]]
    assert data.reference is not None
    start = data.reference.start
    planar = slice(start, min(data.reference.stop, start + 2))
    residual = data.position[releases][:, :2] - data.observation[releases][:, planar]
    return residual, data.episodes.calibration_epoch[data.episode[releases]]


def _scatter(values: Array, epochs: Text) -> float:
    """Spread of the values inside their epochs, over all components."""
    if len(values) == 0:
        return 0.0
    inside = values.copy()
    for name in np.unique(epochs):
        inside[epochs == name] -= np.median(values[epochs == name], axis=0)
    parts = [densest_half(np.concatenate([column, -column]))[1] for column in inside.T]
    return float(np.linalg.norm(parts))


def _rest_offsets(motion: Motion) -> Array:
    """Median of observed minus commanded over the rows at rest of each episode. Shape (E, P)."""
    steps = np.linalg.norm(np.diff(motion.commanded, axis=0, prepend=motion.commanded[:1]), axis=1)
    steps += np.linalg.norm(np.diff(motion.observed, axis=0, prepend=motion.observed[:1]), axis=1)
    gap = motion.observed - motion.commanded
    result = np.zeros((len(motion.starts) - 1, gap.shape[1]))
    for number, (a, b) in enumerate(zip(motion.starts[:-1], motion.starts[1:], strict=True)):
        if b - a < 4:
            result[number] = episode_medians(gap[a:b], np.array([0, b - a]))[0] if b > a else 0.0
            continue
        # The first row's step belongs to the episode before.
        slow = np.argsort(steps[a + 1 : b], kind="stable")[: max(3, int(REST_SHARE * (b - a)))]
        result[number] = np.median(gap[a + 1 : b][slow], axis=0)
    return result


def _epoch_residual(name: str, medians: dict[str, Array]) -> float:
    """Distance to the median epoch; with two epochs to the other one."""
    others = [value for key, value in medians.items() if key != name]
    if not others:
        return 0.0
    pool = others if len(medians) == 2 else list(medians.values())
    return float(np.linalg.norm(medians[name] - np.median(np.stack(pool), axis=0)))


def _first_rows(data: AuditInput, phase: str) -> Integers:
    rows = np.flatnonzero(data.phase == phase)
    _, first = np.unique(data.episode[rows], return_index=True)
    return np.asarray(rows[first], dtype=np.int64)
