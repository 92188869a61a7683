"""Eleven terms, each measured or declared, each with one owner."""

from genpolicy.contract.latency import DECLARED_TERMS, MEASURED_TERMS, OWNERS, Owner, Term


def test_eleven_terms_each_with_an_owner() -> None:
    assert len(Term) == 11
    assert set(OWNERS) == set(Term)
    assert set(OWNERS.values()) == set(Owner)


def test_a_term_is_either_measured_or_declared() -> None:
    assert set(MEASURED_TERMS) | set(DECLARED_TERMS) == set(Term)
    assert not set(MEASURED_TERMS) & set(DECLARED_TERMS)


def test_the_safety_owner_answers_for_what_projects_and_checks() -> None:
    assert [term for term, owner in OWNERS.items() if owner is Owner.SAFETY] == [Term.PROJECT]
