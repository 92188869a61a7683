"""Questions to the data themselves."""

import pytest

from gates.proof import judge


def _found(report, name):
    return [c for c in report.criteria if c.id == name]


def test_golden_exact_bound_of_label_disagreement(repo):
    """0 of 40: upper end 1 - 0.025^(1/40) = 0.0881, Clopper and Pearson 1934."""
    found = _found(judge(repo, "A"), "label_disagreement")[0]
    assert found.measured == pytest.approx(1 - 0.025 ** (1 / 40), abs=1e-12)
