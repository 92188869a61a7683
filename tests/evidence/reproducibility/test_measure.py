"""A call in a process of its own."""

import os

from genpolicy.evidence.reproducibility.measure import in_fresh_process


def test_a_fresh_process_is_another_one():
    assert in_fresh_process(os.getpid) != os.getpid()
