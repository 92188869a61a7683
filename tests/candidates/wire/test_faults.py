import pickle

import pytest

from genpolicy.candidates.wire.faults import Fault, PolicyError


@pytest.mark.parametrize("fault", Fault)
def test_a_fault_keeps_kind_and_words_across_processes(fault):
    error = pickle.loads(pickle.dumps(PolicyError(fault, "no answer")))
    assert (error.fault, error.found, error.exit_code) == (fault, "no answer", 2)
    assert error.seen == f"the policy's process is at fault ({fault}): no answer"
    assert str(error) == f"{error.seen}, expected {error.expected}. {error.action}"
    assert error.expected and error.action.endswith(".")
    told = pickle.loads(pickle.dumps(PolicyError(fault, "0", "one or more", "Write one.")))
    assert str(told) == f"{told.seen}, expected one or more. Write one."
