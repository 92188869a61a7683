"""The task's face to the library; see `genpolicy.tasks.api.Task`."""

import numpy as np

from genpolicy.contract.action import join_action, split_action
from genpolicy.robot.limits import RobotLimits
from genpolicy.seeds import stream
from genpolicy.tasks.api import AuditChannels, EpisodeSpec, Workspace
from ring_cell import cell, session

LIMITS = RobotLimits(
    robot="ring_six",
    source="made up for this test",
    notes="",
    position_lower_rad=np.array([-2.9, -2.7, -2.17, -2.9, -2.9, -2.9]),
    position_upper_rad=np.array([2.9, 2.7, 2.8, 2.9, 2.9, 2.9]),
    velocity_rad_s=np.full(6, 3.0),
    acceleration_rad_s2=np.full(6, 20.0),
    jerk_rad_s3=np.full(6, 8000.0),
    torque_nm=np.full(6, 50.0),
    torque_rate_nm_s=1000.0,
    tcp_speed_m_s=1.0,
    tcp_acceleration_m_s2=10.0,
    tcp_jerk_m_s3=5000.0,
    tcp_turn_rad_s=2.5,
    tcp_turn_rad_s2=25.0,
    tcp_turn_rad_s3=10000.0,
)


class RingCell:
    """Hold a probe over a pad, around a pillar on either side; no gripper."""

    name = "ring_cell"
    scene_path = cell.SCENE_PATH
    observation = cell.OBSERVATION
    phases = cell.PHASES
    contact_phases = frozenset({"settle"})
    opening_phases: frozenset[str] = frozenset()
    free_phases = frozenset({"cruise"})
    obstacles = ("pillar",)
    limits = LIMITS
    audit_channels = AuditChannels(
        position="probe_at_m",
        reference="pad_at_m",
        calibration_phase="leave",
        context=("pad_at_m",),
    )
    workspace = Workspace((0.28, -0.2, 0.03), (0.62, 0.2, 0.2))
    calibration_epochs = session.EPOCHS
    posture_rad = cell.POSTURE_RAD

    def sample_start(self, rng):
        return cell.sample_start(rng)

    def start_from_json(self, text):
        return cell.start_from_json(text)

    def make_world(self, start, *, settings):
        return cell.RingWorld(start, settings.calibration_epoch)

    def action_at(self, observation):
        """The robot has no gripper: that number of the action is 0."""
        return np.append(observation[:9], 0.0)

    def phase_of(self, observation):
        return cell.PHASES[int(np.argmax(observation[self.observation.slices["flags"]]))]

    def scene_poses(self, observation):
        slices = self.observation.slices
        pillar_y_m = float(observation[slices["pillar_at_m"]][0])
        return cell.scene_poses(observation[slices["pad_at_m"]], pillar_y_m)

    def mode_of(self, path_m, observation):
        before = path_m[path_m[:, 0] < cell.PILLAR_X_M + 0.04]
        if path_m[0, 0] >= cell.PILLAR_X_M or not len(before):
            return "unassigned"
        offset = before[:, 1] - float(observation[self.observation.slices["pillar_at_m"]][0])
        widest = float(offset[np.argmax(np.abs(offset))])
        if abs(widest) < 0.03:
            return "unassigned"
        return session.SIDES[0] if widest > 0 else session.SIDES[1]

    def picture(self, start, *, width_px, height_px):
        """A plan of the cell: pad bright, pillar dark."""
        image = np.full((height_px, width_px, 3), 255, dtype=np.uint8)
        x = np.linspace(0.28, 0.62, width_px)[None, :]
        y = np.linspace(0.2, -0.2, height_px)[:, None]
        pad_x, pad_y = start.pad_m
        image[(np.abs(x - pad_x) < 0.03) & (np.abs(y - pad_y) < 0.03)] = (90, 170, 90)
        image[np.hypot(x - cell.PILLAR_X_M, y - start.pillar_y_m) < 0.02] = (60, 60, 60)
        return image

    def fallback(self, world, kind):
        position, rotation, _ = split_action(world.last_action)
        up = np.array([position[0], position[1], max(position[2], cell.HOVER_M)])
        path = session.eased(np.array([position, up]), 1.0)
        if kind == "classical_return":
            path = np.concatenate([path, session.eased(np.array([up, world.start.probe_m]), 2.0)])
        return join_action(path, np.broadcast_to(rotation, (len(path), 3, 3)), np.zeros(len(path)))

    def episode_specs(self, root_seed, episodes, *, shares=None):
        names = list(session.OPERATORS)

        def draw(index, what, count):
            return int(stream(root_seed, "ring", index, what).integers(count))

        return [
            EpisodeSpec(
                root_seed=root_seed,
                index=index,
                kind="nominal",
                operator=names[draw(index, "operator", len(names))],
                object_name="pad",
                calibration_epoch=session.EPOCHS[2 * index // episodes],
                mode=session.SIDES[draw(index, "side", 2)],
                start=cell.sample_start(stream(root_seed, "ring", index, "start")),
                start_time_ns=session.FIRST_NS + index * session.SPACING_NS,
            )
            for index in range(episodes)
        ]

    def record_episode(self, spec):
        return session.record_episode(spec)

    def replay(self, start, actions):
        world = cell.RingWorld(start, session.EPOCHS[0])
        for action in actions:
            world.command(action)
            world.advance()
        return "success" if world.success else "failure"


TASK = RingCell()
