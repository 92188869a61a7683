"""Section `execution`: one home of what executor, stub, supervisor and recovery are held to."""

import math

import pytest
from pydantic import ValidationError

from genpolicy.contract.settings import parse_settings
from genpolicy.errors import ConfigError
from genpolicy.evidence.shadow.rig import EXECUTION, Rig, rig_cell
from genpolicy.execution.cell import FALLBACK_HASH, Cell, ExecutionSettings, RecoveryState
from genpolicy.execution.journal import Journal
from genpolicy.execution.recovery import Recovery


def section(kit, **changes):
    return ExecutionSettings(**(kit.PARAMS["execution"] | changes))


def test_everybody_reads_the_section_itself(kit):
    rig = Rig()
    recovery = Recovery(rig.cell.execution, Journal("r"))
    for settings in (rig.executor.cell.execution, rig.supervisor.settings, recovery.settings):
        assert settings is rig.cell.execution
    cell = Cell(kit.HORIZONS, kit.EXECUTION)
    assert cell.period_ns == round(kit.HORIZONS.action_period_s * 1e9)
    assert cell.watchdog_ns == round(kit.EXECUTION.watchdog_s * 1e9)
    assert cell.maximum_age_ns["insert"] == round(kit.EXECUTION.maximum_age_s["insert"] * 1e9)
    view = cell.first_view()
    assert (view.fallback, view.period_ns) == (FALLBACK_HASH, cell.period_ns)
    assert view.execution_horizon == kit.HORIZONS.execution_horizon


def test_every_phase_has_an_age_a_force_limit_and_a_plan(kit, task):
    settings = kit.EXECUTION
    for table in (settings.maximum_age_s, settings.force_limit_n, settings.recovery_plans):
        assert set(table) == set(task.phases)
    names = kit.PARAMS["execution"]["recovery_plans"]["approach"]
    assert settings.recovery_plans["approach"] == tuple(RecoveryState(name) for name in names)


def test_a_number_a_default_and_an_exception_are_read_as_one_entry_per_phase(kit):
    phases = kit.PARAMS["execution"]["force_limit_n"]
    settings = section(kit, maximum_age_s={"default": 0.4, "insert": 0.3})
    assert settings.maximum_age_s == dict.fromkeys(phases, 0.4) | {"insert": 0.3}
    bare = section(kit, maximum_age_s={"insert": 0.3}, recovery_plans={})
    assert bare.maximum_age_s == {"insert": 0.3} and bare.recovery_plans == {}
    assert ExecutionSettings(**settings.model_dump()) == settings


@pytest.mark.parametrize("name", ["maximum_age_s", "recovery_plans"])
def test_a_phase_that_nothing_else_knows_is_refused(kit, name):
    change = {name: {"levitate": 0.3 if name == "maximum_age_s" else ["retreat"]}}
    with pytest.raises(ConfigError, match="levitate"):
        section(kit, **change)


def test_the_phases_must_be_those_of_the_task(kit, task):
    cell = Cell(kit.HORIZONS, kit.EXECUTION)
    cell.require_task(task.phases)
    with pytest.raises(ConfigError, match="expected the task"):
        cell.require_task([*task.phases, "levitate"])


@pytest.mark.parametrize("change", [
    {"unknown": 1}, {"watchdog_s": "0.1"}, {"watchdog_s": 0.0}, {"watchdog_s": math.inf},
    {"queue_capacity": 0}, {"replan_lead_rows": -1}, {"maximum_age_s": {"approach": math.nan}},
    {"maximum_age_s": {"approach": -0.1}}, {"maximum_divergence_m": math.nan},
    {"force_limit_n": {"approach": -1.0}}, {"force_limit_n": {"approach": math.nan}},
    {"recovery_hold_s": -1.0}, {"human_timeout_s": math.inf}, {"maximum_failures": 0},
    {"silence_stop_s": 0.0}, {"deadline_s": 0.0},
])  # fmt: skip
def test_what_is_unknown_untyped_or_out_of_range_is_refused_by_name(change):
    (name,) = change
    values = {**EXECUTION.model_dump(), "recovery_plans": {}, **change}
    if name == "force_limit_n":
        values |= {"maximum_age_s": 0.3, "late_chunk": {"hold": ["approach"]}}
    with pytest.raises(ValidationError):
        ExecutionSettings(**values)
    with pytest.raises(ConfigError, match=rf"params\.yaml: execution\.{name}"):
        parse_settings(ExecutionSettings, values, where="params.yaml: execution")


