"""Section `execution` as settings of executor, supervisor and recovery."""

import pytest
from pydantic import ValidationError

from genpolicy.errors import ConfigError
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


def test_a_number_a_default_and_an_exception_are_read_as_one_entry_per_phase(kit):
    raw = kit.PARAMS["execution"]
    table = {"default": 0.4, "insert": 0.3}
    section = ExecutionSettings(**(raw | {"maximum_age_s": table}))
    assert section.maximum_age_s == dict.fromkeys(raw["force_limit_n"], 0.4) | {"insert": 0.3}
    bare = ExecutionSettings(**(raw | {"maximum_age_s": {"insert": 0.3}, "recovery_plans": {}}))
    assert bare.maximum_age_s == {"insert": 0.3} and bare.recovery_plans == {}
    assert ExecutionSettings(**section.model_dump()) == section


@pytest.mark.parametrize("name", ["maximum_age_s", "recovery_plans"])
def test_a_phase_that_nothing_else_knows_is_refused(kit, name):
    change = {name: {"levitate": 0.3 if name == "maximum_age_s" else ["retreat"]}}
    with pytest.raises(ConfigError, match="levitate"):
        ExecutionSettings(**(kit.PARAMS["execution"] | change))


def test_the_phases_must_be_those_of_the_task(kit, task):
    kit.EXECUTION.require_phases(task.phases)
    with pytest.raises(ConfigError, match="expected the task"):
        kit.EXECUTION.require_phases([*task.phases, "levitate"])


@pytest.mark.parametrize("change", [{"unknown": 1}, {"watchdog_s": "0.1"}])
def test_unknown_and_untyped_values_are_refused(kit, change):
    with pytest.raises(ValidationError):
        ExecutionSettings(**(kit.PARAMS["execution"] | change))


def test_an_unknown_primitive_is_refused(kit):
    plans = {"approach": ["levitate"]}
    section = ExecutionSettings(**(kit.PARAMS["execution"] | {"recovery_plans": plans}))
    with pytest.raises(ValueError, match="levitate"):
        section.recovery()


@pytest.mark.parametrize("age_s", [0.4, 0.45, {"default": 0.35, "insert": 0.4}])
def test_an_age_limit_that_a_chunk_never_reaches_is_refused(kit, age_s):
    """Eight actions of 0.05 s: a chunk is void after 0.4 s, and 0.45 s would refuse nothing."""
    section = ExecutionSettings(**(kit.PARAMS["execution"] | {"maximum_age_s": age_s}))
    with pytest.raises(ConfigError, match=r"maximum_age_s of phase .* less than 0\.4 s"):
        section.executor(kit.HORIZONS)
    assert kit.EXECUTION.executor(kit.HORIZONS).maximum_age_s["insert"] < 0.4
