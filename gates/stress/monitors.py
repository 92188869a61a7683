"""What the monitors would have said: reported, and judged by nothing.

No monitor has authority: scores are computed from journals after a rollout is over. So no criterion
hangs on one, and what is said here is what a team must know before it gives one a part: what it
would have missed, and what that costs, beside a clock and the spread of the draws.

The unit is the rollout of a start; rows of one start under several probes are one draw.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from gates.bounds import wide_interval
from gates.engine import Judged
from gates.evidence import Evidence, MissingEvidenceError, flags, numbers
from gates.stress.rollouts import StressSettings
from gates.words import percent
from genpolicy.errors import GenpolicyError, IntegrityError
from genpolicy.evidence.rows.monitors import MonitorAlarmRow, MonitorThresholdRow
from genpolicy.monitors.names import CONTROLS, TIME, VARIANCE

MONITORS = "artifacts/monitors"
ALARMS, THRESHOLDS = f"{MONITORS}/alarms.parquet", f"{MONITORS}/thresholds.parquet"
NOMINAL = "nominal"
MISSED, ANSWERED, FALSE = "missed_failure", "alarmed_failure", "false_alarm"
"""Cells of the cost matrix: no alarm before a failure, one before it, one in a success. A success
without an alarm costs nothing."""
NO_AUTHORITY = (
    "No monitor has authority: scores are computed from journals after a rollout is over, and no "
    "stop, hold or call for a person in this ladder hangs on one."
)
UNWATCHED = "no monitor was looked at: no probe was run (`monitors` in params.yaml)"
IN_WORDS = {TIME: "the clock", VARIANCE: "the spread of the draws"}
BLIND = "no monitor could watch it; why stands with the table of monitors"
Interval = tuple[float, float, float]
"""Share, lower and upper end; NaN, 0 and 1 where there was no case."""


@dataclass(frozen=True)
class Watched:
    """What one monitor did over all rollouts of a candidate.

    Attributes:
        monitor: Its name.
        failures: Rollouts under a probe that was felt, and that failed.
        coverage: Share of these with an alarm before they failed.
        successes: Nominal rollouts that succeeded, none of which set a threshold.
        false_alarms: Share of these with an alarm in any phase.
        worst_phase: Phase with most false alarms, and its share with interval.
        allowed: What the thresholds allow in a phase.
        silent: Phases with a score that have no threshold: too few episodes.
        delay_s: Median delay of the alarms counted in `coverage`, s; None without any.
        cost: Mean cost of a case (`cases`) under the stated matrix; None where none is stated.
    """

    monitor: str
    failures: int
    coverage: Interval
    successes: int
    false_alarms: Interval
    worst_phase: tuple[str, Interval]
    allowed: float
    silent: tuple[str, ...]
    delay_s: float | None
    cost: float | None

    @property
    def is_control(self) -> bool:
        """Whether it is one of the two that monitors are held against."""
        return self.monitor in CONTROLS


@dataclass(frozen=True)
class Candidate:
    """Every monitor of a candidate, as its rows came.

    Attributes:
        watched: By the order of the table.
        failed_before: Rollouts under a probe that failed before it could be felt: no cases.
        quiet_cost: Mean cost of a case if nothing ever alarmed; None where no matrix is stated.
        loud_cost: The same if everything did.
    """

    watched: tuple[Watched, ...]
    failed_before: int = 0
    quiet_cost: float | None = None
    loud_cost: float | None = None

    @property
    def controls(self) -> tuple[str, ...]:
        """The controls that were there, in words: who draws one chunk at a time has no spread."""
        return tuple(IN_WORDS[one.monitor] for one in self.watched if one.is_control)

    @property
    def better_than_controls(self) -> tuple[str, ...]:
        """Monitors whose coverage lies, with confidence, above that of each control."""
        controls = [one.coverage[2] for one in self.watched if one.is_control]
        return tuple(
            one.monitor
            for one in self.watched
            if not one.is_control and all(one.coverage[1] > upper for upper in controls)
        )


def watched_of(evidence: Evidence, settings: StressSettings, candidate: str) -> Candidate:
    """What the monitors would have said of a candidate.

    Raises:
        MissingEvidenceError: Nothing was run under a probe.
    """
    rows = evidence.of(ALARMS, MonitorAlarmRow, candidate)
    thresholds = evidence.of(THRESHOLDS, MonitorThresholdRow, candidate)
    rollouts = by_rollout(rows)
    names = list(dict.fromkeys(rows["monitor"].astype(str)))
    costs = {name: settings.monitor_cost(name) for name in (MISSED, ANSWERED, FALSE)}
    some = rollouts[rollouts["monitor"] == names[0]]
    counted = cases(some)
    failed = ~flags(counted, "success")
    others = some.drop(counted.index)
    return Candidate(
        tuple(
            _watched(
                rollouts[rollouts["monitor"] == name],
                rows[rows["monitor"] == name],
                thresholds[thresholds["monitor"] == name],
                settings,
                costs,
            )
            for name in names
        ),
        failed_before=len(others) - int(flags(others, "success").sum()),
        quiet_cost=_cost(failed, np.zeros(len(failed), dtype=bool), costs),
        loud_cost=_cost(failed, np.ones(len(failed), dtype=bool), costs),
    )


def by_rollout(rows: pd.DataFrame) -> pd.DataFrame:
    """One row per monitor and rollout: the first alarm of any phase, with its phase."""
    key = ["method", "monitor", "family", "severity", "start"]
    first = rows.assign(
        at=pd.to_numeric(rows["first_alarm_s"]).fillna(math.inf), said=flags(rows, "alarm")
    ).sort_values([*key, "at"], kind="stable")
    found = first.groupby(key, sort=False, as_index=False).agg(
        alarm=("said", "max"),
        phase=("phase", "first"),
        delay_s=("delay_s", "first"),
        onset_s=("onset_s", "first"),
        success=("success", "first"),
        outcome=("outcome", "first"),
        recovery_attempted=("recovery_attempted", "first"),
        recovered=("recovered", "first"),
    )
    # The phase of the first alarm is no phase where there was none.
    return found.assign(phase=found["phase"].where(found["alarm"].astype(bool), ""))


def felt(rollouts: pd.DataFrame) -> pd.DataFrame:
    """Rollouts under a probe that got as far as where it is felt."""
    return rollouts[(rollouts["family"] != NOMINAL) & rollouts["onset_s"].notna()]


def cases(rollouts: pd.DataFrame) -> pd.DataFrame:
    """Rollouts that say something of a monitor: nominal ones, and those that felt their probe.

    Before a probe can be felt no alarm counts, so that a failure there would be charged to every
    monitor as one that it missed, and to none that always alarms.
    """
    return rollouts[(rollouts["family"] == NOMINAL) | rollouts["onset_s"].notna()]


def share(rows: pd.DataFrame, confidence: float) -> Interval:
    """Share of rollouts with an alarm, over their starts; good of probes, bad of successes."""
    if len(rows) == 0:
        return (math.nan, 0.0, 1.0)
    hits = flags(rows, "alarm")
    return wide_interval(hits, rows["start"].to_numpy(), confidence=confidence)


def monitors_said(judged: Judged) -> list[str]:
    """That no monitor has a say, and of each candidate how the monitors did."""
    said = [NO_AUTHORITY]
    for candidate in judged.candidates:
        try:
            nothing = unwatched(judged.evidence)
            found = None if nothing else watched_of(judged.evidence, judged.settings, candidate)
        except IntegrityError:  # other bytes than were written are no gap in what is known
            raise
        except (MissingEvidenceError, GenpolicyError) as error:
            said.append(f"{candidate}: no monitor was looked at: {error}.")
            continue
        said.append(f"{candidate}: {UNWATCHED if found is None else _sentence(found)}.")
    return said


def unwatched(evidence: Evidence) -> bool:
    """Whether no probe was run: the table lies there and has no rows.

    Raises:
        MissingEvidenceError: There is no such table.
    """
    return not evidence.records(ALARMS, MonitorAlarmRow)


def _sentence(found: Candidate) -> str:
    own = [one for one in found.watched if not one.is_control]
    if not own:
        return BLIND
    best = max(own, key=lambda one: -1.0 if math.isnan(one.coverage[0]) else one.coverage[0])
    count = found.failed_before
    before = f"{count} failed before the probe could be felt" if count else ""
    if not best.failures:
        what = f"under probes {before}, and none after" if before else "no probe made it fail"
        return f"{what}, so that what a monitor would miss was not seen"
    clock = next(one for one in found.watched if one.monitor == TIME)
    better, controls = found.better_than_controls, " and ".join(found.controls)
    shown = (
        f"covers more than {controls}: {', '.join(better)}"
        if better
        else f"no monitor is shown to cover more than {controls}"
    )
    return (
        f"of {best.failures} failures under probes, {best.monitor} had an alarm before "
        f"{percent(best.coverage[0])} ({percent(best.coverage[1])} to {percent(best.coverage[2])}),"
        f" more than any other monitor or as many, and the clock before "
        f"{percent(clock.coverage[0])}; {shown}"
        f"{f'; {before} and are no case' if before else ''}"
    )


def _watched(
    rollouts: pd.DataFrame,
    rows: pd.DataFrame,
    thresholds: pd.DataFrame,
    settings: StressSettings,
    costs: dict[str, float | None],
) -> Watched:
    level = settings.confidence
    probed = felt(rollouts)
    failures = probed[~flags(probed, "success")] if len(probed) else probed
    nominal = rollouts[rollouts["family"] == NOMINAL]
    good = nominal[flags(nominal, "success")] if len(nominal) else nominal
    phases = rows[(rows["family"] == NOMINAL) & flags(rows, "success")]
    each = [
        (str(phase), share(phases[phases["phase"] == phase], level))
        for phase in dict.fromkeys(phases["phase"])
    ]
    told = failures[flags(failures, "alarm")] if len(failures) else failures
    counted = cases(rollouts)
    seen = set(rows["phase"].astype(str))
    open_ones = thresholds[thresholds["threshold"].isna()]["phase"].astype(str)
    return Watched(
        monitor=str(rollouts["monitor"].iloc[0]),
        failures=len(failures),
        coverage=share(failures, level),
        successes=len(good),
        false_alarms=share(good, level),
        worst_phase=max(each, key=lambda item: item[1][0], default=("", (math.nan, 0.0, 1.0))),
        allowed=float(numbers(thresholds, "alpha").max()),
        silent=tuple(phase for phase in open_ones if phase in seen),
        delay_s=float(np.median(numbers(told, "delay_s"))) if len(told) else None,
        cost=_cost(~flags(counted, "success"), flags(counted, "alarm"), costs),
    )


def _cost(
    failed: Sequence[bool] | np.ndarray,
    alarmed: Sequence[bool] | np.ndarray,
    costs: dict[str, float | None],
) -> float | None:
    """Mean cost of a case; None without any, or where a cell of the matrix is not stated."""
    failed, alarmed = np.asarray(failed), np.asarray(alarmed)
    missed, answered, false = (costs[name] for name in (MISSED, ANSWERED, FALSE))
    if missed is None or answered is None or false is None or len(failed) == 0:
        return None
    total = np.where(failed, np.where(alarmed, answered, missed), np.where(alarmed, false, 0.0))
    return float(total.mean())
