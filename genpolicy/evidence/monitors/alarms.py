"""Thresholds and alarms as functions of recorded scores; verification computes them again."""

import math
from collections import defaultdict
from collections.abc import Sequence
from itertools import product

import numpy as np

from genpolicy.evidence.monitors.settings import (
    JUDGED,
    NOMINAL,
    THRESHOLDS,
    MonitorsSettings,
    family_of,
)
from genpolicy.evidence.rows.monitors import (
    MonitorAlarmRow,
    MonitorScoreRow,
    MonitorThresholdRow,
)
from genpolicy.evidence.rows.stress import RolloutRow
from genpolicy.monitors.names import TIME
from genpolicy.statistics.conformal import conformal_rank, conformal_threshold

Rollout = tuple[str, str, int]
"""Method, condition and start."""


def threshold_rows(
    scores: Sequence[MonitorScoreRow],
    rollouts: Sequence[RolloutRow],
    *,
    alpha: float,
    phases: Sequence[str],
) -> list[MonitorThresholdRow]:
    """Thresholds of every method and monitor in every phase, from the largest score of an episode.

    Args:
        scores: Those of the condition `thresholds` count, of episodes that succeeded.
        rollouts: How the episodes ended.
        alpha: Chance of an alarm in a phase of such an episode, at most.
        phases: Phases of the task.
    """
    good = {_of(row) for row in rollouts if row.success and row.perturbation == THRESHOLDS}
    largest: dict[tuple[str, str, str], dict[Rollout, float]] = defaultdict(dict)
    watched: dict[tuple[str, str], None] = {}
    for row in scores:
        if row.condition != THRESHOLDS:  # of who scores elsewhere only, nothing is known here
            continue
        rollout = (row.method, row.condition, row.start)
        watched[row.method, row.monitor] = None
        if rollout in good:
            own = largest[row.method, row.monitor, row.phase]
            own[rollout] = max(row.score, own.get(rollout, -math.inf))
    found = []
    for (method, monitor), phase in product(watched, phases):
        maxima = np.array(sorted(largest[method, monitor, phase].values()))
        threshold = conformal_threshold(maxima, alpha)
        found.append(
            MonitorThresholdRow(
                method=method,
                monitor=monitor,
                phase=phase,
                alpha=alpha,
                episodes=len(maxima),
                rank=conformal_rank(len(maxima), alpha),
                threshold=threshold if math.isfinite(threshold) else None,
            )
        )
    return found


def alarm_rows(
    scores: Sequence[MonitorScoreRow],
    rollouts: Sequence[RolloutRow],
    thresholds: Sequence[MonitorThresholdRow],
    settings: MonitorsSettings,
    *,
    contact_phases: frozenset[str],
) -> list[MonitorAlarmRow]:
    """What every monitor said of every phase of every rollout that was not used for a threshold.

    A probe that is felt in contact only has its onset at the first invocation of a contact phase.
    """
    above = {(row.method, row.monitor, row.phase): row.threshold for row in thresholds}
    onsets = _onsets(scores, settings, contact_phases)
    ends = {_of(row): row for row in rollouts if row.perturbation != THRESHOLDS}
    grouped: dict[tuple[Rollout, str, str], list[MonitorScoreRow]] = defaultdict(list)
    for row in scores:
        rollout = (row.method, row.condition, row.start)
        if rollout in ends:
            grouped[rollout, row.monitor, row.phase].append(row)
    return [
        _alarm(own, ends[rollout], onsets.get(rollout), above.get((rollout[0], monitor, phase)))
        for (rollout, monitor, phase), own in grouped.items()
    ]


def _alarm(
    own: Sequence[MonitorScoreRow],
    end: RolloutRow,
    onset_s: float | None,
    threshold: float | None,
) -> MonitorAlarmRow:
    felt = [row for row in own if onset_s is not None and row.time_s >= onset_s]
    alarmed = [row.time_s for row in felt if threshold is not None and row.score > threshold]
    first_s = min(alarmed, default=None)
    family, severity = family_of(end.perturbation)
    return MonitorAlarmRow(
        method=own[0].method,
        monitor=own[0].monitor,
        family=family,
        severity=severity,
        start=end.start,
        phase=own[0].phase,
        score_max=max((row.score for row in felt), default=None),
        alarm=bool(alarmed),
        first_alarm_s=first_s,
        onset_s=onset_s,
        delay_s=None if first_s is None or onset_s is None else first_s - onset_s,
        outcome=end.outcome,
        success=end.success,
        recovery_attempted=end.recovery_attempted,
        recovered=end.recovered,
        duration_s=end.duration_s,
    )


def _onsets(
    scores: Sequence[MonitorScoreRow], settings: MonitorsSettings, contact: frozenset[str]
) -> dict[Rollout, float]:
    """From when on a probe is felt, by rollout; absent where the rollout never got there."""
    found: dict[Rollout, float] = {}
    for row in scores:
        if row.monitor != TIME:  # the clock scores every invocation
            continue
        family, _ = family_of(row.condition)
        late = family != NOMINAL and settings.probes[family].felt == "contact"
        if late and row.phase not in contact:
            continue
        rollout = (row.method, row.condition, row.start)
        found[rollout] = min(row.time_s if late else 0.0, found.get(rollout, math.inf))
    return found


def _of(row: RolloutRow) -> Rollout:
    return row.method, row.perturbation, row.start


assert NOMINAL not in (THRESHOLDS, JUDGED)
