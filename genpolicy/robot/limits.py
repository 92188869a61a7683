"""Limits of a robot: tables with their sources, never mixed; Panda (FER) and FR3 are two.

A task says which table its robot has (`Task.limits`) and may bring its own.

A limit here is the maker's figure. What a check uses is `scaled(factor)` of it, with a factor
of the settings that is at most one; nothing in the project raises a limit.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from genpolicy.errors import ConfigError, ContractError, NonFiniteError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RobotLimits:
    """Limits of one arm of J joints; per joint unless the name says otherwise.

    Attributes:
        robot: Name of the robot that the figures belong to.
        source: Where the figures stand, with version or tag.
        notes: What is left out, and why.
        position_lower_rad: Shape (J,).
        position_upper_rad: Shape (J,).
        velocity_rad_s: Shape (J,).
        acceleration_rad_s2: Shape (J,).
        jerk_rad_s3: Shape (J,).
        torque_nm: Shape (J,).
        torque_rate_nm_s: One figure for all joints.
        tcp_speed_m_s, tcp_acceleration_m_s2, tcp_jerk_m_s3: Translation of the TCP.
        tcp_turn_rad_s, tcp_turn_rad_s2, tcp_turn_rad_s3: Rotation of the TCP.
    """

    robot: str
    source: str
    notes: str
    position_lower_rad: Array
    position_upper_rad: Array
    velocity_rad_s: Array
    acceleration_rad_s2: Array
    jerk_rad_s3: Array
    torque_nm: Array
    torque_rate_nm_s: float
    tcp_speed_m_s: float
    tcp_acceleration_m_s2: float
    tcp_jerk_m_s3: float
    tcp_turn_rad_s: float
    tcp_turn_rad_s2: float
    tcp_turn_rad_s3: float

    def __post_init__(self) -> None:
        joints = np.size(self.position_lower_rad)
        for name in _ARRAYS:
            value = np.array(getattr(self, name), dtype=float)
            if value.shape != (joints,) or not joints or not np.all(np.isfinite(value)):
                raise NonFiniteError(
                    where=f"limits of {self.robot}: {name}",
                    found=f"{value.tolist()}",
                    expected=f"{joints or 'some'} finite numbers, as many as joints",
                    action="Correct the table of limits.",
                )
            value.flags.writeable = False
            object.__setattr__(self, name, value)
        if not np.all(self.position_upper_rad > self.position_lower_rad):
            raise ContractError(
                where=f"limits of {self.robot}: position_lower_rad",
                found="not below position_upper_rad at every joint",
                expected="lower < upper",
                action="Correct the table of limits.",
            )

    def scaled(self, factor: float) -> "RobotLimits":
        """The same robot with every rate and torque limit times `factor`; positions stay.

        Raises:
            ConfigError: The factor is not in (0, 1].
        """
        if not (0.0 < factor <= 1.0):
            raise ConfigError(
                where=f"factor on the limits of {self.robot}",
                found=repr(factor),
                expected="in (0, 1]: a limit may be lowered, never raised",
                action="Correct params.yaml.",
            )
        rates = {name: getattr(self, name) * factor for name in _RATES}
        return replace(self, **rates)


_POSITIONS = ("position_lower_rad", "position_upper_rad")
_JOINT_RATES = ("velocity_rad_s", "acceleration_rad_s2", "jerk_rad_s3", "torque_nm")
_ARRAYS = _POSITIONS + _JOINT_RATES
_RATES = (
    *_JOINT_RATES,
    "torque_rate_nm_s", "tcp_speed_m_s", "tcp_acceleration_m_s2", "tcp_jerk_m_s3",
    "tcp_turn_rad_s", "tcp_turn_rad_s2", "tcp_turn_rad_s3",
)  # fmt: skip


def _joints(*values: float) -> Array:
    return np.array(values, dtype=float)


PANDA = RobotLimits(
    robot="panda",
    source="libfranka tag 0.9.2 rate_limiting.h; positions and torques: Panda URDF / data sheet",
    notes="The maker's limiter also subtracts 1e-3 and 3 packets x 1 ms x acceleration of speed.",
    position_lower_rad=_joints(-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973),
    position_upper_rad=_joints(2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973),
    velocity_rad_s=_joints(2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61),
    acceleration_rad_s2=_joints(15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0),
    jerk_rad_s3=_joints(7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10000.0),
    torque_nm=_joints(87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0),
    torque_rate_nm_s=1000.0,
    tcp_speed_m_s=2.0,
    tcp_acceleration_m_s2=13.0,
    tcp_jerk_m_s3=6500.0,
    tcp_turn_rad_s=2.5,
    tcp_turn_rad_s2=25.0,
    tcp_turn_rad_s3=12500.0,
)

FR3 = RobotLimits(
    robot="fr3",
    source="libfranka main rate_limiting.h; positions, velocities and torques: FR3 data sheet",
    notes=(
        "The FR3's velocity limit depends on the joint position; that part is left out, the "
        "constant figures are its ceiling. Do not rely on them near the ends of a joint."
    ),
    position_lower_rad=_joints(-2.7437, -1.7837, -2.9007, -3.0421, -2.8065, 0.5445, -3.0159),
    position_upper_rad=_joints(2.7437, 1.7837, 2.9007, -0.1518, 2.8065, 4.5169, 3.0159),
    velocity_rad_s=_joints(2.62, 2.62, 2.62, 2.62, 5.26, 4.18, 5.26),
    acceleration_rad_s2=_joints(10.0, 10.0, 10.0, 10.0, 10.0, 10.0, 10.0),
    jerk_rad_s3=_joints(5000.0, 5000.0, 5000.0, 5000.0, 5000.0, 5000.0, 5000.0),
    torque_nm=_joints(87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0),
    torque_rate_nm_s=1000.0,
    tcp_speed_m_s=3.0,
    tcp_acceleration_m_s2=9.0,
    tcp_jerk_m_s3=4500.0,
    tcp_turn_rad_s=2.5,
    tcp_turn_rad_s2=17.0,
    tcp_turn_rad_s3=8500.0,
)

LIMITS: dict[str, RobotLimits] = {"panda": PANDA, "fr3": FR3}
