"""What stays the same from check to check: robot, scene, phases and thresholds of one cell."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Protocol

import numpy as np

from genpolicy.errors import ConfigError, ContractError
from genpolicy.feasibility.arm import CompiledArm, CompiledCollision, CompiledDynamics
from genpolicy.feasibility.context import Context
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.robot.controller import CONTROLLER_MODE
from genpolicy.robot.limits import RobotLimits
from genpolicy.robot.payload import Payload, payload_of


class Workspace(Protocol):
    """Box that the TCP may not leave; base frame."""

    @property
    def lower_m(self) -> tuple[float, float, float]:
        """Lowest x, y, z, m."""
        ...

    @property
    def upper_m(self) -> tuple[float, float, float]:
        """Highest x, y, z, m."""
        ...


class CellTask(Protocol):
    """The part of a task that feasibility asks for."""

    @property
    def scene_path(self) -> Path:
        """MJCF of robot and scene."""
        ...

    @property
    def workspace(self) -> Workspace:
        """Where the TCP may be."""
        ...

    @property
    def limits(self) -> RobotLimits:
        """Table of limits of the robot in the scene."""
        ...

    @property
    def phases(self) -> tuple[str, ...]:
        """Phases of the task, in order."""
        ...

    @property
    def contact_phases(self) -> frozenset[str]:
        """Phases in which the held object may touch the target."""
        ...

    @property
    def opening_phases(self) -> frozenset[str]:
        """Phases in which the gripper may let go; empty for a task without a gripper."""
        ...


@dataclass(frozen=True)
class Cell:
    """Everything constant that a layer may look at.

    Attributes:
        settings: Thresholds.
        action_period_s: The controller's period, s.
        workspace: Where the TCP may be.
        limits: The robot's limits, as its maker gives them.
        kinematics: The arm.
        collision: Collision queries in the scene.
        phases: Phases that the task knows, in order.
        contact_phases: Those in which the held object may touch the target.
        opening_phases: Those in which the gripper may let go.
        controller_mode: The one mode of the controller that the layers' questions are true of.

    Raises:
        ConfigError: A phase that the task does not know, no pair of the robot's own shapes to
            test, limits of another robot than the scene's, or a period that is none.
    """

    settings: FeasibilitySettings
    action_period_s: float
    workspace: Workspace
    limits: RobotLimits
    kinematics: CompiledArm
    collision: CompiledCollision
    phases: tuple[str, ...]
    contact_phases: frozenset[str]
    opening_phases: frozenset[str]
    controller_mode: str = CONTROLLER_MODE

    def __post_init__(self) -> None:
        if not (self.action_period_s > 0 and math.isfinite(self.action_period_s)):
            raise ConfigError(
                where="action_period_s",
                found=repr(self.action_period_s),
                expected="a finite time above 0 s",
                action="Correct horizons.action_period_s in params.yaml.",
            )
        for name in ("contact_phases", "opening_phases"):
            unknown = getattr(self, name) - set(self.phases)
            if unknown:
                raise ConfigError(
                    where=f"the task's {name}",
                    found=f"naming {sorted(unknown)}",
                    expected=f"phases out of {list(self.phases)}",
                    action="Correct the task: a phase of another name would never be checked.",
                )
        if not self.collision.self_pair_count > 0:
            raise ConfigError(
                where=f"{self.kinematics.scene_path.name}: self-collision",
                found="without any pair of the robot's own shapes",
                expected="at least one pair to test",
                action="Give the links colliding geoms; an untested robot may fold into itself.",
            )
        elsewhere = set(self.settings.contact_force_by_phase_n) - self.contact_phases
        if elsewhere:
            raise ConfigError(
                where="feasibility.contact_force_by_phase_n",
                found=f"naming {sorted(elsewhere)}",
                expected=f"contact phases of the task: {sorted(self.contact_phases)}",
                action="Correct params.yaml; in every other phase nothing may be touched at all.",
            )
        self._require_one_robot()

    def _require_one_robot(self) -> None:
        arm, table = self.kinematics, self.limits
        same = arm.lower_rad.shape == table.position_lower_rad.shape and (
            np.allclose(arm.lower_rad, table.position_lower_rad, atol=1e-9)
            and np.allclose(arm.upper_rad, table.position_upper_rad, atol=1e-9)
        )
        if not same:
            raise ConfigError(
                where=f"{arm.scene_path.name}: joint ranges",
                found="other than the position limits of the table",
                expected=f"those of {table.robot}",
                action="Use the scene and the limits of one robot.",
            )

    @cached_property
    def force_envelope_n(self) -> dict[str, float]:
        """Most that a command may press with, by contact phase, N; in no other phase anything."""
        own, default = self.settings.contact_force_by_phase_n, self.settings.contact_force_limit_n
        return {phase: own.get(phase, default) for phase in sorted(self.contact_phases)}

    def require_within(self, stop_n: Mapping[str, float]) -> None:
        """Refuse an envelope that allows more than the supervisor does.

        Args:
            stop_n: Contact force beyond which the supervisor stops, by phase, N.

        Raises:
            ConfigError: A contact phase allows more, or the supervisor knows no such phase.
        """
        for phase, most_n in self.force_envelope_n.items():
            if not most_n <= stop_n.get(phase, 0.0):
                raise ConfigError(
                    where=f"feasibility: force envelope of phase {phase}",
                    found=f"{most_n:g} N",
                    expected=f"at most {stop_n.get(phase, 0.0):g} N, where the supervisor stops",
                    action="Lower contact_force_limit_n, or name the phase by itself.",
                )

    @cached_property
    def usable_limits(self) -> RobotLimits:
        """The robot's rate limits times the factors of the settings."""
        limits, settings = self.limits, self.settings
        return replace(
            limits,
            velocity_rad_s=limits.velocity_rad_s * settings.velocity_factor,
            acceleration_rad_s2=limits.acceleration_rad_s2 * settings.acceleration_factor,
            jerk_rad_s3=limits.jerk_rad_s3 * settings.jerk_factor,
        )

    @cached_property
    def dynamics(self) -> CompiledDynamics:
        """What torques a motion of the arm needs."""
        return CompiledDynamics(self.kinematics)

    @cached_property
    def payload(self) -> Payload | None:
        """What a closed hand may hold, as the scene file says; None where there is nothing."""
        return payload_of(self.kinematics.scene_path, joints=self.joint_count)

    @cached_property
    def loaded_dynamics(self) -> CompiledDynamics:
        """The same with the payload in the hand."""
        return CompiledDynamics(self.kinematics, self.payload)

    @property
    def joint_count(self) -> int:
        """Joints of the arm."""
        return len(self.kinematics.lower_rad)

    def require_known(self, context: Context) -> None:
        """Refuse a context that is of another task or another robot.

        An unknown phase would be neither a contact nor an opening phase, and its chunks would be
        held against too few limits; so it is no matter for a margin.

        Raises:
            ContractError: The phase is none of the task's, or the joints are not the arm's.
        """
        if context.phase not in self.phases:
            raise ContractError(
                where="Context.phase",
                found=repr(context.phase),
                expected=f"a phase of the task: {list(self.phases)}",
                action="Hold; what may be touched in that phase is unknown.",
            )
        if len(context.q_cmd) != self.joint_count:
            raise ContractError(
                where="Context.q_cmd",
                found=f"of {len(context.q_cmd)} joints",
                expected=f"{self.joint_count}, as {self.kinematics.scene_path.name} has",
                action="Hold; deliver the state of this robot.",
            )


def cell_of(task: CellTask, settings: FeasibilitySettings, *, action_period_s: float) -> Cell:
    """The cell of a task; reads its scene file.

    Args:
        task: Scene, workspace, robot and phases.
        settings: Thresholds.
        action_period_s: The controller's period, s.
    """
    kinematics = CompiledArm(task.scene_path)
    return Cell(
        settings=settings,
        action_period_s=action_period_s,
        workspace=task.workspace,
        limits=task.limits,
        kinematics=kinematics,
        collision=CompiledCollision(task.scene_path, kinematics),
        phases=tuple(task.phases),
        contact_phases=frozenset(task.contact_phases),
        opening_phases=frozenset(task.opening_phases),
    )
