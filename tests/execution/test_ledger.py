"""Every chunk and every action ends exactly once."""

from genpolicy.execution.ledger import Account, Conservation


def test_an_error_of_either_balance_is_an_error():
    closed = Account(3, 1, {"expired": 1}, 1)
    lost, double = Account(3, 1, {}, 1), Account(3, 2, {"expired": 1}, 1)
    assert (closed.error, lost.error, double.error) == (0, 1, -1)
    assert Conservation(lost, double, {}).error == 2
    assert Conservation(closed, closed, {}).error == 0
