"""Eleven terms of latency: each with an owner, a missing one unknown and never zero."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from genpolicy.contract.latency import COMPUTE_TERMS, OWNERS, LatencySpans, Owner, Term
from genpolicy.errors import ContractError

seconds = st.floats(0, 10)


def test_every_term_has_one_owner_and_every_owner_a_term():
    assert len(Term) == 11
    assert set(OWNERS) == set(Term)
    assert set(OWNERS.values()) == set(Owner)
    assert set(COMPUTE_TERMS) < set(Term)


@given(st.dictionaries(st.sampled_from(list(Term)), seconds))
def test_the_total_is_known_only_when_every_term_is(known):
    spans = LatencySpans(known)
    assert set(spans.missing) == set(Term) - set(known)
    assert (spans.total_s is None) == bool(spans.missing)


@given(st.lists(seconds, min_size=11, max_size=11))
def test_the_total_is_the_sum_in_any_order(values):
    forth = LatencySpans(dict(zip(Term, values, strict=True))).total_s
    back = LatencySpans(dict(zip(Term, reversed(values), strict=True))).total_s
    assert forth == back
    assert forth == pytest.approx(sum(values))


def test_ten_tenths_and_a_zero_are_exactly_one():
    """Golden: the sum is correctly rounded; ten naive additions of 0.1 end below 1."""
    values = dict.fromkeys(Term, 0.1) | {Term.QUEUE: 0.0}
    assert LatencySpans(values).total_s == 1.0


@pytest.mark.parametrize("value", [-1e-9, float("nan"), float("inf")])
def test_a_span_that_is_no_duration_is_refused(value):
    with pytest.raises(ContractError, match=r"latency span sample is .*clock behind a negative"):
        LatencySpans({Term.SAMPLE: value})


def test_spans_do_not_change_with_their_source():
    source = {Term.SAMPLE: 0.1}
    spans = LatencySpans(source)
    source[Term.SAMPLE] = 9.0
    assert spans.seconds[Term.SAMPLE] == 0.1
