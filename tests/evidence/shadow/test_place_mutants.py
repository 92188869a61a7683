"""Each place of a row, taken away alone, is noticed by its own mutant and by no other."""

import pytest

from genpolicy.contract.chunk import DiscardReason
from genpolicy.evidence.shadow import mutants, place_mutants
from genpolicy.evidence.shadow.place_mutants import TRIALS, UNTOLD, alone_at, pairs
from genpolicy.evidence.shadow.places import PLACES
from genpolicy.execution.checks import CHECKS, Place
from genpolicy.verification.report import CheckReport

PAIRS = list(pairs())


def of_row(name, table=CHECKS):
    """What the mutants of one row say of a table, by place."""
    known = {}
    return {
        place: place_mutants._mutant(table, row, place, known)
        for row, place in PAIRS
        if row == name
    }


def changed(name, **changes):
    return tuple(row._replace(**changes) if row.name == name else row for row in CHECKS)


def test_every_place_is_needed_and_enough_by_itself():
    rows = place_mutants.place_mutants()
    assert [row.check for row in rows] == [f"{name}@{place}" for name, place in PAIRS]
    assert len(set(PAIRS)) == len(PAIRS) == 102 and set(TRIALS) <= set(PAIRS)
    assert [row.check for row in rows if not row.detected] == []
    assert all(row.violations and not row.violations_unchanged for row in rows)
    assert all(UNTOLD not in row.rules for row in rows)  # the checker finds what goes through


@pytest.mark.parametrize(("name", "place"), PAIRS)
def test_a_place_that_the_table_lacks_is_noticed_by_its_own_mutant_alone(name, place):
    """As in code that has lost it: with `STUB` taken out of 33 rows of 34 all gates passed."""
    places = frozenset(PLACES[name].places) - {place}
    found = of_row(name, changed(name, places=places))
    assert [p for p, row in found.items() if not row.detected] == [place]


@pytest.mark.parametrize("name", [name for name, asked in PLACES.items() if asked.reason])
def test_another_reason_is_noticed_wherever_the_journal_says_one(name):
    other = next(reason for reason in DiscardReason if reason != PLACES[name].reason)
    for place, row in of_row(name, changed(name, reason=other)).items():
        assert row.detected == (place not in place_mutants.TOLD)


def test_a_place_is_taken_and_never_given():
    (row,) = (row for row in alone_at(CHECKS, "early", Place.ARRIVAL) if row.name == "early")
    assert row.places == frozenset()
    assert alone_at(CHECKS, "sequence", Place.STUB) == CHECKS


def test_a_blind_checker_turns_the_evidence_red(monkeypatch):
    monkeypatch.setattr(mutants, "check_journal", lambda path: CheckReport())
    assert not any(row.detected for row in place_mutants.place_mutants())


def test_a_queue_that_asks_nothing_of_what_waits_is_noticed_at_that_place(monkeypatch):
    honest = place_mutants.Rig

    def forgetful(**settings):
        rig = honest(**settings)
        monkeypatch.setattr(rig.executor._queue, "sweep", lambda *_: None)
        return rig

    monkeypatch.setattr(place_mutants, "Rig", forgetful)
    found = of_row("expired")
    assert not found[Place.QUEUE].detected and found[Place.ARRIVAL].detected
