import numpy as np
import pytest

from genpolicy.errors import ConfigError, ContractError, NonFiniteError
from genpolicy.robot.limits import FR3, LIMITS, PANDA, RobotLimits


def test_panda_golden():
    # libfranka tag 0.9.2 (rate_limiting.h) and the maker's URDF.
    assert PANDA.velocity_rad_s.tolist() == [2.175] * 4 + [2.61] * 3
    assert PANDA.acceleration_rad_s2.tolist() == [15, 7.5, 10, 12.5, 15, 20, 20]
    assert PANDA.jerk_rad_s3.tolist() == [7500, 3750, 5000, 6250, 7500, 10000, 10000]
    assert PANDA.torque_nm.tolist() == [87] * 4 + [12] * 3
    assert PANDA.position_upper_rad[3] == -0.0698
    assert PANDA.position_lower_rad[5] == -0.0175
    assert (PANDA.tcp_speed_m_s, PANDA.tcp_acceleration_m_s2, PANDA.tcp_jerk_m_s3) == (2, 13, 6500)


def test_fr3_golden():
    # libfranka main (rate_limiting.h) and the FR3 data sheet.
    assert FR3.acceleration_rad_s2.tolist() == [10] * 7
    assert FR3.jerk_rad_s3.tolist() == [5000] * 7
    assert FR3.position_lower_rad[5] == 0.5445
    assert (FR3.tcp_speed_m_s, FR3.tcp_acceleration_m_s2, FR3.tcp_jerk_m_s3) == (3, 9, 4500)
    assert "depends on the joint position" in FR3.notes


def test_the_two_tables_are_two_robots():
    assert set(LIMITS) == {"panda", "fr3"}
    for name in ("position_lower_rad", "velocity_rad_s", "acceleration_rad_s2", "jerk_rad_s3"):
        assert not np.array_equal(getattr(PANDA, name), getattr(FR3, name))


def test_scaled_lowers_rates_and_keeps_positions():
    half = PANDA.scaled(0.5)
    assert np.array_equal(half.velocity_rad_s, PANDA.velocity_rad_s / 2)
    assert np.array_equal(half.position_upper_rad, PANDA.position_upper_rad)
    assert half.tcp_jerk_m_s3 == 3250


@pytest.mark.parametrize("factor", [0.0, -1.0, 1.0000001, float("nan"), float("inf")])
def test_a_limit_is_never_raised(factor):
    with pytest.raises(ConfigError, match="never raised"):
        PANDA.scaled(factor)


def test_tables_are_read_only():
    with pytest.raises(ValueError, match="read-only"):
        PANDA.velocity_rad_s[0] = 9


def test_a_bad_table_is_refused():
    fields = {name: getattr(PANDA, name) for name in PANDA.__dataclass_fields__}
    with pytest.raises(ContractError, match="lower < upper"):
        RobotLimits(**(fields | {"position_lower_rad": fields["position_upper_rad"]}))
    with pytest.raises(NonFiniteError, match="velocity_rad_s"):
        RobotLimits(**(fields | {"velocity_rad_s": np.full(7, np.nan)}))


def test_a_table_has_as_many_joints_as_its_robot():
    fields = {name: getattr(PANDA, name) for name in PANDA.__dataclass_fields__}
    arrays = {name: value[:6] for name, value in fields.items() if isinstance(value, np.ndarray)}
    six = RobotLimits(**(fields | arrays | {"robot": "six"}))
    assert six.scaled(0.5).velocity_rad_s.shape == (6,)
    with pytest.raises(NonFiniteError, match="7 finite numbers"):
        RobotLimits(**(fields | {"jerk_rad_s3": fields["jerk_rad_s3"][:6]}))
