"""Rollouts for the monitors: of what starts, and under which probe.

Starts of the three kinds are named streams of their own: no start that sets a threshold counts a
false alarm, none of either is one of the matched comparison, and all severities share theirs.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from genpolicy.candidates.contenders import Contender
from genpolicy.candidates.joining import DRAWN_ON, JoiningSettings
from genpolicy.errors import ConfigError, GenpolicyError
from genpolicy.evidence.monitors.settings import (
    JUDGED,
    THRESHOLDS,
    WHERE,
    MonitorsSettings,
    condition_of,
)
from genpolicy.evidence.stress.latency import LatencyModel
from genpolicy.evidence.stress.perturbations import Nominal
from genpolicy.evidence.stress.shard import Comparison, Shard
from genpolicy.seeds import stream
from genpolicy.tasks.api import NOMINAL_PROBE, Task, WorldSettings

PROBED = "probed"
STREAM = "monitors"


@dataclass(frozen=True)
class Condition:
    """Rollouts of one kind.

    Attributes:
        name: Their condition.
        probe: What the task is under.
        kind: Which starts; all conditions of a kind share them.
        count: How many.
    """

    name: str
    probe: str
    kind: str
    count: int


def setting_thresholds(settings: MonitorsSettings) -> list[Condition]:
    """Nominal rollouts whose successes set the thresholds."""
    return [Condition(THRESHOLDS, NOMINAL_PROBE, THRESHOLDS, settings.threshold_starts)]


def judging(settings: MonitorsSettings) -> list[Condition]:
    """Other nominal rollouts, then every family and severity."""
    probed = [Condition(name, name, PROBED, settings.probe_starts) for name in settings.conditions]
    return [Condition(JUDGED, NOMINAL_PROBE, JUDGED, settings.judged_starts), *probed]


def require_runnable(
    settings: MonitorsSettings, joining: JoiningSettings, task: Task, *, root_seed: int
) -> None:
    """Refuse probes that cannot be run or scored, before anything else is run for hours.

    Args:
        settings: Section `monitors`.
        joining: The rule of all methods, `stress.joining`.
        task: Makes a world of each probe.
        root_seed: `seed`.

    Raises:
        ConfigError: Chunks join by a rule under which none can be drawn again by itself, or the
            task knows no such probe.
    """
    if not settings.on:
        return
    if joining.rule in DRAWN_ON:
        raise ConfigError(
            where=WHERE,
            found=f"probes, and stress.joining: {joining.rule}",
            expected="a rule under which what an invocation draws hangs on what it sees alone",
            action="Leave out the probes (`monitors: {}`), or choose another rule.",
        )
    (text,) = starts_of(task, PROBED, root_seed=root_seed, count=1)
    for name, family in settings.probes.items():
        for severity in family.severities:
            probe = WorldSettings(task.calibration_epochs[-1], condition_of(name, severity))
            try:
                task.make_world(task.start_from_json(text), settings=probe)
            except GenpolicyError as error:
                raise ConfigError(
                    where=f"{WHERE}.probes.{name}",
                    found=f"refused by the task {task.name} at severity {severity:g}: {error}",
                    expected="a probe that the task can be run under",
                    action="Correct or leave out the probe.",
                ) from error


def starts_of(task: Task, kind: str, *, root_seed: int, count: int) -> tuple[str, ...]:
    """Initial states of one kind, as JSON; start i does not depend on how many there are."""
    return tuple(
        task.sample_start(stream(root_seed, STREAM, kind, index)).to_json()
        for index in range(count)
    )


def start_hashes(task: Task, settings: MonitorsSettings, *, root_seed: int) -> list[str]:
    """Condition, start and hash of the state after reset, of every rollout that is planned."""
    found = []
    for one in (*setting_thresholds(settings), *judging(settings)):
        starts = starts_of(task, one.kind, root_seed=root_seed, count=one.count)
        for index, text in enumerate(starts):
            world = task.make_world(
                task.start_from_json(text),
                settings=WorldSettings(task.calibration_epochs[-1], one.probe, seed=index),
            )
            found.append(f"{one.name}/{index}/{world.state_sha256()}")
    return found


def plan_thresholds(
    comparison: Comparison,
    judged: Sequence[Contender],
    settings: MonitorsSettings,
    task: Task,
    *,
    latency: Mapping[str, LatencyModel],
    journals: Path,
) -> list[Shard]:
    """Nominal rollouts whose successes set the thresholds, one shard per method."""
    conditions = setting_thresholds(settings)
    return _shards(comparison, judged, task, conditions, latency=latency, journals=journals)


def plan_judged(
    comparison: Comparison,
    judged: Sequence[Contender],
    settings: MonitorsSettings,
    task: Task,
    *,
    latency: Mapping[str, LatencyModel],
    journals: Path,
) -> list[Shard]:
    """Other nominal rollouts, then every family and severity; a shard per method and condition."""
    conditions = judging(settings)
    return _shards(comparison, judged, task, conditions, latency=latency, journals=journals)


def _shards(
    comparison: Comparison,
    judged: Sequence[Contender],
    task: Task,
    conditions: Sequence[Condition],
    *,
    latency: Mapping[str, LatencyModel],
    journals: Path,
) -> list[Shard]:
    drawn = {
        one.kind: starts_of(task, one.kind, root_seed=comparison.root_seed, count=one.count)
        for one in conditions
    }
    return [
        Shard(
            comparison=replace(comparison, starts=drawn[one.kind]),
            judged=policy,
            latency=latency[policy.name],
            perturbation=one.name,
            schedule=Nominal(),
            journal=journals / f"{policy.name}__{one.name}.mcap",
            probe=one.probe,
        )
        for one in conditions
        for policy in judged
    ]
