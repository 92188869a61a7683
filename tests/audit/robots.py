"""Robots as people bring them, and what goes wrong in their recordings.

Five bases: a planar pusher in pixels, an arm of seven joints, a humanoid of 26 joints whose state
trails by eight rows of 1/30 s and of which most joints hardly move, two arms of which one may
rest, and a tool pose with a quaternion. A fault maps a recording to a recording.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from arms import build, parts, rebuilt
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from genpolicy.audit.data import AuditInput
from genpolicy.seeds import stream

EPISODES = 60


@dataclass(frozen=True)
class Robot:
    """How one kind of robot moves.

    Attributes:
        rate_hz: Rows a second.
        rows: Shortest and longest episode.
        reach: How far each column moves in an episode, its unit. Length P.
        place: Where each column is about. Length P.
        lag_rows: How far the response trails, mean and spread over the episodes.
        noise: Noise of the observation, as a share of the largest reach.
        scale: Difference of each column that makes another observation.
    """

    rate_hz: float
    rows: tuple[int, int]
    reach: np.ndarray
    place: np.ndarray
    lag_rows: tuple[float, float]
    noise: float
    scale: float


def _still(width: int, moving: slice, reach: float, rest: float) -> np.ndarray:
    result = np.full(width, rest)
    result[moving] = reach
    return result


ROBOTS = {
    "planar": Robot(
        10.0, (50, 120), np.full(2, 80.0), np.full(2, 256.0), (2.3, 0.05), 2e-3, 10.0
    ),
    "arm": Robot(
        20.0, (60, 120), np.linspace(0.6, 0.15, 7), np.linspace(-0.5, 1.5, 7), (3.0, 0.1), 1e-3,
        0.05,
    ),
    "humanoid": Robot(
        30.0, (150, 260), _still(26, slice(7, 26), 0.15, 0.004), np.linspace(-1.2, 1.2, 26),
        (8.0, 0.5), 3e-3, 0.05,
    ),
    "two_arms": Robot(
        50.0, (120, 200), np.tile(np.linspace(0.5, 0.2, 7), 2), np.linspace(-1.0, 1.0, 14),
        (4.0, 0.3), 1e-3, 0.05,
    ),
    "tool": Robot(
        20.0, (60, 110), np.full(3, 0.12), np.array([0.5, 0.0, 0.2]), (2.0, 0.1), 1e-3, 0.01
    ),
}  # fmt: skip


def robot(name: str, seed: int, *, episodes: int = EPISODES) -> AuditInput:
    """Recordings of one robot, as they should be."""
    kind, rng = ROBOTS[name], stream(seed, "robot", name)
    width = len(kind.reach)
    commands, seen = [], []
    gains = rng.uniform(0.93, 1.0, width)
    for _ in range(episodes):
        n = int(rng.integers(*kind.rows))
        path = _path(n, width, rng, kind)
        if name == "two_arms" and rng.random() < 0.3:
            path[:, 7:] = path[:1, 7:]  # one arm rests
        lag = max(0.5, rng.normal(*kind.lag_rows))
        answer = _trailing(path, lag) * gains + (1 - gains) * path[:1]
        if name == "humanoid":  # fingers are stopped by what they grasp
            stop = answer[:1] + rng.uniform(0.5, 1.5, width) * kind.reach
            answer[:, 14:] = np.minimum(answer, stop)[:, 14:]
        noise = kind.noise * kind.reach.max()
        commands.append(path + 0.1 * noise * rng.normal(size=path.shape))
        seen.append(answer + noise * rng.normal(size=path.shape))
    if name == "tool":
        commands, seen = _with_rotation(commands, seen, kind, rng)
    data = build(commands, seen, epochs=1, period_s=1.0 / kind.rate_hz)
    data = replace(data, observation_scale=np.full(data.observation.shape[1], kind.scale))
    return with_scene(data, seed) if name == "planar" else data


def _path(n: int, width: int, rng: np.random.Generator, kind: Robot) -> np.ndarray:
    """A smooth way through random places, with rests at both ends. Shape (n, P)."""
    knots = int(rng.integers(4, 7))
    places = kind.reach * rng.normal(size=(knots, width))
    at = np.clip(np.linspace(-0.3, knots - 1 + 0.3, n), 0, knots - 1)
    part = np.minimum(at.astype(int), knots - 2)
    s = (at - part)[:, None]
    smooth = 10 * s**3 - 15 * s**4 + 6 * s**5
    path = places[part] + smooth * (places[part + 1] - places[part])
    return kind.place + gaussian_filter1d(path, 1.5, axis=0, mode="nearest")


def _trailing(path: np.ndarray, rows: float) -> np.ndarray:
    """The path later by so many rows, half of them by inertia."""
    at = np.clip(np.arange(len(path)) - 0.5 * rows, 0, len(path) - 1)
    late = np.stack([np.interp(at, np.arange(len(path)), c) for c in path.T], axis=1)
    share = 1.0 / (1.0 + 0.5 * rows)
    for row in range(1, len(late)):
        late[row] = late[row - 1] + share * (late[row] - late[row - 1])
    return late


def _with_rotation(commands, seen, kind: Robot, rng: np.random.Generator):
    """A quaternion beside the position; the tool points down, so that its signs are free."""
    for k, (command, answer) in enumerate(zip(commands, seen, strict=True)):
        n = len(command)
        turn = gaussian_filter1d(0.08 * rng.normal(size=(n, 3)).cumsum(axis=0), 5, axis=0)
        asked = Rotation.from_euler("x", np.pi) * Rotation.from_rotvec(0.3 * np.tanh(turn))
        late = Rotation.from_euler("x", np.pi) * Rotation.from_rotvec(
            0.3 * np.tanh(_trailing(turn, 2.0)) + 1e-3 * rng.normal(size=(n, 3))
        )
        commands[k] = np.hstack([command, _signs(asked.as_quat(), rng)])
        seen[k] = np.hstack([answer, _signs(late.as_quat(), rng)])
    return commands, seen


def _signs(quaternion: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Each of the two signs that mean the same, as drivers give them: they change on the way."""
    changes = rng.random(len(quaternion)) < 0.02
    return quaternion * np.where(np.cumsum(changes) % 2, -1.0, 1.0)[:, None] * rng.choice([-1, 1])


