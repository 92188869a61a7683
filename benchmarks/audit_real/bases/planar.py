"""Points in a plane: posts to go round, goals to go to, a block to push.

Not the planar task of `benchmarks.audit`, with which they share the plant alone: there one task
with goal, lamp, operators and epochs is varied by the cause that is planted, while each of these
imitates one published layout, with its own ways, starts, units (pixels too) and form of the action.
"""

import numpy as np

from benchmarks.audit_real.motion import plant, rests, way, wobble
from benchmarks.audit_real.plan import Plan
from benchmarks.audit_real.recording import Episode, Recording

POSTS = ((0.5, 0.08), (0.45, 0.2), (0.55, 0.2))
CORNERS = np.array([[0.2, 0.2], [0.8, 0.2], [0.8, 0.8], [0.2, 0.8]])


def avoiding(plan: Plan) -> Recording:
    """D3IL avoiding: one start, posts to go round on either side, 96 people's ways, velocities.

    Four ways: left or right of the first post, then outside or between of the two behind it.
    """
    count, rate = plan.episodes or 96, 30.0
    ways = plan.ways(count, 4)
    success = plan.outcomes(ways)
    side = {0: (-1, -1), 1: (1, 1), 2: (-1, 1), 3: (1, -1)}
    episodes = []
    for k, mode in enumerate(ways.tolist()):
        rng = plan.drawn("episode", k)
        first, second = side[mode]
        lean = 0.02 * (2 * (mode % 2) - 1) if plan.decided_by == "start" else 0.0
        points = np.array([
            [0.5 + lean, -0.1], [0.5 + lean, -0.06], [0.5 + 0.07 * first, 0.08],
            [0.5 + 0.05 * first + 0.06 * second, 0.2], [0.5 + 0.08 * second, 0.36],
        ])  # fmt: skip
        points[2:] += rng.normal(0.0, 0.006, points[2:].shape)
        rows = int(75 * rng.uniform(0.85, 1.3))
        command = way(points, rows=rows, rests=rests(rng, chance=0.15, longest=10))
        command = command + wobble(rng, len(command), 2, size=0.002, slow=6.0)
        command += plan.tremor * 0.07 * rng.normal(size=command.shape)
        done = plant(command, rate_hz=rate, lag_rows=0.5, constant_rows=1.0)
        done += rng.normal(0.0, 0.0003, done.shape)
        before = np.concatenate([command[:1], command[:-1]])
        episodes.append(
            Episode(
                seen={"obs": np.concatenate([before, done], axis=1)},
                action=rate * (command - before), command=command,
                mode=np.full(len(command), mode), number=k,
                facts={"success": bool(success[k])}, time_s=np.arange(len(command)) / rate,
            )
        )  # fmt: skip
    return Recording(
        name="avoiding", layout="parquet", rate_hz=rate, episodes=tuple(episodes),
        names={"obs": ("des_x", "des_y", "x", "y")}, action_names=("vx", "vy"),
        follows=(("obs", 2), ("obs", 3)), form="velocity", scale=0.1,
        truth=plan.facts(4, outcomes=True),
    )  # fmt: skip


def goals(plan: Plan) -> Recording:
    """A point mass among four goals, three of them in turn, the next not to be seen; displacements.

    The goal of each row is written; two numbers are observed.
    """
    count, rate = plan.episodes or 100, 10.0
    rng = plan.drawn("order")
    episodes = []
    for k in range(count):
        rng = plan.drawn("episode", k)
        order = [int(rng.integers(4))]
        while len(order) < 3:
            order.append(int(rng.choice([g for g in range(4) if g != order[-1]])))
        at = np.array([0.5, 0.5]) + rng.normal(0.0, 0.01, 2)
        parts, told = [], []
        for goal in order:
            end = CORNERS[goal] + rng.normal(0.0, 0.01, 2)
            middle = (at + end) / 2.0 + rng.normal(0.0, 0.015, 2)
            rows = max(10, int(26 * np.linalg.norm(end - at) / 0.6 * rng.uniform(0.85, 1.2)))
            parts.append(way(np.stack([at, middle, end]), rows=rows))
            told.append(np.full(rows, goal))
            at = end
        command, goal_of = np.concatenate(parts), np.concatenate(told)
        command += plan.tremor * 0.3 * rng.normal(size=command.shape)
        done = np.concatenate([command[:1], command[:-1]])
        done = done + rng.normal(0.0, 0.001, done.shape)
        episodes.append(
            Episode(
                seen={"observation.state": done}, action=command - done, command=command,
                mode=goal_of, number=k, rows={"goal": goal_of},
                time_s=np.arange(len(command)) / rate,
            )
        )  # fmt: skip
    return Recording(
        name="multi_goal", layout="lerobot2", rate_hz=rate, episodes=tuple(episodes),
        names={"observation.state": ("x", "y")}, action_names=("dx", "dy"),
        follows=(("observation.state", 0), ("observation.state", 1)), form="delta", scale=0.6,
        truth=plan.facts(4, outcomes=False),
    ).true(decided_by="goal", names=("goal",))  # fmt: skip


