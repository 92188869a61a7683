"""Arms: teleoperated in differences, by a planner in joints, a humanoid that lags behind."""

import numpy as np

from benchmarks.audit_real.motion import plant, quaternion, rests, way, wobble
from benchmarks.audit_real.plan import Plan
from benchmarks.audit_real.recording import Episode, Recording

NOT_REPEATED = (
    "no start is repeated and 25 numbers are observed: whether any route was shared is for a model "
    "of the whole to say"
)
STEP_M, STEP_RAD = 0.05, 0.5
EEF, QUAT, GRIP, OBJECT = (
    "obs/robot0_eef_pos", "obs/robot0_eef_quat", "obs/robot0_gripper_qpos", "obs/object",
)  # fmt: skip
JOINTS_G1 = tuple(
    f"k{side}{name}"
    for side in ("Left", "Right")
    for name in (
        "ShoulderPitch", "ShoulderRoll", "ShoulderYaw", "Elbow", "WristRoll", "WristPitch",
        "WristYaw",
    )
) + tuple(
    f"k{side}Hand{name}"
    for side in ("Left", "Right")
    for name in ("Pinky", "Ring", "Middle", "Index", "ThumbBend", "ThumbRotation")
)  # fmt: skip


def arm(plan: Plan) -> Recording:
    """robomimic low_dim: a person carries a can, one way; normalised differences at 20 Hz."""
    return _teleoperated(plan, 1, "can_ph")


def arm_two(plan: Plan) -> Recording:
    """The same round a pillar, left or right as the person likes; outcomes in the attributes."""
    return _teleoperated(plan, 2, "can_pillar")


def _teleoperated(plan: Plan, count: int, name: str) -> Recording:
    number, rate = plan.episodes or 160, 20.0
    ways = plan.ways(number, count)
    success = plan.outcomes(ways)
    episodes = []
    for k, mode in enumerate(ways.tolist()):
        rng = plan.drawn("episode", k)
        side = (1 - 2 * mode) if count > 1 else 0.15
        can = np.array([0.12, 0.0, 0.86]) + np.array([0.03, 0.03, 0.0]) * rng.uniform(-1, 1, 3)
        yaw = float(rng.uniform(-0.4, 0.4))
        home = np.array([-0.1, 0.0, 1.02]) + rng.normal(0.0, 0.004, 3)
        if plan.decided_by == "start" and count > 1:
            home[1] += 0.04 * side
        pace = rng.uniform(0.85, 1.3)
        reach = way(
            np.stack([home, [0.0, 0.11 * side + rng.normal(0, 0.008), 1.0],
                      can + np.array([-0.03, 0.02 * side, 0.08]), can]),
            rows=int(40 * pace), rests=rests(rng, chance=0.25, longest=12),
        )  # fmt: skip
        hold = np.repeat(can[None], 5, axis=0)
        carry = way(
            np.stack([can, can + np.array([0.02, 0.0, 0.14]), [0.1, 0.28, 1.0], [0.1, 0.28, 0.92]]),
            rows=int(34 * pace),
        )
        place = np.concatenate([reach, hold, carry])
        place += wobble(rng, len(place), 3, size=0.003, slow=5.0)
        place += plan.tremor * 0.11 * rng.normal(size=place.shape)
        closed = np.arange(len(place)) >= len(reach) + 1
        turn = np.interp(np.arange(len(place)), [0, len(reach) - 3], [0.0, yaw])
        pose = np.concatenate([place, turn[:, None]], axis=1)
        done = plant(pose, rate_hz=rate, lag_rows=0.0, constant_rows=1.2)
        done += rng.normal(0.0, 1e-4, done.shape)
        width = plant(
            np.where(closed, 0.01, 0.04)[:, None], rate_hz=rate, lag_rows=1, constant_rows=2
        )
        at = np.where(closed[:, None], done[:, :3], can)
        turned = np.where(closed, done[:, 3], yaw)
        own, other = quaternion(done[:, 3]), quaternion(turned)
        command = np.concatenate(
            [place, np.zeros((len(place), 2)), turn[:, None],
             np.where(closed, 1.0, -1.0)[:, None]], axis=1
        )  # fmt: skip
        delta = np.zeros((len(place), 7))
        delta[:, :3] = (place - done[:, :3]) / STEP_M
        delta[:, 3:5] = rng.normal(0.0, 0.01, (len(place), 2))
        delta[:, 5] = (turn - done[:, 3]) / STEP_RAD
        delta[:, 6] = command[:, 6]
        episodes.append(
            Episode(
                seen={
                    EEF: done[:, :3], QUAT: own,
                    GRIP: np.concatenate([width, -width], axis=1)
                    + rng.normal(0, 1e-5, (len(at), 2)),
                    OBJECT: np.concatenate(
                        [at, other, at - done[:, :3], quaternion(turned - done[:, 3])], axis=1
                    ),
                },
                action=np.clip(delta, -1.0, 1.0), command=command,
                mode=np.full(len(place), mode), number=k,
                facts={"success": bool(success[k])} if count > 1 else {},
            )
        )  # fmt: skip
    follows = ((EEF, 0), (EEF, 1), (EEF, 2), None, None, None, None)
    return Recording(
        name=name, layout="robomimic", rate_hz=rate, episodes=tuple(episodes),
        names={EEF: (), QUAT: (), GRIP: (), OBJECT: ()}, action_names=(), follows=follows,
        form="normalised", scale=0.22 if count > 1 else 0.05,
        truth=plan.facts(count, outcomes=count > 1, undecided=NOT_REPEATED),
    )  # fmt: skip


