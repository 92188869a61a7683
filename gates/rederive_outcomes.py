"""Whether rollouts ended as their journals say: the recorded commands are played again.

A journal and a row that both say `success` are two sentences of whoever wrote them. Here a sample
of rollouts is begun again where the plan begins, under the condition that it plans, and commanded
what was recorded, tick by tick. The arm must go where its journal says, feel what it says, and the
world must end it as it says. Most of the sample are successes: those are worth a lie. A success in
the last moment is always asked, since that is what a timeout becomes when only its name changes.
Of every rollout, asked or not, it is known when its outcome may come: none behind the end of the
time, a timeout only there, and a call for a person where recovery had a reason to (`called_for`).

The sample is drawn by a hash of all journals of a folder and of its table of rollouts, so that
whoever changes one of them draws all samples anew, and all must miss at once. Whoever writes all of
them can still try again and again, offline, until they do: one lie among many rollouts is missed at
once or after a few tries, and each lie more makes it more tries. What a sample cannot rule out it
makes dear, and no more.

Measured on 24 scripted rollouts, 12 of them in contact, up to 87 N, each played again 20 times
(27 November 2026): a start or commands that are 1e-9 beside it move a state by 7e-9 before contact,
by 6e-8 in it, and a force by 1e-4 N; 1e-7 by 7e-7, 3e-6 and 6e-3 N; 1e-5 by 7e-5, 1.3e-4 and 1.1 N.
Of the 480 none ended otherwise or at another tick. Contact is no chaos here, so what another
processor rounds is no reason for another outcome.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gates.called_for import uncalled_for
from gates.played_again import FORCE, POSE, Played, Recorded, play, recorded_rollouts
from gates.rederive_shadow import TaskSection
from gates.report import Gate
from gates.sampled import ROLLOUTS, salt_of
from gates.stated import refuse, root_seed, section
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.evidence.stress.matched import matched_starts
from genpolicy.evidence.stress.settings import StressSettings
from genpolicy.evidence.stress.state import Outcome
from genpolicy.execution.cell import ExecutionSettings
from genpolicy.execution.nanoseconds import NS_PER_S, to_ns
from genpolicy.seeds import stream
from genpolicy.tasks.api import NOMINAL_PROBE, Start, Task, World, WorldSettings, load_task
from genpolicy.tasks.same_again import FORCE_N, FREE, IN_CONTACT
from genpolicy.verification.journal_source import readable

OF_A_JOURNAL = 6
"""Rollouts of a journal of the comparison that are played again; four of them successes."""
OF_A_PROBE = 3
"""The same of a journal of the monitors or of a search, which promote nobody."""
ROUNDED_N = 1e-6
"""How far a journal may round a force that is on record, N."""
EDGE_M = 1e-7
"""An outcome that so little turns over another processor may turn over too."""
ENDS: Mapping[Outcome | None, Outcome] = {
    Outcome.SUCCESS: Outcome.SUCCESS, Outcome.ASSISTED: Outcome.SUCCESS,
    Outcome.COLLISION: Outcome.COLLISION, Outcome.FORCE_STOP: Outcome.FORCE_STOP,
}  # fmt: skip
"""What the world has to say of an outcome. The others are ends of which it knows nothing."""
ENDLESS = (Outcome.TIMEOUT, Outcome.INTERVENTION)

Wrong = tuple[str, str, str]
"""What of a rollout, what it says, and what it would have to."""
Begin = Callable[[Mapping[str, str]], World]
"""The world of a rollout at rest where it is planned to begin, by its labels."""


@dataclass(frozen=True)
class Cells:
    """What rollouts are played again in.

    Attributes:
        gate: Whose evidence they are.
        task: The task.
        execution: Limits of the supervisor.
        period_s: Between two ticks, s.
        limit_s: Longest rollout, s.
        begin: Makes their worlds.
    """

    gate: Gate
    task: Task
    execution: ExecutionSettings
    period_s: float
    limit_s: float
    begin: Begin

    @property
    def limit_ticks(self) -> int:
        """Periods after which the time is over."""
        return round(self.limit_s / self.period_s)


def rederive_outcomes(params: Mapping[str, Any], journals: Sequence[Path]) -> None:
    """Play a sample of the rollouts of the comparison again.

    Raises:
        RefusedError: One did not go, feel or end as its journal says, or the journal lacks what
            it takes to ask; or one that is not asked ends when none can.
        ConfigError: A section of `params.yaml` cannot be read.
        IntegrityError: A journal is missing or no regular file.
        BadInputError: A journal cannot be read.
    """
    task = load_task(section(params, "task", TaskSection).name)
    count = section(params, "stress", StressSettings).starts
    starts = matched_starts(task, root_seed=root_seed(params), count=count)
    cells = cells_of("D", task, params, lambda labels: world_at(task, starts, labels))
    play_again(cells, journals, OF_A_JOURNAL)


def cells_of(gate: Gate, task: Task, params: Mapping[str, Any], begin: Begin) -> Cells:
    """What rollouts of a ladder are played again in, as it plans them.

    Raises:
        ConfigError: A section of `params.yaml` cannot be read.
    """
    return Cells(
        gate=gate,
        task=task,
        execution=section(params, "execution", ExecutionSettings),
        period_s=section(params, "horizons", HorizonConfig).action_period_s,
        limit_s=section(params, "stress", StressSettings).episode_limit_s,
        begin=begin,
    )


def world_at(
    task: Task,
    starts: Sequence[Start] | Mapping[int, Start],
    labels: Mapping[str, str],
    probe: str = NOMINAL_PROBE,
) -> World:
    """The world of a rollout at rest at its start, under a probe.

    Raises:
        ValueError, IndexError, KeyError: Its labels name no such start.
    """
    number = int(labels["start"])
    if number < 0:
        raise ValueError(f"start {number}")
    settings = WorldSettings(task.calibration_epochs[-1], probe, seed=number)
    return task.make_world(starts[number], settings=settings)


def play_again(cells: Cells, journals: Sequence[Path], count: int, *, pushed: bool = True) -> None:
    """Hold a sample of each journal against what its commands do, and of all when they end.

    Args:
        cells: What they are played again in.
        journals: All journals of a folder, beside which their table of rollouts lies.
        count: How many of each, and each success in the last moment.
        pushed: Whether anything may push: where it may, the pushes are held against the plan.

    Raises:
        RefusedError: One did not go, feel or end as its journal says.
        IntegrityError: No regular file.
        BadInputError: A journal cannot be read.
    """
    salt = salt_of([*journals, *(path.parent.parent / ROLLOUTS for path in journals)])
    for path in journals:
        with readable(f"{path.parent.name}/{path.name}"):
            rollouts = recorded_rollouts(path)
            for name, one in rollouts.items():
                _ends_in_time(cells, f"{path.name}: {name}", one)
            asked = _asked(rollouts, count, stream(0, "played again", path.name, salt), cells)
        for name in asked:
            place = f"{path.name}: {name}"
            with readable(place):
                if rollouts[name].pushes and not pushed:
                    refuse(cells.gate, f"{place}: pushes", "some", "none, as planned")
                _hold(cells, place, rollouts[name])


def _asked(
    rollouts: Mapping[str, Recorded], count: int, draw: np.random.Generator, cells: Cells
) -> list[str]:
    """Some of a journal, two thirds of them successes where there are so many."""
    ended_well = [name for name, one in rollouts.items() if ENDS.get(_how(one)) is Outcome.SUCCESS]
    others = [name for name in rollouts if name not in ended_well]
    good = _some(ended_well, max(count - len(others), count - count // 3), draw)
    late = {name for name in ended_well if _ticks(rollouts[name], cells) >= cells.limit_ticks}
    chosen = {*good, *_some(others, max(0, count - len(good)), draw), *late}
    return [name for name in rollouts if name in chosen]


def _some(names: Sequence[str], count: int, draw: np.random.Generator) -> list[str]:
    """At most so many of them."""
    chosen = draw.choice(len(names), size=min(count, len(names)), replace=False)
    return [names[i] for i in chosen.tolist()]


def _how(recorded: Recorded) -> Outcome | None:
    return Outcome(recorded.outcome) if recorded.outcome in list(Outcome) else None


def _ticks(recorded: Recorded, cells: Cells) -> int:
    return recorded.ticks(cells.period_s)


def _ends_in_time(cells: Cells, place: str, recorded: Recorded) -> None:
    """One rollout, played again or not: an end that there is, in time; calls have a reason."""
    gate, ticks, how = cells.gate, _ticks(recorded, cells), _how(recorded)
    if how not in (*ENDS, *ENDLESS):
        refuse(gate, f"{place}: outcome", recorded.outcome or "nothing", "an end of a rollout")
    wrong = ticks != cells.limit_ticks if how is Outcome.TIMEOUT else ticks > cells.limit_ticks
    if wrong:
        limit = f"as the plan has it, whose time is over after {cells.limit_s:.3f} s"
        refuse(gate, f"{place}: ends", f"{how} after {ticks * cells.period_s:.3f} s", limit)
    least_n = min(cells.execution.force_limit_n.values()) if how is Outcome.FORCE_STOP else 0.0
    felt = recorded.states.get(to_ns(ticks * cells.period_s), {}).get(FORCE, 0.0)
    if 0.0 <= felt <= least_n - ROUNDED_N:
        limit = f"more than {least_n} N, which every phase bears"
        refuse(gate, f"{place}: outcome", f"{how} at {felt} N", limit)
    if stray := recorded.between_ticks(cells.period_s):
        found = f"something at {stray[0]} ns"
        refuse(gate, f"{place}: commanded", found, "one command at most a tick, at its time")
    if called := next(uncalled_for(recorded, cells.execution), None):
        limit = "a silence, a late answer or a time that is over, as planned"
        refuse(gate, f"{place}: at {called[0] / NS_PER_S:.3f} s", called[1], limit)


def _hold(cells: Cells, place: str, recorded: Recorded) -> None:
    """One rollout: its arm goes as stated, and its world ends it so.

    Where so little decides another processor may decide otherwise, and what comes behind that is
    other, too: then one way that both goes and ends as stated is enough.
    """
    wrong: list[Wrong] = []
    for moved_m in (0.0, EDGE_M, -EDGE_M):
        found = _otherwise(cells, recorded, _played(cells, recorded, moved_m))
        if found is None:
            return
        wrong.append(found)
    what, said, limit = wrong[0]
    refuse(cells.gate, f"{place}: {what}", said, limit)


def _otherwise(cells: Cells, recorded: Recorded, again: Played) -> Wrong | None:
    """What of a rollout is not as its world does it; None where nothing is."""
    how, ticks = _how(recorded), _ticks(recorded, cells)
    wrong = _went(cells, recorded, again)
    if wrong is not None or _agrees(how, ticks, again):
        return wrong
    said = f"{how} after {ticks * cells.period_s:.3f} s"
    return "outcome", said, f"{_said(again, cells)}, to which its recorded commands lead"


def _played(cells: Cells, recorded: Recorded, moved_m: float = 0.0) -> Played:
    return play(
        cells.begin(recorded.labels), recorded, task=cells.task, execution=cells.execution,
        period_s=cells.period_s, moved_m=moved_m,
    )  # fmt: skip


def _went(cells: Cells, recorded: Recorded, again: Played) -> Wrong | None:
    """What is not the state that the commands lead to, closely until something touches."""
    touches = False
    for tick, own in enumerate(again.states):
        when = f"measured at {tick * cells.period_s:.3f} s"
        told = recorded.states.get(to_ns(tick * cells.period_s))
        if told is None:
            return when, "nothing", "a state at every tick"
        touches = touches or own[FORCE] > 0.0
        limit = IN_CONTACT if touches else FREE
        for name in POSE:
            off = _off(told[name], own[name])
            if not off <= limit:
                expected = f"where its recorded commands lead, within {limit:g}"
                return when, f"{name} up to {off:.3g} beside it", expected
        if not _off(told[FORCE], own[FORCE]) <= FORCE_N:
            expected = f"{own[FORCE]} N, which its recorded commands lead to, within {FORCE_N}"
            return when, f"{told[FORCE]} N", expected
    return None


def _off(told: Any, own: Any) -> float:
    one, other = np.asarray(told, dtype=np.float64), np.asarray(own, dtype=np.float64)
    return float(np.max(np.abs(one - other))) if one.shape == other.shape else np.inf


def _agrees(how: Outcome | None, ticks: int, again: Played) -> bool:
    """Whether the world ends it so; its last period is supervised like every other one."""
    if how in ENDLESS:
        return again.ended is None
    return how in ENDS and again.ended == (ticks, ENDS[how])


def _said(again: Played, cells: Cells) -> str:
    if again.ended is None:
        return "nothing of the kind"
    tick, how = again.ended
    return f"{how} after {tick * cells.period_s:.3f} s"
