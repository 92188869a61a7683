"""Sets as published with policies of others: two arms led by hand, blocks to push, a kitchen."""

import numpy as np

from benchmarks.audit_real.motion import plant, rests, way, wobble
from benchmarks.audit_real.plan import Plan
from benchmarks.audit_real.recording import Episode, Recording

SIDES = ("left", "right")
ALOHA = tuple(
    f"{side}_{joint}"
    for side in SIDES
    for joint in (
        "waist", "shoulder", "elbow", "forearm_roll", "wrist_angle", "wrist_rotate", "gripper",
    )
)  # fmt: skip
PUSHED_M = 0.05
# Simulator numbers of the kitchen: nine of the arm, the rest of what it can turn or open.
ARM, THINGS = 9, 21


def aloha(plan: Plan) -> Recording:
    """ALOHA: two arms led by hand, 14 joints at 50 Hz, the leader's joints as actions, one way.

    The object lies elsewhere each time and only the cameras saw it.
    """
    number, rate = plan.episodes or 50, 50.0
    scene = plan.drawn("scene")
    rest = scene.uniform(-0.5, 0.5, 14)
    reach, lift = scene.uniform(-0.8, 0.8, 14), scene.uniform(-0.5, 0.5, 14)
    grip = np.array([6, 13])
    rest[grip], reach[grip], lift[grip] = 0.9, -0.3, -0.5
    to_object = scene.normal(0.0, 0.08, (2, 14))
    to_object[:, grip] = 0.0
    sag = scene.uniform(-0.02, 0.02, 14)
    episodes = []
    for k in range(number):
        rng = plan.drawn("episode", k)
        lies = rng.uniform(-1.0, 1.0, 2)
        begin = rest + rng.normal(0.0, 0.006, 14)
        at = begin + reach + lies @ to_object
        command = np.concatenate([
            way(np.stack([begin, begin + 0.6 * reach, at]), rows=int(110 * rng.uniform(0.85, 1.3)),
                rests=rests(rng, chance=0.25, longest=25)),
            way(np.stack([at, at + lift]), rows=int(90 * rng.uniform(0.85, 1.3))),
        ])  # fmt: skip
        command = command + wobble(rng, len(command), 14, size=0.01, slow=12.0)
        command += plan.tremor * 0.5 * rng.normal(size=command.shape)
        done = plant(command, rate_hz=rate, lag_rows=2.0, constant_rows=2.5) - sag
        done += rng.normal(0.0, 5e-4, done.shape)
        episodes.append(
            Episode(
                seen={"observation.state": done}, action=command, command=command,
                mode=np.zeros(len(command), dtype=np.int64), number=k,
                time_s=np.arange(len(command)) / rate,
            )
        )  # fmt: skip
    return Recording(
        name="aloha_transfer", layout="lerobot3", rate_hz=rate, episodes=tuple(episodes),
        names={"observation.state": ALOHA}, action_names=ALOHA,
        follows=tuple(("observation.state", j) for j in range(14)), form="absolute", scale=0.5,
        truth=plan.facts(
            1, outcomes=False, undecided="50 episodes, and only the cameras saw the object"
        ),
    )  # fmt: skip


