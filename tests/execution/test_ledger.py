"""Every chunk and every action ends exactly once."""

from genpolicy.execution.ledger import Account, Conservation, Ledger


def test_an_error_of_either_balance_is_an_error():
    closed = Account(3, 1, {"expired": 1}, 1)
    lost, double = Account(3, 1, {}, 1), Account(3, 2, {"expired": 1}, 1)
    assert (closed.error, lost.error, double.error) == (0, 1, -1)
    assert Conservation(lost, double, {}).error == 2
    assert Conservation(closed, closed, {}).error == 0


def test_a_ledger_begins_empty_and_balances_as_soon_as_something_arrives():
    ledger = Ledger()
    assert ledger.conservation([]) == Conservation(Account(0, 0, {}, 0), Account(0, 0, {}, 0), {})
    assert ledger.arrive(16) == 0
    ledger.refuse(16, "expired")
    whole = ledger.conservation([])
    assert whole.error == 0 and whole.actions == Account(16, 0, {"expired": 16}, 0)
