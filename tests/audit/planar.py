"""The planar task of the benchmark without chance, and the audit's settings and limits for tests.

Observation: x, y, goal x, goal y (m), a lamp that stays dark. Action: commanded x, y. The plant
follows the command one step later.
"""

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.audit.plan import Defect, Plan
from benchmarks.audit.planar import PERIOD_S
from benchmarks.audit.planar import admissible as admissible_of
from benchmarks.audit.recorder import record
from gates.cause import CauseLimits, cause_of, default_limits
from genpolicy.audit.data import Episodes
from genpolicy.audit.evidence import write_evidence
from genpolicy.audit.run import audit
from genpolicy.audit.settings import AuditSettings

SETTINGS = AuditSettings(
    position_channel="tcp", reference_channel=None, calibration_phase="release",
    replay_episodes=80, permutations=199, query_stride=4,
)  # fmt: skip


def limits_with(**changes):
    """The packaged limits of the cause, some of them changed."""
    found = default_limits().by_question
    assert not set(changes) - set(found)
    return CauseLimits({
        question: replace(item, limit=changes.get(question, item.limit))
        for question, item in found.items()
    }, default_limits().confidence)  # fmt: skip


LIMITS = limits_with(supported_episodes=15)
DECIDED_BY = {"operator": "operator", "epoch": "calibration_epoch", "goal": "goal"}
admissible = admissible_of(Plan(0))


def named(result, settings=SETTINGS, limits=LIMITS):
    """The cause from the evidence as it is written."""
    with tempfile.TemporaryDirectory() as folder:
        write_evidence(result, Path(folder), settings=settings)
        return cause_of(Path(folder), limits)


def audited(settings=SETTINGS, check=None, seed_of_audit=3, **planted):
    """The audit of planted data, checked and replayed."""
    data, replayed = planar(**planted)
    check = check or admissible
    return audit(
        data, settings, admissible=check, replay=replayed.__getitem__, root_seed=seed_of_audit
    )


def planar(
    *, episodes=100, modes="free", seed=1, tremor_m=0.001, wrong_labels=0.0, clock_steps=0,
    side_fails=False, epoch_shift_m=0.0, recoveries=0,
):  # fmt: skip
    """The benchmark's planar task, exact: rows, and the true outcome of each episode."""
    faults = {"robot_clock": clock_steps * PERIOD_S, "camera_shift": epoch_shift_m}
    plan = Plan(
        seed, episodes=episodes + recoveries, recoveries=recoveries, exact=True,
        shares=(1.0,) if modes == "none" else (0.5, 0.5),
        decided_by=DECIDED_BY.get(modes, "chance"),
        goal_half_width_m=0.004, start_wide=0.5, tremor_m=tremor_m, wrong_labels=wrong_labels,
        failing=0.8 * side_fails,
        defects=tuple(Defect(kind, size) for kind, size in faults.items() if size),
    )  # fmt: skip
    labelled = record("planar", plan)
    return labelled.data, labelled.outcomes


def shuffled(data, seed):
    """The same data with episodes renumbered and rows in another order."""
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(data.episodes))
    rank = np.argsort(order)
    rows = rng.permutation(len(data.observation))
    fields = {name: getattr(data.episodes, name)[order] for name in Episodes.__dataclass_fields__}
    arrays = {
        name: getattr(data, name)[rows]
        for name in ("observation", "action", "phase", "index", "event_time_s")
    }
    return replace(data, **arrays, episode=rank[data.episode[rows]], episodes=Episodes(**fields))
