"""Each clause of a row, left out alone, is noticed by its mutant; also where code has lost it."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gates.asked_for import CLAUSES_ASKED_FOR
from genpolicy.evidence.shadow import clause_mutants, mutants
from genpolicy.evidence.shadow.clause_mutants import clause_mutant, lacking
from genpolicy.evidence.shadow.clause_scenarios import TRIALS
from genpolicy.evidence.shadow.clauses import CLAUSES, VOIDED_BY
from genpolicy.evidence.shadow.continuity_mutants import CLAUSES as OF_CONTINUITY
from genpolicy.evidence.shadow.continuity_mutants import ROW
from genpolicy.evidence.shadow.place_mutants import UNTOLD
from genpolicy.evidence.shadow.places import PLACES
from genpolicy.evidence.shadow.rig import Rig, passing_verdict
from genpolicy.evidence.shadow.voiding import EVENTS
from genpolicy.execution.checks import CHECKS, Place
from genpolicy.execution.observed import FARTHEST_M, distance_of
from genpolicy.execution.stub import _is_row
from genpolicy.verification.report import CheckReport

FOUND_BY_WHAT_IS_UNTOLD = {
    "stale_observation:first_use", "expired:first_use", "late_chunk:first_use",
    "behind_accepted:condition", "behind_queued:start", "superseded:due",
}  # fmt: skip
"""Nothing goes through without them: others refuse later, or the rows are lost in another way."""

EQUIVALENT = {
    "future_observation:now": "an observation from the future is not used and the believed time"
    " never goes back, so that the newest one is never ahead of now",
    "execution_horizon:rows": "of a row that the chunk does not have no action could be the same"
    " (`same_action`), and it was not checked (`checked_rows`)",
    "divergence:no_number": "what is said and is no distance is read as the largest that there is"
    " before the row is asked",
}
"""Clauses that no input can show, each with its reason; a test asks the reason of random events."""


def row_of(name):
    return name.partition(":")[0]


def test_every_clause_has_a_scenario_and_every_mutant_is_detected():
    rows = clause_mutants.clause_mutants()
    assert [row.check for row in rows] == list(CLAUSES)
    assert set(TRIALS) == set(CLAUSES) and {row_of(name) for name in CLAUSES} <= set(PLACES)
    assert [row.check for row in rows if not row.detected] == []
    assert all(not row.violations_unchanged for row in rows)
    assert {row.check for row in rows if row.rules == [UNTOLD]} == FOUND_BY_WHAT_IS_UNTOLD
    assert all(UNTOLD not in row.rules for row in rows if row.rules != [UNTOLD])


def test_the_gate_asks_for_every_clause_by_name():
    asked = [f"{row}:{clause}" for row, clauses in CLAUSES_ASKED_FOR.items() for clause in clauses]
    assert asked == [*CLAUSES, *(f"{ROW}:{name}" for name in OF_CONTINUITY)]


def test_every_row_of_what_an_event_voids_asks_when_it_was_seen_and_measured_and_what_was_here():
    assert {row: PLACES[row].reason for row in PLACES if row.startswith("after_")} == VOIDED_BY
    assert set(EVENTS) == set(VOIDED_BY)
    assert {f"{row}:{part}" for row in VOIDED_BY for part in ("seen", "measured", "was_here")} == {
        name for name in CLAUSES if name.startswith("after_")
    }


@pytest.mark.parametrize("name", CLAUSES)
def test_code_that_has_lost_a_clause_is_noticed_by_its_mutant(name):
    """The arrivals of all eight events, and thirty more, could be left out with all gates green."""
    row = clause_mutant(lacking(CHECKS, name), name)
    assert not row.detected and row.violations_unchanged


@pytest.mark.parametrize("name", CLAUSES)
def test_a_blind_checker_is_found_by_every_clause_that_lets_something_through(name, monkeypatch):
    monkeypatch.setattr(mutants, "check_journal", lambda path: CheckReport())
    assert clause_mutant(CHECKS, name).detected == (name in FOUND_BY_WHAT_IS_UNTOLD)


# -- what no input can show -----------------------------------------------------------------------


def test_the_page_shows_what_no_input_can_show_with_its_reason(request):
    page = " ".join((request.config.rootpath / "docs" / "gate-c.md").read_text().split())
    for name, reason in EQUIVALENT.items():
        assert f"| `{name}` | {reason} |" in page
        assert row_of(name) in PLACES and name not in CLAUSES


TIMES_S = st.one_of(st.floats(-10, 100), st.sampled_from([float("nan"), 1e12, -1e12]))


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(TIMES_S, TIMES_S), max_size=20))
def test_no_observation_that_is_used_lies_ahead_of_the_believed_time(readings):
    """`future_observation:now`, of executor and stub, whatever clock and stamps say."""
    rig = Rig()
    for now_s, event_s in readings:
        rig.executor.observe(now_s, event_s, "approach", "epoch-1")
        for view in (rig.executor._view, rig.stub._view):
            newest_ns = view.newest_observation_ns
            assert newest_ns is None or newest_ns <= rig.journal.latest_ns


@given(st.integers(-40, 40), st.integers(1, 16))
def test_a_row_that_the_chunk_does_not_have_is_no_row_and_was_not_checked(row, rows):
    """`execution_horizon:rows`: two others refuse it, whatever action is offered for it."""
    if 0 <= row < rows:
        return
    rig = Rig()
    chunk = rig.chunk(actions=Rig.actions(1, rows), verdict=passing_verdict(rows=(0, rows)))
    assert not any(_is_row(chunk, action, row) for action in chunk.actions)
    first, last = chunk.verdict.rows
    assert not first <= row < last


@pytest.mark.parametrize("said", [float("nan"), float("inf"), -1.0, "near", 10**400, object()])
def test_what_is_no_distance_is_the_largest_there_is(said):
    """`divergence:no_number`: the row is never asked about it."""
    assert distance_of(said) == FARTHEST_M


def test_places_of_rows_with_clauses_are_asked_of_chunks():
    assert all(set(PLACES[row_of(name)].places) - {Place.LAYER} for name in (*CLAUSES, *EQUIVALENT))
