"""Bounds of another commit: read as text they are those of the module, and none is run."""

from pathlib import Path

import pytest

from gates.floor_history import FLOORS, bound_moves, bounds_in
from gates.floors import BOUNDS

SOURCE = Path(__file__).parents[2].joinpath(FLOORS).read_text()


def test_every_bound_of_the_module_is_read_from_its_text():
    """Nothing is imported: constants, shared functions and calls are followed in the text."""
    read = {place: (found.comparison, found.bound) for place, found in bounds_in(SOURCE).items()}
    assert read == {(one.gate, one.place): (one.comparison, one.bound) for one in BOUNDS}


@pytest.mark.parametrize(
    ("old", "new", "places", "kind"),
    [
        ("OLDEST_ACTION_S = 1.0", "OLDEST_ACTION_S = 2.0",
         {"C.execution.maximum_age_s", "D.execution.maximum_age_s", "C.execution.deadline_s",
          "D.execution.deadline_s", "D.latency_p95_s"}, "loosened"),
        ('"intervention_upper", "<=", 0.2', '"intervention_upper", "<=", 0.1',
         {"D.intervention_upper"}, "tightened"),
        ('"nominal_success_lower", ">=", 0.2', '"nominal_success_lower", ">=", 0.1',
         {"D.nominal_success_lower"}, "loosened"),
        ('"stub_stale", "stub_invalid"', '"stub_stale"', {"C.stub_invalid"}, "loosened"),
        ('"reset_upper", "<="', '"reset_upper", ">="', {"D.reset_upper"}, "changed"),
    ],
)  # fmt: skip
def test_a_bound_that_moved_is_named_with_its_way(old, new, places, kind):
    assert old in SOURCE
    found = bound_moves(SOURCE, SOURCE.replace(old, new))
    assert set(found) == {f"{FLOORS}: {place}" for place in places}
    assert {move[1] for move in found.values()} == {kind}
    back = {move[1] for move in bound_moves(SOURCE.replace(old, new), SOURCE).values()}
    assert back == {{"loosened": "tightened", "tightened": "loosened"}.get(kind, kind)}


def test_what_is_no_python_states_no_bound_and_none_is_run(tmp_path):
    marker = tmp_path / "ran"
    harmful = f"open({str(marker)!r}, 'w')\n{SOURCE}"
    assert bound_moves(SOURCE, harmful) == {} and not marker.exists()
    gone = bound_moves(SOURCE, "def (")
    assert len(gone) == len(BOUNDS) and {move[1] for move in gone.values()} == {"loosened"}
    assert {move[3] for move in gone.values()} == {"no bound"}
