"""Who takes over an arm, who keeps it, and that no stop is cleared by coming or going."""

import pytest

from genpolicy.evidence.shadow.rig import EXECUTION, rig_cell
from genpolicy.execution.attended import AttendedExecutor
from genpolicy.execution.journal import Journal
from genpolicy.execution.stub import ControllerStub
from genpolicy.execution.supervisor import Supervisor

WHO = "ada"


@pytest.fixture
def executor():
    journal = Journal("r", {"perturbation": "push", "start": "4"})
    cell = rig_cell()
    supervisor = Supervisor(EXECUTION, journal)
    return AttendedExecutor(cell, journal, ControllerStub(cell, journal, supervisor))


def test_nobody_takes_over_who_was_not_called_has_no_name_or_meets_a_stop(executor):
    assert not executor.take_over(0.0, WHO)
    executor.intervene(0.1)
    assert not any(executor.take_over(0.2, nobody) for nobody in (" ", "\u200b", "-", None))
    executor.stub.supervisor.emergency_stop(0.3)
    assert not executor.take_over(0.4, WHO)
    assert executor.stub.supervisor.stopped and not executor.person


def test_a_person_keeps_the_arm_until_it_is_given_back(executor):
    executor.intervene(0.1)
    assert executor.take_over(0.2, WHO) and executor.mode == "fallback"
    executor.end_fallback(0.3)
    assert executor.mode == "fallback" and executor.person == WHO
    executor.reset(0.4)
    assert executor.mode == "intervention" and executor.person == ""
    assert executor.take_over(0.5, WHO)
    executor.hand_back(0.6)
    assert executor.mode == "run" and executor.person == ""
    executor.intervene(0.7)
    assert executor.take_over(0.8, WHO)
    executor.end_episode(0.9)
    told = [e.payload["stage"] for e in executor._journal.events() if e.kind == "person"]
    assert told == ["took_over", "gave_up", "took_over", "handed_back", "took_over",
                    "episode_over"]  # fmt: skip
