"""Conservation, derived again by the checker: every way in which the books do not close."""

import pytest

from genpolicy.verification.balance import Balance


def book():
    """A chunk of 4 actions arrived; one of them was accepted."""
    balance = Balance()
    assert list(balance.arrived(0, 4)) == []
    balance.executed(0)
    return balance


def totals(balance, **changes):
    found = {
        "chunks": {"generated": 2, "executed": 1, "queued": 0, "discarded": {"expired": 1}},
        "actions": {"generated": 7, "executed": 1, "queued": 0,
                    "discarded": {"late": 3, "expired": 3, "reset": 0}},
        "events": 9,
    }  # fmt: skip
    return list(balance.check_end({**found, **changes}, 9))


def ended():
    balance = book()
    assert list(balance.closed(0, {"executed": 1, "late": 3}, "executed", None)) == []
    assert list(balance.refused(1, {"executed": 0, "expired": 3}, "expired")) == []
    return balance


def test_closed_books_have_nothing_to_say():
    balance = ended()
    assert totals(balance) == []
    assert balance.rows == {} and balance.lost_actions == {"late": 3, "expired": 3}


@pytest.mark.parametrize(
    ("rows", "end", "reason", "said"),
    [
        ({"executed": 1, "late": 2}, "executed", None, "had 4 actions"),
        ({"executed": 1, "late": 5, "expired": -2}, "executed", None, "had 4 actions"),
        ({"executed": 2, "late": 2}, "executed", None, "1 accepted, 2 noted"),
        ({"executed": 1, "late": 3}, "discarded", "expired", "ended as discarded"),
        ({"executed": 1, "tired": 3}, "executed", None, "no known reason"),
    ],
)
def test_an_end_that_does_not_add_up_is_said(rows, end, reason, said):
    assert any(said in sentence for sentence in book().closed(0, rows, end, reason))


def test_a_chunk_may_not_be_discarded_for_a_reason_that_is_none():
    said = list(Balance().refused(0, {"executed": 0, "late": 2}, "boredom"))
    assert len(said) == 1 and "boredom" in said[0]


def test_arrivals_are_numbered_without_a_gap():
    assert "Arrival 2 is number 1" in next(book().arrived(2, 4))


@pytest.mark.parametrize(
    "changes",
    [
        {"chunks": {"generated": 2, "executed": 2, "queued": 0, "discarded": {}}},
        {"actions": {"generated": 7, "executed": 1, "queued": 1,
                     "discarded": {"late": 3, "expired": 3}}},
        {"events": 8},
    ],
)  # fmt: skip
def test_claimed_totals_are_compared_with_those_counted(changes):
    assert len(totals(ended(), **changes)) == 1


def test_what_is_still_queued_is_counted_by_what_was_not_accepted():
    balance = book()
    claimed = {
        "chunks": {"generated": 1, "executed": 0, "queued": 1, "discarded": {}},
        "actions": {"generated": 4, "executed": 1, "queued": 3, "discarded": {}},
        "events": 2,
    }
    assert list(balance.check_end(claimed, 2)) == []


@pytest.mark.parametrize("reason", ["", "mislaid"])
def test_the_rest_of_a_chunk_that_was_executed_is_lost_for_a_known_reason_too(reason):
    rows = {"executed": 1, "stopped": 3}
    assert list(book().closed(0, rows, "executed", "stopped")) == []
    assert len(list(book().closed(0, rows, "executed", reason))) == 1