def with_scene(data: AuditInput, seed: int) -> AuditInput:
    """An object beside: its place and the cosine and sine of its angle."""
    rng = stream(seed, "scene")
    count, last = len(data.episodes), data.observation.shape[1]
    place = 256.0 + 70.0 * rng.normal(size=(count, 2))
    angle = rng.uniform(0.0, 2.0 * np.pi, count)
    scene = np.column_stack([place, np.cos(angle), np.sin(angle)])[data.episode]
    observation = np.hstack([data.observation, scene])
    return replace(
        data, observation=observation,
        observation_names=(*data.observation_names, "bx", "by", "c", "s"),
        observation_scale=np.append(data.observation_scale, [10.0, 10.0, 0.1, 0.1]),
        context={"block": slice(last, last + 2), "angle": slice(last + 2, last + 4)},
        streams={"robot": slice(0, last), "camera": slice(last, last + 4)},
    )  # fmt: skip


def chosen(data: AuditInput, share: float, seed: int = 0) -> np.ndarray:
    """A share of the episodes, exactly. Shape (E,)."""
    order = stream(seed, "chosen").permutation(len(data.episodes))
    return order < round(share * len(order))


def scaled(data: AuditInput, factor: float, where: str, hit: np.ndarray) -> AuditInput:
    """Some episodes in another unit: the action, the observation, or both."""
    factors = np.where(hit, factor, 1.0)[data.episode][:, None]
    action, observation = data.action, data.observation.copy()
    if where in ("action", "both"):
        action = action.copy()
        action[:, :] *= np.where(_free(action), factors, 1.0)
    if where in ("observation", "both"):
        observation *= np.where(_free(observation), factors, 1.0)
    return replace(data, action=action, observation=observation)


def _free(values: np.ndarray) -> np.ndarray:
    """Columns that have a unit: no quaternion and no cosine. Shape (1, D)."""
    free = np.ones((1, values.shape[1]), dtype=bool)
    free[0, 3:7] = values.shape[1] != 7 or np.abs(values[:, 3:7]).max() > 1.01
    if values.shape[1] == 6:
        free[0, 4:] = False
    return free


def lagged(data: AuditInput, rows: int, hit: np.ndarray) -> AuditInput:
    """The actions of some episodes are filed so many rows early."""
    commands, _ = parts(data)
    for k in np.flatnonzero(hit):
        later = np.clip(np.arange(len(commands[k])) + rows, 0, len(commands[k]) - 1)
        commands[k] = commands[k][later]
    return replace(data, action=np.vstack(commands))


def flipped(data: AuditInput, column: int, hit: np.ndarray) -> AuditInput:
    """One column of the action has the other sign in some episodes."""
    action = data.action.copy()
    action[:, column] *= np.where(hit, -1.0, 1.0)[data.episode]
    return replace(data, action=action)


