"""Rollouts inside the trial card's envelope: tighter than the cell, and held to it."""

import pytest

from genpolicy.errors import ConfigError
from genpolicy.evidence.stress.envelope import checker_under, envelope_document, require_tighter
from genpolicy.evidence.stress.perturbations import Nominal, ReducedEnvelope
from genpolicy.verification.commands import Reach
from genpolicy.verification.report import Reached

INSIDE = ReducedEnvelope(
    workspace_lower_m=(0.33, -0.2, 0.03), workspace_upper_m=(0.7, 0.2, 0.22), speed_limit_m_s=0.25
)


def test_the_envelope_narrows_workspace_and_speed_and_nothing_else(task, kit):
    feasibility, period_s = kit.FEASIBILITY, kit.HORIZONS.action_period_s
    free = checker_under(Nominal(), task, feasibility, action_period_s=period_s)
    held = checker_under(INSIDE, task, feasibility, action_period_s=period_s)
    assert free.cell.workspace == task.workspace and free.settings == feasibility
    assert held.cell.workspace.lower_m == (0.33, -0.2, 0.03)
    assert held.cell.workspace.upper_m == (0.7, 0.2, 0.22)
    changed = {
        name
        for name, value in held.settings.model_dump().items()
        if value != getattr(feasibility, name)
    }
    assert changed == {"tcp_speed_limit_m_s"}
    assert held.settings.tcp_speed_limit_m_s == 0.25
    slow = INSIDE.model_copy(update={"speed_limit_m_s": 0.1})
    held = checker_under(slow, task, feasibility, action_period_s=period_s)
    assert held.settings.contact_speed_limit_m_s == 0.1


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"workspace_lower_m": (0.29, -0.2, 0.03)}, "workspace_lower_m"),
        ({"workspace_upper_m": (0.7, 0.2, 0.25)}, "workspace_upper_m"),
        ({"workspace_lower_m": (0.8, -0.2, 0.03)}, "workspace_lower_m"),
        ({"speed_limit_m_s": 0.51}, "speed_limit_m_s"),
    ],
)
def test_an_envelope_looser_than_the_cell_is_a_bad_setting(task, kit, change, text):
    with pytest.raises(ConfigError, match=text):
        require_tighter(INSIDE.model_copy(update=change), task, kit.FEASIBILITY)
    require_tighter(INSIDE, task, kit.FEASIBILITY)


def test_the_document_names_limits_and_what_was_reached():
    reach = Reach(2, 0.2, (0.4, 0.0, 0.1), (0.5, 0.1, 0.2))
    document = envelope_document("envelope", INSIDE, {"flow": reach})
    assert document.speed_limit_m_s == 0.25 and document.condition == "envelope"
    assert document.reached["flow"].fastest_m_s == 0.2
    nothing = Reach(0, 0.0, (float("inf"),) * 3, (float("-inf"),) * 3).as_document()
    assert nothing == Reached(commands=0, fastest_m_s=None, lowest_m=None, highest_m=None)
