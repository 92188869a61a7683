"""What the checker holds sessions against is what sessions of the same cell declare."""

import pytest

from genpolicy.evidence.shadow.rig import Rig, rig_cell
from genpolicy.execution.figures import expected_settings

OTHER = {
    "execution_horizon": 5, "watchdog_s": 0.2, "queue_capacity": 3, "deadline_s": 0.14,
    "maximum_divergence_m": 0.07, "maximum_scene_shift_m": 0.03, "silence_stop_s": 2.0,
}  # fmt: skip


@pytest.mark.parametrize("changes", [{}, *({name: value} for name, value in OTHER.items())])
def test_what_a_session_declares_is_what_is_expected_of_it(changes):
    rig = Rig(**changes)
    (declared,) = [event.payload for event in rig.journal.events() if event.kind == "session"]
    expected = expected_settings(rig.cell)
    held_to = expected.declared()
    assert {name: declared[name] for name in held_to} == held_to
    assert expected.force_limit_n == rig.cell.execution.force_limit_n  # no journal declares these
    assert expected.deadline_s == rig.cell.execution.deadline_s
    assert expected.silence_stop_s == rig.cell.execution.silence_stop_s


def test_another_cell_is_another_expectation():
    plain = expected_settings(rig_cell())
    for name, value in OTHER.items():
        assert expected_settings(rig_cell(**{name: value})) != plain