def swapped(data: AuditInput, columns: tuple[int, int], hit: np.ndarray) -> AuditInput:
    """Two columns of the action are exchanged in some episodes."""
    action, rows = data.action.copy(), hit[data.episode]
    a, b = columns
    action[rows, a], action[rows, b] = data.action[rows, b], data.action[rows, a]
    return replace(data, action=action)


def trembling(
    data: AuditInput, column: int, size: float, hit: np.ndarray, *, where: str, lag_rows: int = 2
) -> AuditInput:
    """A tremor of 5 to 8 Hz (less than the rows can show at 10 Hz) on one column."""
    rng, period = stream(5, "tremor"), data.period_s
    n = len(data.action)
    hertz = np.minimum(rng.uniform(5.0, 8.0, len(data.episodes)), 0.45 / period)[data.episode]
    wave = size * np.sin(2.0 * np.pi * hertz * data.index * period + rng.uniform(0, 6))
    wave = wave * hit[data.episode]
    action, observation = data.action.copy(), data.observation.copy()
    if where in ("action", "both"):
        action[:, column] += wave
    if where in ("observation", "both"):
        observation[:, column] += (0.5 if where == "both" else 1.0) * np.roll(wave, lag_rows)
    assert len(action) == n
    return replace(data, action=action, observation=observation)


def constant(data: AuditInput, column: int, jitter: float) -> AuditInput:
    """A column is commanded to one value, up to round-off; what is seen sags with the rest."""
    rng = stream(6, "constant")
    action, observation = data.action.copy(), data.observation.copy()
    other = observation[:, (column + 1) % data.action.shape[1]]
    spread = float(np.std(other))
    action[:, column] = action[0, column] + jitter * rng.normal(size=len(action))
    action[:, column] += 0.3 * jitter * (other - other.mean()) / spread
    sag = 0.02 * (other - other.mean()) + 0.003 * spread * rng.normal(size=len(other))
    observation[:, column] = action[0, column] + sag
    return replace(data, action=action, observation=observation)


def by_episode(data: AuditInput, change: Callable[[np.ndarray, np.ndarray, int], tuple]):
    """Rebuilt from `change(command, seen, number)` of each episode, which may return rows twice."""
    commands, seen = parts(data)
    found = [change(c, s, k) for k, (c, s) in enumerate(zip(commands, seen, strict=True))]
    scene = data.observation.shape[1] - data.action.shape[1]
    result = rebuilt(data, [c for c, _ in found], [s for _, s in found])
    if scene:
        return replace(
            result, observation_names=data.observation_names, context=data.context,
            observation_scale=data.observation_scale, streams=data.streams,
            observation_position=data.observation_position, action_position=data.action_position,
        )  # fmt: skip
    return replace(result, observation_scale=data.observation_scale)


def waiting(
    data: AuditInput, rows: tuple[int, int] = (15, 60), *, same: bool = True, lag_rows: float = 2.0
) -> AuditInput:
    """Every episode waits at first, its rows equal; at one place in all of them if `same`."""
    rng = stream(7, "waiting")
    home_c, home_s = data.action[0].copy(), data.observation[0].copy()

    def change(command, seen, k):
        n = int(rng.integers(*rows))
        if same:  # begin there: a smooth way from home into the episode
            ramp = np.minimum(np.arange(len(command)) / 15.0, 1.0)[:, None]
            answer = _trailing(ramp, lag_rows)
            free_c, free_s = _free(data.action), _free(data.observation)
            command = command + (1.0 - ramp) * (home_c - command[0]) * free_c
            seen = seen + (1.0 - answer) * (home_s - seen[0]) * free_s
        wait_c, wait_s = np.repeat(command[:1], n, axis=0), np.repeat(seen[:1], n, axis=0)
        return np.vstack([wait_c, command]), np.vstack([wait_s, seen])

    return by_episode(data, change)


def idle(command: np.ndarray) -> np.ndarray:
    """Rows in which next to nothing is commanded. Shape (n,)."""
    steps = np.linalg.norm(np.diff(command, axis=0, prepend=command[:1]), axis=1)
    return steps < 0.1 * np.quantile(steps, 0.9)


def glued_to_itself(data: AuditInput, hit: np.ndarray, *, copies: int = 1, noise: float = 0.0):
    """Some episodes are followed by copies of their rows that move."""
    rng = stream(8, "glued")

    def change(command, seen, k):
        if not hit[k]:
            return command, seen
        moving = ~idle(command)
        spread = noise * np.std(seen, axis=0)
        again = [seen[moving] + spread * rng.normal(size=seen[moving].shape) for _ in range(copies)]
        return np.vstack([command, *[command[moving]] * copies]), np.vstack([seen, *again])

    return by_episode(data, change)
