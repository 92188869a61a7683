"""The cell in MuJoCo: reset, command, advance, observe; contact rules and success test.

One action period is 25 physics steps of 2 ms; the target moves in a straight line (and at constant
angular velocity) from the last target to the new one within the period.
"""

import hashlib
from collections.abc import Callable

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from genpolicy.contract.action import join_action, split_action
from genpolicy.contract.rotation import rotation_to_6d
from genpolicy.errors import NonFiniteError
from genpolicy.robot.impedance import ImpedanceController
from genpolicy.seeds import stream
from genpolicy.tasks.api import WorldSettings
from genpolicy.tasks.tabletop_insertion import scene
from genpolicy.tasks.tabletop_insertion.contacts import ContactMonitor
from genpolicy.tasks.tabletop_insertion.observation import CONTACT_PHASES, OBSERVATION, one_hot
from genpolicy.tasks.tabletop_insertion.phases import Measured, PhaseLogic
from genpolicy.tasks.tabletop_insertion.probes import find_epoch, find_probe
from genpolicy.tasks.tabletop_insertion.scene import ARM_JOINTS
from genpolicy.tasks.tabletop_insertion.start import InsertionStart

Array = NDArray[np.float64]
StepHook = Callable[[int], None]

ACTION_PERIOD_S = 0.05
SUB_STEPS = 25
SETTLE_STEPS = 150
SUCCESS_DEPTH_M = 0.025
SUCCESS_RETREAT_M = 0.06


