"""Section `execution` as settings of executor, supervisor and recovery."""

import pytest
from pydantic import ValidationError

from genpolicy.execution.cell import ExecutionSettings
from genpolicy.execution.recovery import RecoveryState


def test_the_parts_carry_the_section(kit):
    section, horizons = kit.EXECUTION, kit.HORIZONS
    executor = section.executor(horizons)
    assert executor.execution_horizon == horizons.execution_horizon
    assert executor.maximum_age_s == section.maximum_age_s
    assert section.supervisor(horizons).watchdog_s == executor.watchdog_s == section.watchdog_s
    plan = section.recovery().plans["approach"]
    assert plan == tuple(RecoveryState(name) for name in section.recovery_plans["approach"])


def test_every_phase_has_an_age_a_force_limit_and_a_plan(kit, task):
    section = kit.EXECUTION
    for table in (section.maximum_age_s, section.force_limit_n, section.recovery_plans):
        assert set(table) == set(task.phases)


@pytest.mark.parametrize("change", [{"unknown": 1}, {"watchdog_s": "0.1"}])
def test_unknown_and_untyped_values_are_refused(kit, change):
    with pytest.raises(ValidationError):
        ExecutionSettings(**(kit.PARAMS["execution"] | change))


def test_an_unknown_primitive_is_refused(kit):
    plans = {"approach": ["levitate"]}
    section = ExecutionSettings(**(kit.PARAMS["execution"] | {"recovery_plans": plans}))
    with pytest.raises(ValueError, match="levitate"):
        section.recovery()