@pytest.mark.parametrize("names", [
    ["levitate"], ["ask_human"], ["retreat", "retreat"], "retreat", None,
])  # fmt: skip
def test_a_plan_of_other_primitives_is_refused(kit, names):
    with pytest.raises(ConfigError, match="recovery_plans of phase approach"):
        section(kit, recovery_plans={"approach": names})


LATE = {"continue": ["approach", "align"], "hold": ["insert", "release"],
        "fallback": ["retreat", "recover"]}  # fmt: skip


def test_every_phase_says_what_becomes_of_a_late_chunk(kit, task):
    settings = section(kit, late_chunk=LATE)
    assert settings.late_by_phase == {phase: what for what in LATE for phase in LATE[what]}
    assert ExecutionSettings(**settings.model_dump()) == settings
    cell = Cell(kit.HORIZONS, settings)
    lead, last = settings.replan_lead_rows, kit.HORIZONS.prediction_horizon - 1
    assert cell.latest_first_row == dict.fromkeys(LATE["continue"], last) | dict.fromkeys(
        [*LATE["hold"], *LATE["fallback"]], lead
    )
    assert set(kit.EXECUTION.late_by_phase) == set(task.phases)
    in_contact = {kit.EXECUTION.late_by_phase[phase] for phase in task.contact_phases}
    assert in_contact == {"hold"}
    assert cell.first_view().latest_first_row is None  # before it is known where we are: none


@pytest.mark.parametrize(("change", "found"), [
    ({"continue": ["approach"]}, "no align"), ({"hold": []}, "no insert, no release"),
    ({"hold": ["insert", "release", "approach"]}, "approach twice"),
    ({"hold": ["insert", "release", "release"]}, "release twice"),
    ({"fallback": ["retreat", "recover", "levitate"]}, "the phase 'levitate'"),
    ({"default": ["approach"]}, "'default'"), ({"hold": "insert"}, "'hold'"),
    ({"wait": []}, "'wait'"), ({"hold": None}, "'hold'"), ({"hold": [["insert"]]}, "no insert"),
])  # fmt: skip
def test_a_phase_in_no_list_or_in_two_is_refused(kit, change, found):
    with pytest.raises(ConfigError, match=rf"execution\.late_chunk is .*{found}"):
        section(kit, late_chunk=LATE | change)


@pytest.mark.parametrize("late", [None, "hold", ["approach"]])
def test_there_is_no_default_for_a_late_chunk(kit, late):
    values = {**kit.PARAMS["execution"], "late_chunk": late}
    with pytest.raises(ConfigError, match=r"params\.yaml: execution\.late_chunk"):
        parse_settings(ExecutionSettings, values, where="params.yaml: execution")
    del values["late_chunk"]
    with pytest.raises(ConfigError, match=r"params\.yaml: execution\.late_chunk"):
        parse_settings(ExecutionSettings, values, where="params.yaml: execution")


@pytest.mark.parametrize("age_s", [0.35, 0.4, 0.45, {"default": 0.3, "insert": 0.35}])
def test_an_age_limit_that_no_action_exceeds_is_refused(kit, task, age_s):
    """Eight actions of 0.05 s: the last one is 0.35 s old, and 0.35 s would refuse nothing."""
    cell = Cell(kit.HORIZONS, section(kit, maximum_age_s=age_s))
    with pytest.raises(ConfigError, match=r"maximum_age_s of phase .* less than 0\.35 s"):
        cell.require_task(task.phases)
    Cell(kit.HORIZONS, section(kit, maximum_age_s=0.349)).require_task(task.phases)


def test_the_shipped_age_limit_refuses_what_its_chunk_still_allows(kit):
    """On the ticks of a rollout: with the limit fewer actions of a chunk move than without."""

    def moved(age_s):
        rig = Rig(maximum_age_s={"approach": age_s, "insert": age_s})
        assert rig.cell.horizons.execution_horizon == kit.HORIZONS.execution_horizon
        assert rig.cell.horizons.action_period_s == kit.HORIZONS.action_period_s
        return sum(command.kind == "action" for command in rig.run())

    assert moved(1.0) == kit.HORIZONS.execution_horizon
    assert 0 < moved(kit.EXECUTION.maximum_age_s["approach"]) < kit.HORIZONS.execution_horizon


def test_a_watchdog_shorter_than_a_period_is_refused():
    assert rig_cell(watchdog_s=0.05).watchdog_ns == 50_000_000
    with pytest.raises(ConfigError, match=r"execution\.watchdog_s is 0\.049 s.* one period"):
        rig_cell(watchdog_s=0.049)
