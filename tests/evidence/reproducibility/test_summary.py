"""Spans, summaries and the benchmark."""

import numpy as np
import pytest

from genpolicy.contract.latency import COMPUTE_TERMS, DECLARED_TERMS, OWNERS, LatencySpans, Term
from genpolicy.errors import ContractError
from genpolicy.evidence.reproducibility.summary import end_to_end, quantile, summarise


def test_eleven_terms_each_with_an_owner():
    assert len(Term) == 11
    assert set(OWNERS) == set(Term)
    assert set(COMPUTE_TERMS) | set(DECLARED_TERMS) == set(Term)


def test_a_missing_term_is_unknown_and_never_zero():
    full = LatencySpans(dict.fromkeys(Term, 0.01))
    assert full.total_s == pytest.approx(0.11)
    partial = LatencySpans({t: 0.01 for t in Term if t is not Term.QUEUE})
    assert partial.missing == (Term.QUEUE,)
    assert partial.total_s is None
    for value in (-1e-9, float("nan"), float("inf")):
        with pytest.raises(ContractError, match="queue"):
            LatencySpans({Term.QUEUE: value})


def test_summary_of_known_numbers():
    summary = summarise([i / 100 for i in range(100, 0, -1)])
    assert (summary.count, summary.max_s) == (100, 1.0)
    assert summary.p50.value_s == 0.50
    assert summary.p95.value_s == 0.95
    # ranks 40 and 61 bound the median of 100: textbook distribution-free interval
    assert (summary.p50.lower_s, summary.p50.upper_s) == (0.40, 0.61)
    assert summarise([0.1, 0.2]).p95.upper_s is None
    for bad in ([], [float("nan")], [-1.0]):
        with pytest.raises(ContractError):
            summarise(bad)


@pytest.mark.parametrize("level", [0.5, 0.95])
@pytest.mark.parametrize("count", [20, 100, 250])
def test_intervals_cover(level, count):
    generator = np.random.default_rng(5)
    covered = 0
    trials = 2000
    for values in generator.random((trials, count)):
        found = quantile(values.tolist(), level)
        low = -np.inf if found.lower_s is None else found.lower_s
        high = np.inf if found.upper_s is None else found.upper_s
        covered += low <= level <= high
    assert covered / trials >= 0.95 - 0.01


def test_sum_of_p95_is_not_p95_of_sums():
    slow_first = [1.0] * 10 + [0.0] * 90
    slow_last = [0.0] * 90 + [1.0] * 10
    both = end_to_end({"encode": slow_first, "sample": slow_last})
    assert both.sum_of_p95_s == 2.0
    assert both.end_to_end_p95_s == 1.0
    with pytest.raises(ContractError):
        end_to_end({"encode": [1.0], "sample": [1.0, 2.0]})
