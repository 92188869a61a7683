"""Latency on the virtual clock: matched draws, measured and declared terms, cold starts."""

import numpy as np
import pytest

from genpolicy.errors import ContractError
from genpolicy.evidence.stress.latency import (
    DECLARED_TERMS,
    MEASURED_TERMS,
    DeclaredTerm,
    LatencyModel,
    draw_check,
    draw_latency,
    empirical_quantile,
)
from genpolicy.seeds import stream

SHARED = ("preprocess", "encode", "select", "project")


def model(*, sample_s=0.01, cold_extra_s=0.5, without=()):
    declared = {name: DeclaredTerm(0.001, 0.003) for name in DECLARED_TERMS if name not in without}
    measured = {
        name: np.sort(stream(3, name).uniform(0.001, 0.002, 50))
        for name in MEASURED_TERMS
        if name not in without
    }
    if "sample" in measured:
        measured["sample"] = measured["sample"] + sample_s
    return LatencyModel(declared, measured, cold_extra_s)


def draw(of, *, invocation=1, **changes):
    keys = {
        "root_seed": 5, "perturbation": "nominal", "start": 2, "extra_s": {}, "compute_factor": 1.0,
    }  # fmt: skip
    return draw_latency(of, invocation=invocation, **(keys | changes))


@pytest.mark.parametrize("term", [*DECLARED_TERMS, *MEASURED_TERMS])
def test_a_missing_term_is_refused_by_name(term):
    with pytest.raises(ContractError, match=rf"\['{term}'\].*unknown, never zero"):
        model(without=(term,))


def test_equal_terms_give_equal_draws_whatever_the_method():
    fast, slow = draw(model(sample_s=0.001)), draw(model(sample_s=0.1))
    for name in (*DECLARED_TERMS, *SHARED):
        assert fast.terms[name] == slow.terms[name]
    # The differing term is at the same quantile of its own distribution.
    assert slow.terms["sample"] - fast.terms["sample"] == pytest.approx(0.099, abs=1e-12)
    assert fast.total_s == pytest.approx(sum(fast.terms.values()))
    assert set(fast.terms) == {*DECLARED_TERMS, *MEASURED_TERMS}


@pytest.mark.parametrize(
    "change", [{"start": 3}, {"invocation": 2}, {"root_seed": 6}, {"perturbation": "push"}]
)
def test_every_part_of_the_key_counts(change):
    assert draw(model()).terms == draw(model()).terms
    assert draw(model(), **change).terms != draw(model()).terms


def test_terms_are_drawn_apart():
    drawn = [draw(model(), invocation=number).terms for number in range(1, 200)]
    table = np.array([[row["exposure"], row["capture"], row["encode"]] for row in drawn])
    # Of 199 pairs, |r| stays below 0.23 with probability 0.999 if they are independent.
    assert np.abs(np.corrcoef(table.T) - np.eye(3)).max() < 0.23


def test_contention_slows_measured_terms_only():
    plain, slowed = draw(model()), draw(model(), compute_factor=4.0)
    for name in DECLARED_TERMS:
        assert slowed.terms[name] == plain.terms[name]
    for name in MEASURED_TERMS:
        assert slowed.terms[name] == pytest.approx(4 * plain.terms[name])


def test_the_cold_start_is_paid_once():
    warm = model(cold_extra_s=0.0)
    first = draw(model(), invocation=0).total_s - draw(warm, invocation=0).total_s
    assert first == pytest.approx(0.5)
    for number in (1, 2, 17):
        assert draw(model(), invocation=number).terms == draw(warm, invocation=number).terms


def test_a_perturbation_adds_to_its_term_only():
    plain, late = draw(model()), draw(model(), extra_s={"network": 0.07})
    changed = {n for n in plain.terms if plain.terms[n] != late.terms[n]}
    assert changed == {"network"}
    assert late.total_s - plain.total_s == pytest.approx(0.07)


def test_declared_terms_stay_within_their_bounds():
    values = [draw(model(), invocation=n).terms["queue"] for n in range(1, 100)]
    assert min(values) >= 0.001 and max(values) < 0.003


def test_quantiles_are_order_statistics_and_never_interpolated():
    values = np.array([0.1, 0.2, 0.4, 0.8])
    # By hand: the level's place is floor(4 * level), at most 3.
    golden = {0.0: 0.1, 0.2499: 0.1, 0.25: 0.2, 0.5: 0.4, 0.75: 0.8, 0.9999999: 0.8, 1.0: 0.8}
    for level, value in golden.items():
        assert empirical_quantile(values, level) == value
    seen = {draw(model(), invocation=n).terms["encode"] for n in range(1, 40)}
    assert seen <= set(model().measured["encode"])


def check(of, *, candidate=1, **changes):
    keys = {
        "root_seed": 5, "perturbation": "nominal", "start": 2, "invocation": 1,
        "compute_factor": 1.0,
    }  # fmt: skip
    return draw_check(of, candidate=candidate, **(keys | changes))


def test_another_check_is_a_draw_of_its_own_from_the_term_project():
    drawn = [check(model(), candidate=number) for number in range(1, 60)]
    assert set(drawn) <= set(model().measured["project"]) and len(set(drawn)) > 20
    first = draw(model()).terms["project"]
    assert [check(model(), candidate=c) for c in (1, 2)] != [first, first]
    # The same for every method whose checks take as long, whatever its network takes.
    assert check(model(sample_s=0.001)) == check(model(sample_s=0.1))


def test_contention_slows_every_check():
    for candidate in (1, 2, 3):
        slow = check(model(), candidate=candidate, compute_factor=2.5)
        assert slow == pytest.approx(2.5 * check(model(), candidate=candidate))


@pytest.mark.parametrize(
    "change", [{"start": 3}, {"invocation": 2}, {"root_seed": 6}, {"perturbation": "push"}]
)
def test_every_part_of_a_check_s_key_counts(change):
    def several(**changes):
        return [check(model(), candidate=number, **changes) for number in range(1, 6)]

    assert several() == several() != several(**change)
