"""Errors: one sentence with place, finding, rule and remedy; fields survive a process boundary."""

import pickle

import pytest

from genpolicy.errors import (
    BadInputError,
    ConfigError,
    ContractError,
    GenpolicyError,
    IntegrityError,
    NonFiniteError,
    RefusedError,
)

FIELDS = {"where": "q[2]", "found": "nan", "expected": "a number", "action": "Hold."}
REFUSED = {
    "gate": "C", "criterion": "stub_stale", "measured": "3", "limit": "<= 0",
    "report": "reports/gate_c.json", "action": "Repair the executor.",
}  # fmt: skip


@pytest.mark.parametrize(
    "kind", [BadInputError, ConfigError, ContractError, NonFiniteError, IntegrityError]
)
def test_bad_input(kind):
    error = kind(**FIELDS)
    assert str(error) == "q[2] is nan, expected a number. Hold."
    assert error.exit_code == 2
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is kind
    assert {name: getattr(again, name) for name in FIELDS} == FIELDS


def test_refused():
    error = RefusedError(**REFUSED)
    assert error.exit_code == 3
    assert "Gate C refuses: stub_stale is 3, required <= 0; see reports/gate_c.json." in str(error)
    again = pickle.loads(pickle.dumps(error))
    assert {name: getattr(again, name) for name in REFUSED} == REFUSED


def test_tree():
    assert GenpolicyError.exit_code == 1
    assert issubclass(NonFiniteError, ContractError)
    assert not issubclass(RefusedError, BadInputError)