def pushing(plan: Plan) -> Recording:
    """A block pushed in pixels as in PushT, from six repeated starts, round either side."""
    count, rate = plan.episodes or 120, 10.0
    ways = plan.ways(count, 2)
    success = plan.outcomes(ways)
    starts = plan.drawn("starts")
    heading = starts.uniform(0.0, 2.0 * np.pi, 6)
    centre = 256.0 + starts.uniform(-30.0, 30.0, (6, 2))
    episodes = []
    for k, mode in enumerate(ways.tolist()):
        rng = plan.drawn("episode", k)
        start = int(rng.integers(6))
        ahead = np.array([np.cos(heading[start]), np.sin(heading[start])])
        aside = np.array([-ahead[1], ahead[0]]) * (1 - 2 * mode)
        block = centre[start] + rng.normal(0.0, 2.0, 2)
        begin = block + 110.0 * ahead + rng.normal(0.0, 3.0, 2)
        if plan.decided_by == "start":
            begin = begin + 35.0 * aside
        contact = block - 45.0 * ahead + rng.normal(0.0, 2.0, 2)
        far = 1.0 + rng.normal(0.0, 0.06)
        first = way(
            np.stack([begin, block + 70.0 * ahead * 0.4 + 85.0 * far * aside,
                      block - 40.0 * ahead + 70.0 * far * aside, contact]),
            rows=int(42 * rng.uniform(0.85, 1.25)), rests=rests(rng, chance=0.2, longest=8),
        )  # fmt: skip
        push = way(
            np.stack([contact, contact + 75.0 * ahead]), rows=int(22 * rng.uniform(0.9, 1.2))
        )
        command = np.concatenate([first, push])
        command = command + wobble(rng, len(command), 2, size=2.0, slow=4.0)
        command += plan.tremor * 100.0 * rng.normal(size=command.shape)
        done = plant(command, rate_hz=rate, lag_rows=1.0, constant_rows=1.4)
        beyond = np.maximum(0.0, (done - contact) @ ahead)
        pushed = np.where(np.arange(len(done)) >= len(first) - 3, beyond, 0.0)
        at = block + np.maximum.accumulate(pushed)[:, None] * ahead
        angle = heading[start] + 0.004 * np.maximum.accumulate(pushed)
        shown = np.stack([at[:, 0], at[:, 1], np.cos(angle), np.sin(angle)], axis=1)
        episodes.append(
            Episode(
                seen={"observation.state": done, "observation.environment_state": shown},
                action=command, command=command, mode=np.full(len(command), mode), number=k,
                facts={"success": bool(success[k])}, time_s=np.arange(len(command)) / rate,
            )
        )  # fmt: skip
    return Recording(
        name="pushing", layout="lerobot2", rate_hz=rate, episodes=tuple(episodes),
        names={
            "observation.state": ("agent_x_px", "agent_y_px"),
            "observation.environment_state": ("block_x_px", "block_y_px", "block_cos", "block_sin"),
        },
        action_names=("agent_x_px", "agent_y_px"),
        follows=(("observation.state", 0), ("observation.state", 1)), form="absolute",
        scale=170.0, truth=plan.facts(2, outcomes=True),
    )  # fmt: skip
