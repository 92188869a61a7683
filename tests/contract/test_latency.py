"""Eleven terms of latency: each with an owner, and either measured here or declared."""

from genpolicy.contract.latency import DECLARED_TERMS, MEASURED_TERMS, OWNERS, Owner, Term


def test_every_term_has_one_owner_and_every_owner_a_term():
    assert len(Term) == 11
    assert set(OWNERS) == set(Term)
    assert set(OWNERS.values()) == set(Owner)


def test_a_term_is_measured_or_declared_and_never_both():
    assert sorted([*MEASURED_TERMS, *DECLARED_TERMS]) == sorted(Term)
    assert {OWNERS[term] for term in MEASURED_TERMS} == {Owner.MODEL, Owner.SAFETY}
