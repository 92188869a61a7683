"""The cell: kinematic, exact tracking, no contact physics; a collision is one of geometry."""

import hashlib
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from genpolicy.contract.action import join_action, split_action
from genpolicy.contract.observation import Channel, ObservationContract
from genpolicy.contract.rotation import rotation_to_6d
from genpolicy.errors import ContractError
from genpolicy.integrity.documents import canonical_json, parse_json
from genpolicy.robot.collision import CollisionModel
from genpolicy.robot.kinematics import ArmKinematics
from genpolicy.robot.scene_state import SceneState

SCENE_PATH = Path(__file__).with_name("arm.xml")
PERIOD_S = 0.05
PHASES = ("cruise", "settle", "leave")
PAD_X_M, PAD_TOP_M = 0.56, 0.02
PILLAR_X_M, PILLAR_Z_M = 0.44, 0.06
HOVER_M, TOUCH_M, CLEAR_M = 0.12, 0.03, 0.10
NEAR_M, DWELL_PERIODS = 0.006, 3
DOWN = np.diag([-1.0, 1.0, -1.0])
POSTURE_RAD = np.array([0.0, 0.25, 1.75, 0.0, 1.14, 0.0])
OBSERVATION = ObservationContract(
    channels=(
        Channel("probe_at_m", ("x", "y", "z"), "m", "robot", 0.15),
        Channel("probe_axes", tuple(f"axis_{i}" for i in range(6)), "1", "robot", 0.15),
        Channel("pad_at_m", ("x", "y"), "m", "lidar", 0.30),
        Channel("pillar_at_m", ("y",), "m", "lidar", 0.30),
        Channel("flags", PHASES, "1", "phase", 0.15),
    )
)


@dataclass(frozen=True)
class RingStart:
    """Where the probe, the pad and the pillar stand, m."""

    probe_y_m: float
    pad_x_m: float
    pad_y_m: float
    pillar_y_m: float

    def to_json(self):
        return canonical_json(asdict(self)).decode()

    @property
    def probe_m(self):
        return np.array([0.34, self.probe_y_m, HOVER_M])

    @property
    def pad_m(self):
        return np.array([self.pad_x_m, self.pad_y_m])


def sample_start(rng):
    u = rng.uniform(-1.0, 1.0, 4)
    return RingStart(0.01 * u[0], PAD_X_M + 0.01 * u[1], 0.02 * u[2], 0.005 * u[3])


def start_from_json(text):
    values = parse_json(text.encode(), where="scene_start")
    if not isinstance(values, dict) or set(values) != set(RingStart.__dataclass_fields__):
        raise ContractError(
            where="scene_start", found=text[:60], expected="a start", action="Record it again."
        )
    return RingStart(**values)


def scene_poses(pad_m, pillar_y_m):
    upright = np.array([1.0, 0.0, 0.0, 0.0])
    return {
        "pillar": (np.array([PILLAR_X_M, pillar_y_m, PILLAR_Z_M]), upright),
        "pad": (np.array([*pad_m, 0.0]), upright),
    }


_ARM = ArmKinematics(SCENE_PATH)
_SHAPES = CollisionModel(SCENE_PATH, _ARM)


class RingWorld:
    """One cell, at rest at its start; see `genpolicy.tasks.api.World`."""

    def __init__(self, start, epoch):
        self.start, self.calibration_epoch = start, epoch
        self.phase = PHASES[0]
        self.collision, self._collided, self._dwelt = False, False, 0
        self.contact_force_n = 0.0
        self._pushed = np.zeros(3)
        self._pose = self._to = (start.probe_m, DOWN)
        self.last_action = join_action(*self._to, 0.0)
        self._scene = SceneState(scene_poses(start.pad_m, start.pillar_y_m))
        self.q_meas = POSTURE_RAD
        self._solve()

    def _solve(self):
        position, rotation = self._pose
        found = _ARM.solve(position[None], rotation[None], q_seed_rad=self.q_meas[None])
        self.q_meas = found.q_rad[0]

    @property
    def tcp_pose(self):
        return self._pose[0].copy(), self._pose[1].copy()

    @property
    def success(self):
        above = self._pose[0][2] >= PAD_TOP_M + CLEAR_M - 0.01
        return bool(self.phase == PHASES[2] and above and not self._collided)

    def state_sha256(self):
        state = [self.q_meas, *self._pose, self.last_action, self.start.pad_m, self._pushed]
        numbers = np.concatenate([np.ravel(part) for part in (*state, [self.start.pillar_y_m])])
        return hashlib.sha256(numbers.tobytes() + self.phase.encode()).hexdigest()

    def observe(self):
        one_hot = np.eye(len(PHASES))[PHASES.index(self.phase)]
        return OBSERVATION.join(
            {
                "probe_at_m": self._pose[0],
                "probe_axes": rotation_to_6d(self._pose[1]),
                "pad_at_m": self.start.pad_m,
                "pillar_at_m": np.array([self.start.pillar_y_m]),
                "flags": one_hot,
            }
        )

    def command(self, action):
        position, rotation, _ = split_action(np.asarray(action, dtype=float))
        self._to = (position.copy(), rotation.copy())
        self.last_action = np.array(action, dtype=float)

    def hold(self):
        """The last target stays."""

    def apply_force(self, force_n, duration_s):
        self._pushed = 1e-4 * np.asarray(force_n) * min(duration_s, 0.2) / 0.2

    def advance(self):
        self._pose = (self._to[0] + self._pushed, self._to[1])
        self._pushed = 0.5 * self._pushed
        self._solve()
        self.collision = _SHAPES.in_collision(self.q_meas, self._scene, held=False) is not None
        self._collided = self._collided or self.collision
        offset = self._pose[0] - [*self.start.pad_m, PAD_TOP_M]
        level = float(np.hypot(*offset[:2]))
        if self.phase == PHASES[0] and level < NEAR_M:
            self.phase = PHASES[1]
        elif self.phase == PHASES[1]:
            self._dwelt += level < NEAR_M and offset[2] < TOUCH_M + 0.004
            if self._dwelt >= DWELL_PERIODS:
                self.phase = PHASES[2]