def planner(plan: Plan) -> Recording:
    """A motion planner with random restarts: seven joints, three ways, eight starts repeated."""
    number, rate = plan.episodes or 128, 20.0
    ways = plan.ways(number, 3)
    success = plan.outcomes(ways)
    scene = plan.drawn("scene")
    home = scene.uniform(-0.6, 0.6, 7)
    goal = home + scene.choice([-1.0, 1.0], 7) * scene.uniform(0.4, 0.9, 7)
    along = (goal - home) / np.linalg.norm(goal - home)
    basis = np.linalg.qr(np.column_stack([along, scene.normal(size=(7, 2))]))[0][:, 1:]
    angles = np.array([0.3, 0.3 + 2.1, 0.3 + 4.2])
    starts = home + scene.normal(0.0, 0.03, (8, 7))
    names = tuple(f"joint_{j + 1}" for j in range(7))
    episodes = []
    for k, mode in enumerate(ways.tolist()):
        rng = plan.drawn("episode", k)
        out = basis @ np.array([np.cos(angles[mode]), np.sin(angles[mode])])
        begin = starts[k % 8] + rng.normal(0.0, 0.003, 7)
        if plan.decided_by == "start":
            begin = begin + 0.12 * out
        # A restart finds another way through the same passage.
        via = home + 0.45 * (goal - home) + 0.55 * out + rng.normal(0.0, 0.04, 7)
        end = goal + rng.normal(0.0, 0.01, 7)
        command = way(np.stack([begin, via, end]), rows=int(60 * rng.uniform(0.9, 1.2)))
        command = command + plan.tremor * 0.9 * rng.normal(size=command.shape)
        done = plant(command, rate_hz=rate, lag_rows=0.6, constant_rows=1.0)
        done += rng.normal(0.0, 2e-4, done.shape)
        episodes.append(
            Episode(
                seen={"observation.state": done}, action=command, command=command,
                mode=np.full(len(command), mode), number=k,
                facts={"success": bool(success[k])}, time_s=np.arange(len(command)) / rate,
            )
        )  # fmt: skip
    return Recording(
        name="planned_reach", layout="lerobot3", rate_hz=rate, episodes=tuple(episodes),
        names={"observation.state": names}, action_names=names,
        follows=tuple(("observation.state", j) for j in range(7)), form="absolute", scale=0.9,
        truth=plan.facts(3, outcomes=True),
    )  # fmt: skip


def humanoid(plan: Plan) -> Recording:
    """A humanoid like the G1: 26 joints at 30 Hz, eight rows behind, one way, with tremor."""
    number, rate = plan.episodes or 80, 30.0
    scene = plan.drawn("scene")
    rest, reach = scene.uniform(-0.4, 0.4, 26), scene.uniform(-0.7, 0.7, 26)
    lift = scene.uniform(-0.3, 0.3, 26)
    still = np.arange(26) < 7  # one arm hangs
    hands = np.arange(26) >= 14
    rest[hands], reach[hands], lift[hands] = 0.05, scene.uniform(0.5, 0.9, 12), 0.0
    episodes = []
    for k in range(number):
        rng = plan.drawn("episode", k)
        begin = rest + rng.normal(0.0, 0.015, 26)
        target = begin + np.where(still, 0.02, 1.0) * reach + rng.normal(0.0, 0.02, 26)
        up = target + np.where(still, 0.02, 1.0) * lift
        command = np.concatenate([
            way(np.stack([begin, (begin + target) / 2, target]),
                rows=int(62 * rng.uniform(0.85, 1.2)), rests=rests(rng, chance=0.2, longest=15)),
            way(np.stack([target, up]), rows=int(45 * rng.uniform(0.85, 1.2))),
        ])  # fmt: skip
        command = command + wobble(rng, len(command), 26, size=0.008, slow=8.0)
        command += (0.003 + plan.tremor * 0.5) * rng.normal(size=command.shape)
        command[:, hands] = np.clip(command[:, hands], 0.0, 1.0)
        done = plant(command, rate_hz=rate, lag_rows=5.0, constant_rows=3.0)
        done += rng.normal(0.0, 4e-4, done.shape)
        episodes.append(
            Episode(
                seen={"observation.state": done}, action=command, command=command,
                mode=np.zeros(len(command), dtype=np.int64), number=k,
                time_s=np.arange(len(command)) / rate,
            )
        )  # fmt: skip
    return Recording(
        name="humanoid_lift", layout="lerobot2", rate_hz=rate, episodes=tuple(episodes),
        names={"observation.state": JOINTS_G1}, action_names=JOINTS_G1,
        follows=tuple(("observation.state", j) for j in range(26)), form="absolute", scale=0.5,
        truth=plan.facts(
            1, outcomes=False, undecided="26 joints and a start that is never the same"
        ),
    )  # fmt: skip
