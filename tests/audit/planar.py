"""A planar task in milliseconds: from a start to a goal, past a post, on the left or the right.

Observation: x, y, goal x, goal y (m), phase flag. Action: commanded x, y. The plant follows the
command with a lag of one step.
"""

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from gates.cause import CauseLimits, cause_of, default_limits
from genpolicy.audit.data import AuditInput, Episodes
from genpolicy.audit.evidence import write_evidence
from genpolicy.audit.run import audit
from genpolicy.audit.settings import AuditSettings
from genpolicy.seeds import stream

SETTINGS = AuditSettings(
    position_channel="tcp", reference_channel=None, replay_episodes=80, permutations=199,
    query_stride=4,
)  # fmt: skip


def limits_with(**changes):
    """The packaged limits of the cause, some of them changed."""
    found = default_limits().by_question
    assert not set(changes) - set(found)
    return CauseLimits({
        question: replace(item, limit=changes.get(question, item.limit))
        for question, item in found.items()
    })  # fmt: skip


LIMITS = limits_with(supported_episodes=15)


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


POST = np.array([0.15, 0.0])


def planar(
    *, episodes=100, modes="free", seed=1, tremor_m=0.001, wrong_labels=0.0, clock_steps=0,
    side_fails=False, epoch_shift_m=0.0, order=None, recoveries=0,
):  # fmt: skip
    rng = stream(seed, "planar")
    rows = {"o": [], "a": [], "phase": [], "episode": [], "index": []}
    n = episodes + recoveries
    operator = rng.integers(0, 3, n).astype(str)
    epoch = np.where(np.arange(n) % 2 == 0, "e0", "e1")
    outcome = np.full(n, "success", dtype=object)
    truth = outcome.copy()
    for number in range(n):
        start = np.array([0.0, 0.0]) + rng.uniform(-0.004, 0.004, 2)
        goal = np.array([0.30, 0.0]) + rng.uniform(-0.004, 0.004, 2)
        side = {
            "free": 1 if rng.random() < 0.5 else -1,
            "operator": 1 if operator[number] == "0" else -1,
            "epoch": 1 if epoch[number] == "e0" else -1,
            "goal": 1 if goal[1] > 0 else -1,
            "none": 1,
        }[modes]
        speed = 0.010 * rng.uniform(0.85, 1.15)
        reference = _route(start, goal, side, speed) + tremor_m * rng.normal(size=(1, 2))
        reference = reference + tremor_m * rng.normal(size=reference.shape)
        state = np.vstack([start[None], reference[:-1]])
        if epoch[number] == "e1" and clock_steps:
            state = np.vstack([np.repeat(state[:1], clock_steps, axis=0), state[:-clock_steps]])
        shown = goal + (epoch_shift_m if epoch[number] == "e1" else 0.0)
        steps = len(reference)
        rows["o"].append(np.hstack([state, np.tile(shown, (steps, 1)), np.ones((steps, 1))]))
        rows["a"].append(reference)
        rows["phase"] += ["approach"] * (steps - 10) + ["release"] * 10
        rows["episode"] += [number] * steps
        rows["index"] += list(range(steps))
        if side_fails and side < 0 and rng.random() < 0.8:
            truth[number] = outcome[number] = "failure"
        if rng.random() < wrong_labels:
            truth[number] = "failure"
    table = Episodes(
        uuid=np.array([f"ep{number:04d}" for number in range(n)]),
        split=np.array((["train"] * 3 + ["validation", "test"]) * (n // 5 + 1))[:n],
        operator=operator, object=np.full(n, "peg"), calibration_epoch=epoch,
        outcome=outcome.astype(str), is_recovery=np.arange(n) >= episodes,
        order=np.arange(n, dtype=float),
    )  # fmt: skip
    data = AuditInput(
        observation=np.vstack(rows["o"]), action=np.vstack(rows["a"]),
        phase=np.array(rows["phase"]),
        episode=np.array(rows["episode"]), index=np.array(rows["index"]),
        event_time_s=0.1 * np.array(rows["index"]), episodes=table,
        observation_scale=np.array([0.01, 0.01, 0.01, 0.01, np.inf]),
        observation_names=("x", "y", "goal.x_m", "goal.y_m", "phase"),
        observation_position=slice(0, 2), action_position=slice(0, 2), period_s=0.1,
        reference=slice(2, 4), context={"goal": slice(2, 4)},
    )  # fmt: skip
    replayed = dict(zip(table.uuid, truth, strict=True))
    return data, replayed


def admissible(actions, observation):
    """A disc of 4 cm around the post."""
    hit = np.min(np.linalg.norm(actions[:, :2] - POST, axis=1)) < 0.04
    return not hit, "collision" if hit else ""


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


def _route(start, goal, side, speed):
    corner = np.array([0.15, 0.09 * side])
    points = np.vstack([start, corner, goal])
    lengths = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    at = np.minimum(speed * np.arange(1, int(lengths[-1] / speed) + 12), lengths[-1])
    return np.stack([np.interp(at, lengths, points[:, axis]) for axis in range(2)], axis=1)
