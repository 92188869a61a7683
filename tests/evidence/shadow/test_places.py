"""The written list of places is the table's, and the gate's; neither is made of the other."""

import pytest

from gates.asked_for import CHECKS_ASKED_FOR, PLACES_ASKED_FOR
from genpolicy.evidence.shadow.places import ELSEWHERE, PLACES, TOLD, both_ask
from genpolicy.execution.checks import CHECKS, Place


def test_every_row_and_every_place_of_the_table_is_written_down_and_none_more():
    """A row or a place that is added to the table must be added to the list, with its reason."""
    table = {check.name: (check.reason, check.places) for check in CHECKS}
    assert {n: (asked.reason, frozenset(asked.places)) for n, asked in PLACES.items()} == table
    assert list(PLACES) == [check.name for check in CHECKS]
    assert all(len(set(asked.places)) == len(asked.places) for asked in PLACES.values())


def test_the_gate_asks_for_every_place_by_name_also_for_those_that_are_tried_elsewhere():
    asked = {n: tuple(p for p in a.places if p not in ELSEWHERE) for n, a in PLACES.items()}
    assert asked == PLACES_ASKED_FOR
    elsewhere = [(n, p) for n, a in PLACES.items() for p in a.places if p in ELSEWHERE]
    assert len(elsewhere) == 9
    assert {f"{ELSEWHERE[place]}.{name}" for name, place in elsewhere} <= set(CHECKS_ASKED_FOR)


def test_a_journal_tells_of_places_that_discard_a_chunk_or_refuse_an_action():
    """Of the others it tells nothing: they take rows away, or the answer is to hold."""
    assert set(Place) - set(TOLD) == {
        Place.OBSERVED, Place.ROWS, Place.PAST, Place.DUE, Place.LAYER, Place.SUPERVISOR,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("name", "both"),
    [("expired", True), ("early", True), ("divergence", True), ("sequence", False),
     ("superseded", False), ("behind_accepted", False), ("watchdog", False), ("issued", True)],
)  # fmt: skip
def test_both_look_at_what_executor_and_stub_are_each_told(name, both):
    assert both_ask(name) == both
