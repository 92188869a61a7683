"""Evidence of the monitors: a support that sees probes, a clock that sees long failures.

Thresholds and alarms are computed from these scores as the stage computes them; what the scores
mean is planned here: 12 successes set thresholds, 6 of 8 judged episodes succeed, two families.
"""

from pathlib import Path
from typing import Any

from genpolicy.evidence.monitors.alarms import alarm_rows, threshold_rows
from genpolicy.evidence.monitors.settings import MonitorsSettings
from genpolicy.evidence.rows.monitors import (
    MonitorAlarmRow,
    MonitorScoreRow,
    MonitorThresholdRow,
    MonitorUnavailableRow,
)
from genpolicy.evidence.rows.stress import RolloutRow
from genpolicy.integrity.rows import write_rows
from genpolicy.monitors.names import TIME, VARIANCE

METHODS = ("diffusion", "flow")
PHASES = ("approach", "insert")
CONTACT = frozenset({"insert"})
SECTION: dict[str, Any] = {
    "kinds": ["support", "seed_disagreement"],
    "alpha": 0.1,
    "threshold_starts": 12,
    "judged_starts": 8,
    "probe_starts": 4,
    "probes": {
        "lighting": {"severities": [1.0, 2.0]},
        "contact_anomaly": {"severities": [2.0], "felt": "contact"},
    },
}
STARTS = {"thresholds": 12, "judged": 8} | dict.fromkeys(
    ("lighting@1", "lighting@2", "contact_anomaly@2"), 4
)
NUMBERS = {
    "ticks": 100, "action_ticks": 90, "hold_ticks": 10, "fallback_ticks": 0, "deadline_misses": 0,
    "discards": 0, "rejections": 0, "rejected_by": "", "interventions": 0,
    "action_age_p50_s": 0.1, "action_age_p95_s": 0.2, "action_age_max_s": 0.3,
    "latency_p95_s": 0.05, "force_peak_n": 3.0, "mode": "left", "person_s": 0.0,
}  # fmt: skip


def succeeds(condition: str, start: int) -> bool:
    """Every episode for thresholds; six of eight judged ones; of probes, every other."""
    if condition == "judged":
        return start < 6
    return condition == "thresholds" or start % 2 == 0


def rollouts() -> list[RolloutRow]:
    """One row per planned rollout; who fails has tried to recover, and takes longer."""
    return [
        RolloutRow(
            method=method, seed=0, perturbation=condition, start=start, start_sha256=f"{start:064}",
            outcome="success" if succeeds(condition, start) else "timeout",
            success=succeeds(condition, start),
            duration_s=4.0 if succeeds(condition, start) else 12.0,
            invocations=8 if succeeds(condition, start) else 24,
            recovery_attempted=not succeeds(condition, start), recovered=False, **NUMBERS,
        )
        for condition, count in STARTS.items() for method in METHODS for start in range(count)
    ]  # fmt: skip


def scores() -> list[MonitorScoreRow]:
    """Support: 1 and a little of the start; 9 in the insertion of a probe that fails."""
    found = []
    for row in rollouts():
        for invocation in range(row.invocations):
            time_s = 0.5 * invocation
            phase = PHASES[invocation >= 4]
            probed = row.perturbation not in ("thresholds", "judged")
            out = probed and not row.success and phase == "insert"
            values = {
                "support": (9.0 if out else 1.0) + 0.01 * row.start,
                TIME: time_s,
                VARIANCE: 0.5 + 0.01 * ((7 * row.start + invocation) % 5),
            }
            found += [
                MonitorScoreRow(
                    row.method, row.perturbation, row.start, invocation, time_s, phase, name, value
                )
                for name, value in values.items()
            ]
    return found


def write_watched(root: Path) -> None:
    """The tables of the stage, without journals."""
    folder = root / "artifacts" / "monitors"
    folder.mkdir(parents=True)
    settings = MonitorsSettings(**SECTION)
    above = threshold_rows(scores(), rollouts(), alpha=settings.alpha, phases=PHASES)
    alarms = alarm_rows(scores(), rollouts(), above, settings, contact_phases=CONTACT)
    write_rows(folder / "rollouts.parquet", RolloutRow, rollouts())
    write_rows(folder / "scores.parquet", MonitorScoreRow, scores())
    write_rows(folder / "thresholds.parquet", MonitorThresholdRow, above)
    write_rows(folder / "alarms.parquet", MonitorAlarmRow, alarms)
    absent = [
        MonitorUnavailableRow(method, "seed_disagreement", "one seed: no other training is there")
        for method in METHODS
    ]
    write_rows(folder / "unavailable.parquet", MonitorUnavailableRow, absent)