def blocks(plan: Plan) -> Recording:
    """Block pushing: a script pushes one of two blocks to one of two targets, its goal recorded.

    Sixteen numbers are observed; the goal, four in all, is a column beside them.
    """
    number, rate = plan.episodes or 120, 10.0
    ways = plan.ways(number, 4)
    targets = np.array([[0.32, 0.18], [0.32, -0.18]])
    homes = np.array([[0.42, -0.05], [0.42, 0.05]]) + np.array([[0.0, -0.06], [0.0, 0.06]])
    episodes = []
    for k, mode in enumerate(ways.tolist()):
        rng = plan.drawn("episode", k)
        block = homes + rng.uniform(-0.015, 0.015, (2, 2))
        target = targets + rng.normal(0.0, 0.003, (2, 2))
        which, aim = mode % 2, mode // 2
        toward = target[aim] - block[which]
        toward = toward / np.linalg.norm(toward)
        behind = block[which] - PUSHED_M * toward
        begin = np.array([0.56, 0.0]) + rng.normal(0.0, 0.004, 2)
        side = np.array([-toward[1], toward[0]])
        side = side * np.sign(side @ (begin - block[which]) or 1.0)
        first = way(
            np.stack([begin, block[which] + 0.07 * side, behind]),
            rows=int(30 * rng.uniform(0.9, 1.15)),
        )
        push = way(
            np.stack([behind, target[aim] - PUSHED_M * toward]),
            rows=int(28 * rng.uniform(0.9, 1.15)),
        )
        command = np.concatenate([first, push])
        command = command + wobble(rng, len(command), 2, size=0.0015, slow=3.0)
        command += plan.tremor * 0.1 * rng.normal(size=command.shape)
        done = plant(command, rate_hz=rate, lag_rows=0.0, constant_rows=0.6)
        gone = np.maximum(0.0, (done - behind) @ toward)
        gone = np.maximum.accumulate(np.where(np.arange(len(done)) >= len(first), gone, 0.0))
        shown = np.repeat(block.reshape(1, 4), len(done), axis=0)
        shown[:, 2 * which : 2 * which + 2] += gone[:, None] * toward
        turn = rng.uniform(-0.1, 0.1, 4)
        before = np.concatenate([command[:1], command[:-1]])
        state = np.column_stack([
            shown[:, :2], np.full(len(done), turn[0]), shown[:, 2:], np.full(len(done), turn[1]),
            done, before, np.repeat(target[:1], len(done), axis=0), np.full(len(done), turn[2]),
            np.repeat(target[1:], len(done), axis=0), np.full(len(done), turn[3]),
        ])  # fmt: skip
        state[:, :6] += rng.normal(0.0, 2e-4, (len(done), 6))
        episodes.append(
            Episode(
                seen={"observation.state": state}, action=command - before, command=command,
                mode=np.full(len(command), mode), number=k,
                rows={"goal_code": np.full(len(command), mode)},
                time_s=np.arange(len(command)) / rate,
            )
        )  # fmt: skip
    names = (
        "block_x", "block_y", "block_turn", "block2_x", "block2_y", "block2_turn", "effector_x",
        "effector_y", "effector_target_x", "effector_target_y", "target_x", "target_y",
        "target_turn", "target2_x", "target2_y", "target2_turn",
    )  # fmt: skip
    return Recording(
        name="block_push", layout="lerobot3", rate_hz=rate, episodes=tuple(episodes),
        names={"observation.state": names}, action_names=("delta_x", "delta_y"),
        follows=(("observation.state", 6), ("observation.state", 7)), form="delta", scale=0.15,
        truth=plan.facts(4, outcomes=False),
    ).true(decided_by="goal_code", names=("goal",))  # fmt: skip


def kitchen(plan: Plan) -> Recording:
    """Kitchen: the whole simulator as observation (positions, speeds, constants), joint speeds.

    A person does two of three things, in any order; nobody wrote down which.
    """
    number, rate = plan.episodes or 90, 12.5
    scene = plan.drawn("scene")
    home = scene.uniform(-0.4, 0.4, ARM)
    reach = home + scene.uniform(0.5, 1.0, (3, ARM)) * scene.choice([-1.0, 1.0], (3, ARM))
    constants = scene.uniform(-0.5, 0.5, THINGS)
    ways = plan.ways(number, 6)
    orders = [(a, b) for a in range(3) for b in range(3) if a != b]
    episodes = []
    for k, mode in enumerate(ways.tolist()):
        rng = plan.drawn("episode", k)
        at, parts, done_at = home + rng.normal(0.0, 0.01, ARM), [], []
        chosen = []
        for thing in orders[mode]:
            end = reach[thing] + rng.normal(0.0, 0.02, ARM)
            back = home + rng.normal(0.0, 0.02, ARM)
            parts.append(way(np.stack([at, end]), rows=int(20 * rng.uniform(0.85, 1.25))))
            done_at.append((thing, sum(map(len, parts))))
            parts.append(way(np.stack([end, back]), rows=int(18 * rng.uniform(0.85, 1.25))))
            chosen.append(np.full(len(parts[-1]) + len(parts[-2]), thing))
            at = back
        command = np.concatenate(parts)
        command = command + wobble(rng, len(command), ARM, size=0.008, slow=4.0)
        command += plan.tremor * 0.8 * rng.normal(size=command.shape)
        done = plant(command, rate_hz=rate, lag_rows=0.3, constant_rows=0.8)
        things = np.repeat(constants[None], len(done), axis=0)
        for thing, row in done_at:
            turned = np.clip((np.arange(len(done)) - row + 4) / 8.0, 0.0, 1.0)
            things[:, 3 * thing] += 0.9 * turned
        place = np.concatenate([done, things], axis=1)
        place[:, :12] += rng.normal(0.0, 5e-4, (len(place), 12))
        speed = rate * np.diff(place, axis=0, prepend=place[:1])[:, :-1]
        before = np.concatenate([command[:1], command[:-1]])
        episodes.append(
            Episode(
                seen={"obs/state": np.concatenate([place, speed], axis=1)},
                action=rate * (command - before), command=command,
                mode=np.concatenate(chosen), number=k,
            )
        )  # fmt: skip
    return Recording(
        name="kitchen_mixed", layout="robomimic", rate_hz=rate, episodes=tuple(episodes),
        names={"obs/state": ()}, action_names=(),
        follows=tuple(("obs/state", j) for j in range(ARM)), form="velocity", scale=1.0,
        truth=plan.facts(
            3, outcomes=False, undecided="59 numbers are observed, two thirds of them without news"
        ),
    )  # fmt: skip
