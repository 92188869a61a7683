"""Faults of recordings, planted on the columns of an episode or on the list of episodes.

Kinds and the meaning of their size: `robot_clock`, `camera_clock` (offset, s), `clock_within`
(offset at the end of the episode, s, from 0 at its begin), `clock_session` (offset of the last
episode, s, growing from the first), `camera_shift`, `tool_shift` (m), `position_unit`,
`scene_unit`, `action_unit` (factor), `turn` (rad, observed position about the vertical), `mirror`,
`swap` (size unused), `drop` (share of rows that are missing), `freeze` and `freeze_camera` (the
stream of the robot or of the camera repeats itself so many seconds while the arm moves and its
stamps go on), `drop_camera` (share of frames that are lost; rows hold the last one, with its
stamps), `latch` (the camera looks once, at the begin of the episode; size unused), `repeat` (share
of episodes that are stored twice), `glue` (share of episodes that hold the next one as well).
"""

import numpy as np

from benchmarks.audit.plan import Array, Defect, Plan, Roster
from genpolicy.seeds import stream

CLOCKS = {
    "robot_clock": "robot", "camera_clock": "camera", "clock_within": "robot",
    "clock_session": "robot",
}  # fmt: skip
# A second copy is rarely the same bytes: another export rounds, or begins a few rows later.
COPY_NOISE_M = 2e-5
COPY_LATE_ROWS = 3
# Columns that a stream delivers.
FROZEN = {"freeze": ("position", "tool"), "freeze_camera": ("scene", "lamp")}
CAMERA = ("scene", "lamp", "stamp_camera", "delay_camera")
# The arm moves in a row whose command is this share of its usual step away from the one before.
MOVING_STEP = 0.2


class Faults:
    """Which episodes of a data set each of the plan's faults spoils."""

    def __init__(self, plan: Plan, roster: Roster, period_s: float) -> None:
        n = len(roster.mode)
        self.period_s = period_s
        self.n = n
        rng = stream(plan.seed, "faults")
        sign = rng.choice([-1.0, 1.0], size=len(plan.defects))
        self.sign = np.abs(sign) if plan.exact else sign
        self.angle = rng.uniform(0.0, 2.0 * np.pi, size=len(plan.defects))
        self.hit: list[tuple[int, Defect, np.ndarray]] = []
        for number, defect in enumerate(plan.defects):
            hit = {
                "epoch": roster.epoch == roster.epoch.max(),
                "some": rng.random(n) < defect.share,
                "mode": (roster.mode == roster.mode.max()) & (rng.random(n) < defect.share),
                "all": np.ones(n, dtype=bool),
            }[defect.scope]
            self.hit.append((number, defect, hit))

    def clock(self, name: str, episode: int, rows: int) -> Array:
        """By how much the stream's stamps run ahead in each row of an episode, s."""
        result = np.zeros(rows)
        for number, defect, hit in self.hit:
            if CLOCKS.get(defect.kind) != name:
                continue
            size = self.sign[number] * defect.size
            if defect.kind == "clock_session":
                result += size * episode / (self.n - 1)
            elif hit[episode]:
                result += size * (np.linspace(0, 1, rows) if defect.kind == "clock_within" else 1)
        return result

    def of(self, episode: int) -> list[tuple[Defect, float, float]]:
        """Faults of one episode with their sign and direction."""
        return [(d, self.sign[k], self.angle[k]) for k, d, hit in self.hit if hit[episode]]


def spoil_rows(
    plan: Plan, columns: dict[str, Array], faults: Faults, episode: int
) -> dict[str, Array]:
    """The columns of an episode with its faults of frame, unit and calibration."""
    result = dict(columns)
    for defect, sign, angle in faults.of(episode):
        away = defect.size * np.array([np.cos(angle), np.sin(angle)])
        position = result["position"]
        if defect.kind == "camera_shift":
            result["scene"] = result["scene"].copy()
            result["scene"][:, :2] += away
        elif defect.kind == "tool_shift":
            result["position"] = position + np.pad(away, (0, position.shape[1] - 2))
        elif defect.kind == "position_unit":
            result["position"] = position * defect.size
        elif defect.kind == "action_unit":
            result["command"] = result["command"] * defect.size
        elif defect.kind == "scene_unit":
            result["scene"] = result["scene"].copy()
            result["scene"][:, :2] *= defect.size
        elif defect.kind == "drop":
            keep = stream(plan.seed, "drop", episode).random(len(position)) >= defect.size
            result = {name: values[keep] for name, values in result.items()}
        elif defect.kind in FROZEN:
            rows = round(defect.size / faults.period_s)
            held = _stretch(columns["command"], rows, stream(plan.seed, "freeze", episode))
            result |= _held(result, FROZEN[defect.kind], held)
        elif defect.kind == "drop_camera":
            lost = stream(plan.seed, "drop", episode).random(len(position)) < defect.size
            result |= _held(result, CAMERA, lost)
        elif defect.kind == "latch":
            result |= _held(result, FROZEN["freeze_camera"], np.ones(len(position), dtype=bool))
        elif defect.kind in ("turn", "mirror", "swap"):
            result["position"] = position.copy()
            result["position"][:, :2] = position[:, :2] @ _matrix(defect, sign).T
    return result


