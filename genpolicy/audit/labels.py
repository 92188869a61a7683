"""Outcome labels against replay, and the success of each mode, as counts."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from genpolicy.audit.data import AuditInput, Integers
from genpolicy.audit.progress import Progress, silent
from genpolicy.audit.rows import ModeOutcome
from genpolicy.audit.settings import AuditSettings
from genpolicy.seeds import stream
from genpolicy.statistics.intervals import clopper_pearson

Replay = Callable[[str], str]
SUCCESS = "success"


@dataclass(frozen=True)
class Replayed:
    """One replayed episode: label and what the replay did."""

    episode_uuid: str
    label: str
    replayed: str


def replay_sample(
    data: AuditInput,
    settings: AuditSettings,
    *,
    replay: Replay | None,
    root_seed: int,
    progress: Progress = silent,
) -> tuple[Replayed, ...]:
    """Replay a random sample of the labelled episodes, in order of identifier.

    Args:
        data: Canonical audit input.
        settings: Size of the sample.
        replay: Called with the identifier, answers with the outcome; None: no replay.
        root_seed: Seed of the sample.
        progress: Called after every replay.
    """
    if replay is None:
        return ()
    labelled = np.flatnonzero(data.episodes.outcome != "")
    count = min(settings.replay_episodes, len(labelled))
    chosen = stream(root_seed, "audit", "replay").choice(labelled, count, replace=False)
    replayed = []
    for number in np.sort(chosen):
        uuid = str(data.episodes.uuid[number])
        label = str(data.episodes.outcome[number])
        replayed.append(Replayed(episode_uuid=uuid, label=label, replayed=replay(uuid)))
        progress("episodes replayed", len(replayed), count)
    return tuple(replayed)


def disagreement(replayed: tuple[Replayed, ...]) -> tuple[int, int]:
    """Disagreements and replays."""
    return sum(item.label != item.replayed for item in replayed), len(replayed)


def mode_outcomes(
    data: AuditInput,
    phase: str,
    modes: Integers,
    replayed: tuple[Replayed, ...],
    checks: dict[int, tuple[int, int]],
) -> tuple[ModeOutcome, ...]:
    """Outcome of each mode of one phase, with ends at 95 % for a reader of the table.

    Whoever judges takes the counts and bounds them at a confidence of their own.

    Args:
        data: Canonical audit input.
        phase: Task phase.
        modes: Mode of each episode, -1 for none. Shape (E,).
        replayed: Replays; they overrule labels.
        checks: Admissible and checked modal chunks of each mode.
    """
    outcome = data.episodes.outcome.astype(object)
    for item in replayed:
        outcome[data.episodes.uuid == item.episode_uuid] = item.replayed
    rows = []
    for mode in range(int(modes.max(initial=-1)) + 1):
        member = (modes == mode) & ~data.episodes.is_recovery & (data.episodes.outcome != "")
        n, k = int(member.sum()), int(np.count_nonzero(outcome[member] == SUCCESS))
        lower, upper = clopper_pearson(k, n)
        passed, checked = checks.get(mode, (0, 0))
        rows.append(ModeOutcome(f"m{mode}", phase, n, k, lower, upper, passed, checked))
    return tuple(rows)