class TabletopWorld:
    """One simulated cell, at rest at its start.

    Attributes:
        hole_half_width_m: Half the width of the hole.
        camera_noise_m: Standard deviation of white noise on every position that the camera sees,
            beside that of a probe.

    Args:
        start: Where arm, hole and post begin.
        settings: Calibration epoch and probe.

    Raises:
        ConfigError: The epoch or the probe is unknown.
        ContractError: The arm cannot reach the start.
    """

    hole_half_width_m = scene.HOLE_HALF_WIDTH_M
    camera_noise_m = 0.0

    def __init__(self, start: InsertionStart, *, settings: WorldSettings) -> None:
        self.start = start
        self.settings = settings
        self._epoch = find_epoch(settings.calibration_epoch)
        self._probe = find_probe(settings.probe)
        self.model = self._model()
        self.data = mujoco.MjData(self.model)
        self._bind()
        self._reset()

    def _model(self) -> mujoco.MjModel:
        return scene.load_model(self._probe.variant)

    def _bind(self) -> None:
        model, data = self.model, self.data
        site = int(model.site(scene.TCP_SITE).id)
        self._tcp = data.site_xpos[site]
        self._tcp_rotation = data.site_xmat[site].reshape(3, 3)
        self._q = data.qpos[:ARM_JOINTS]
        self._fingers = data.qpos[ARM_JOINTS : ARM_JOINTS + 2]
        self._finger_ctrl = data.ctrl[ARM_JOINTS : ARM_JOINTS + 2]
        self._hand_force = data.xfrc_applied[int(model.body("hand").id)]
        self._peg_position = data.xpos[int(model.body("peg").id)]
        self._peg_rotation = data.xmat[int(model.body("peg").id)].reshape(3, 3)
        self._grasp = int(model.equality("grasp").id)
        self._grasp_active = data.eq_active
        self._controller = ImpedanceController(
            model, data, site=scene.TCP_SITE, posture_rad=scene.POSTURE_RAD
        )
        self._contacts = ContactMonitor(model, data)

    def _reset(self) -> None:
        start, model, data = self.start, self.model, self.data
        position = np.array([start.tcp_x_m, start.tcp_y_m, start.tcp_z_m])
        rotation = scene.tool_rotation(start.yaw_rad)
        scene.place_scene(model, data, start)
        self._q[:] = scene.solve_arm(model, position, rotation)
        self._fingers[:] = scene.GRASP_OPENING_M
        peg = data.qpos[ARM_JOINTS + 2 :]
        peg[:3] = position + rotation @ np.array([0.0, 0.0, scene.TIP_OFFSET_M - 0.04])
        mujoco.mju_mat2Quat(peg[3:], (rotation @ np.diag([1.0, -1.0, -1.0])).ravel())
        self._finger_ctrl[:] = scene.GRASP_OPENING_M
        self._last_action = join_action(position, rotation, scene.GRASP_OPENING_M)
        still = np.zeros(6)
        for _ in range(SETTLE_STEPS):
            mujoco.mj_step1(model, data)
            self._controller.step(position, rotation, still)
            mujoco.mj_step2(model, data)
        data.qvel[:] = 0.0
        data.time = 0.0
        mujoco.mj_forward(model, data)
        self._controller.reset()
        self._from = self._to = (position, rotation)
        self._angular_velocity = np.zeros(3)
        self._phases = PhaseLogic()
        self._recovery_requested = False
        self._force_until_s = 0.0
        self._collided = False
        self._collision = False
        self._contact_force_n = 0.0
        self._wrench = np.zeros(3)
        self._periods = 0
        self._noise = stream(self.settings.seed, "probe", self.settings.probe)
        self._camera = np.zeros(5)
        self._see()

    @property
    def time_s(self) -> float:
        """Simulated time since the start, s."""
        return self._periods * ACTION_PERIOD_S

    @property
    def phase(self) -> str:
        """Task phase, from the measured state."""
        return self._phases.phase

    @property
    def calibration_epoch(self) -> str:
        """Camera calibration in force."""
        return self.settings.calibration_epoch

    @property
    def q_meas(self) -> Array:
        """Measured joint positions, rad. Shape (7,)."""
        return np.array(self._q)

    @property
    def tcp_pose(self) -> tuple[Array, Array]:
        """Measured TCP position (3,), m, and rotation (3, 3) in the base frame."""
        return self._tcp.copy(), self._tcp_rotation.copy()

    @property
    def gripper_opening_m(self) -> float:
        """Mean distance of the fingers from closed, m."""
        return float(self._fingers.mean())

    @property
    def wrench_n(self) -> Array:
        """Contact force on hand and held peg in the last physics step, N. Shape (3,)."""
        return self._wrench.copy()

    @property
    def holding(self) -> bool:
        """The peg is in the grasp."""
        return bool(self._grasp_active[self._grasp])

    @property
    def last_action(self) -> Array:
        """Target commanded last. Shape (10,)."""
        return self._last_action.copy()

    @property
    def contact_force_n(self) -> float:
        """Largest contact force on hand and held peg during the last `advance`, N."""
        return self._contact_force_n

    @property
    def collision(self) -> bool:
        """A forbidden contact happened during the last `advance`."""
        return self._collision

    @property
    def tip_depth_m(self) -> float:
        """How deep the peg's lowest end is below the fixture's top, m; only above the hole."""
        tilt = abs(float(self._peg_rotation[2, 2]))
        return scene.FIXTURE_TOP_M - float(self._peg_position[2]) + scene.PEG_HALF_LENGTH_M * tilt

    @property
    def success(self) -> bool:
        """Peg released in the hole, gripper open, hand up, never a forbidden contact."""
        hole = np.array([self.start.hole_x_m, self.start.hole_y_m])
        inside = np.hypot(*(self._peg_position[:2] - hole)) < self.hole_half_width_m
        return (
            not self._collided
            and not self.holding
            and bool(inside)
            and abs(float(self._peg_rotation[2, 2])) > 0.9
            and self.tip_depth_m >= SUCCESS_DEPTH_M
            and self.gripper_opening_m >= 0.8 * scene.OPEN_OPENING_M
            and float(self._tcp[2]) >= scene.FIXTURE_TOP_M + SUCCESS_RETREAT_M
        )

    def state_sha256(self) -> str:
        """Hash of integration state (mocap poses and active constraints in it) and last target."""
        signature = int(mujoco.mjtState.mjSTATE_INTEGRATION)
        state = np.zeros(mujoco.mj_stateSize(self.model, signature))
        mujoco.mj_getState(self.model, self.data, state, signature)
        digest = hashlib.sha256(state.tobytes())
        for part in (self.data.mocap_pos, self.data.mocap_quat, self.data.eq_active):
            digest.update(np.ascontiguousarray(part).tobytes())
        digest.update(self._last_action.tobytes())
        return digest.hexdigest()

    def observe(self) -> Array:
        """Observation now, without delay; noise only where the probe has it. Shape (24,)."""
        return OBSERVATION.join(
            {
                "tcp_position_m": self._tcp,
                "tcp_rotation": rotation_to_6d(self._tcp_rotation),
                "gripper_opening_m": np.array([self.gripper_opening_m]),
                "wrench_n": self._wrench,
                "hole_pose": self._camera[:4],
                "post_position_m": self._camera[4:],
                "phase": one_hot(self.phase),
            }
        )

    def command(self, action: Array) -> None:
        """Set the target that the controller reaches at the end of the next `advance`.

        Raises:
            NonFiniteError: The action holds NaN, infinity, or a rotation that is none.
        """
        position, rotation, opening = split_action(np.asarray(action, dtype=np.float64))
        if not (np.isfinite(action).all() and np.isfinite(rotation).all()):
            raise NonFiniteError(
                where="the commanded action",
                found=f"{np.asarray(action).tolist()}",
                expected="ten finite numbers with two independent rotation columns",
                action="Reject the whole chunk and hold; do not clip or fill it.",
            )
        self._to = (position.copy(), rotation)
        turn = Rotation.from_matrix(rotation @ self._from[1].T).as_rotvec()
        self._angular_velocity = turn / ACTION_PERIOD_S
        self._finger_ctrl[:] = min(max(float(opening), 0.0), scene.OPEN_OPENING_M)
        self._last_action = np.array(action, dtype=np.float64)

    def hold(self) -> None:
        """Keep the last target."""
        self._angular_velocity = np.zeros(3)
        self._from = self._to

    def advance(self, on_step: StepHook | None = None) -> None:
        """Simulate one action period.

        Args:
            on_step: Called before every physics step with the number of steps made since the
                start; measured properties are valid inside.
        """
        model, data, contacts = self.model, self.data, self._contacts
        positions, rotations, velocity = self._targets()
        contacts.begin(contact_allowed=self.phase in CONTACT_PHASES)
        first = self._periods * SUB_STEPS
        for k in range(SUB_STEPS):
            mujoco.mj_step1(model, data)
            if on_step is not None:
                on_step(first + k)
            self._controller.step(positions[k], rotations[k], velocity)
            mujoco.mj_step2(model, data)
            if data.ncon:
                contacts.inspect(self.holding)
                self._wrench = contacts.force_n
            elif contacts.touching:
                contacts.clear()
                self._wrench = contacts.force_n
            if self._finger_ctrl[0] > scene.RELEASE_OPENING_M and self.holding:
                self._release_when_open()
        self._finish_period()

    def apply_force(self, force_n: Array, duration_s: float) -> None:
        """Push the hand from now on, for whole action periods. Base frame, N, shape (3,)."""
        self._hand_force[:3] = force_n
        self._force_until_s = self.time_s + duration_s

    def request_recovery(self, active: bool) -> None:
        """Flag the phase `recover` (outside the contact phases), or clear the flag."""
        self._recovery_requested = active

    def _targets(self) -> tuple[Array, Array, Array]:
        (begin, rotation), (end, _) = self._from, self._to
        share = np.arange(1, SUB_STEPS + 1)[:, None] / SUB_STEPS
        positions = begin + share * (end - begin)
        if self._angular_velocity.any():
            turns = Rotation.from_rotvec(share * self._angular_velocity * ACTION_PERIOD_S)
            rotations = turns.as_matrix() @ rotation
        else:
            rotations = np.broadcast_to(rotation, (SUB_STEPS, 3, 3))
        velocity = np.concatenate([(end - begin) / ACTION_PERIOD_S, self._angular_velocity])
        return positions, rotations, velocity

    def _release_when_open(self) -> None:
        if self.gripper_opening_m > scene.RELEASE_OPENING_M:
            self._grasp_active[self._grasp] = 0

    def _finish_period(self) -> None:
        mujoco.mj_kinematics(self.model, self.data)
        self._periods += 1
        self._from = self._to
        self._angular_velocity = np.zeros(3)
        if self.time_s >= self._force_until_s:
            self._hand_force[:] = 0.0
        self._collision = self._contacts.collision
        self._collided = self._collided or self._collision
        self._contact_force_n = self._contacts.peak_n
        self._phases.update(
            Measured(
                tcp_m=self._tcp,
                hole_xy_m=np.array([self.start.hole_x_m, self.start.hole_y_m]),
                gripper_opening_m=self.gripper_opening_m,
                holding=self.holding,
                deviation_m=float(np.linalg.norm(self._tcp - self._to[0])),
                recovery_requested=self._recovery_requested,
            ),
            period_s=ACTION_PERIOD_S,
        )
        self._see()

    def _see(self) -> None:
        epoch, probe, start = self._epoch.camera, self._probe.camera, self.start
        noise_m = float(np.hypot(probe.noise_m, self.camera_noise_m))
        noise = noise_m * self._noise.standard_normal(3) if noise_m else np.zeros(3)
        yaw = start.hole_yaw_rad + epoch.yaw_rad + probe.yaw_rad
        shift_x, shift_y = epoch.x_m + probe.x_m, epoch.y_m + probe.y_m
        self._camera = np.array(
            [
                start.hole_x_m + shift_x + noise[0],
                start.hole_y_m + shift_y + noise[1],
                np.cos(yaw),
                np.sin(yaw),
                start.post_y_m + shift_y + noise[2],
            ]
        )