def _stretch(command: Array, rows: int, rng: np.random.Generator) -> np.ndarray:
    """So many rows in which the arm moves, one after the other. Shape (T,)."""
    steps = np.linalg.norm(np.diff(command, axis=0, prepend=command[:1]), axis=1)
    moving = np.flatnonzero(steps > MOVING_STEP * np.median(steps[steps > 0]))
    first = int(rng.integers(max(1, len(moving) - rows)))
    chosen = np.zeros(len(command), dtype=bool)
    chosen[moving[first] : moving[min(first + rows, len(moving)) - 1] + 1] = True
    return chosen


def _held(columns: dict[str, Array], names: tuple[str, ...], held: np.ndarray) -> dict[str, Array]:
    """The columns with what was read before the held rows; the first row is always read."""
    fresh = np.where(held, 0, np.arange(len(held)))
    newest = np.maximum.accumulate(fresh)
    return {name: columns[name][newest] for name in names if name in columns}


def repeat(plan: Plan, episodes, table, truth):
    """Some episodes are stored a second time, under another identifier, later in the list."""
    for defect in plan.defects:
        if defect.kind != "repeat":
            continue
        rng = stream(plan.seed, "repeat")
        n = len(episodes)
        chosen = rng.choice(n, size=round(defect.size * n), replace=False)
        kind = int(rng.integers(3))  # the same bytes, rounded elsewhere, begun later
        for number in chosen:
            late = int(rng.integers(1, COPY_LATE_ROWS + 1)) if kind == 2 else 0
            copy = {name: values[late:] for name, values in episodes[number].items()}
            if kind == 1:
                noise = COPY_NOISE_M * rng.normal(size=copy["position"].shape)
                copy["position"] = copy["position"] + noise
            episodes = [*episodes, copy]
        table = {name: np.concatenate([values, values[chosen]]) for name, values in table.items()}
        table["uuid"] = np.array([f"ep{number:05d}" for number in range(len(episodes))])
        table["order"] = np.arange(len(episodes), dtype=np.float64)
        # The split is drawn by identifier: the copy falls where it falls.
        table["split"][n:] = rng.choice(table["split"][:n], size=len(chosen))
        truth = np.concatenate([truth, truth[chosen]])
    return episodes, table, truth


def glue(plan: Plan, episodes, table, truth):
    """Some episodes hold themselves or the next episode as well, as if a stop had been missed."""
    for defect in plan.defects:
        if defect.kind != "glue":
            continue
        rng = stream(plan.seed, "glue")
        itself = defect.scope == "all"
        chosen = np.flatnonzero(rng.random(len(episodes)) < defect.size)
        glued, original = list(episodes), list(episodes)
        for number in chosen:
            first = original[number]
            second = original[number if itself else (number + 1) % len(original)]
            joined = {name: np.concatenate([first[name], second[name]]) for name in first}
            step = first["time"][1] - first["time"][0]
            moved = first["time"][0] + step * np.arange(len(joined["time"])) - joined["time"]
            stamps = ("time", *(name for name in joined if name.startswith("stamp_")))
            glued[number] = joined | {name: joined[name] + moved for name in stamps}
        episodes = glued
    return episodes, table, truth


def _matrix(defect: Defect, sign: float) -> Array:
    if defect.kind == "mirror":
        return np.array([[1.0, 0.0], [0.0, -1.0]])
    if defect.kind == "swap":
        return np.array([[0.0, 1.0], [1.0, 0.0]])
    c, s = np.cos(sign * defect.size), np.sin(sign * defect.size)
    return np.array([[c, -s], [s, c]])
