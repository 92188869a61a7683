"""Bounds over clusters: rounded to the unfavourable side, and nothing is no share."""

import numpy as np
import pytest
from asked import settings_of

from gates.bounds import (
    counted_interval,
    draws_for_quantile,
    share_interval,
    upper_quantile,
    widest_gap,
)
from gates.evidence import Evidence, MissingEvidenceError
from gates.feasibility import candidates
from gates.need import modes as modes_needed
from gates.need import simpler
from gates.proof import SPECS
from gates.reproducibility import modes as modes_drawn
from gates.stress import cost, rollouts, safety
from genpolicy.seeds import stream
from genpolicy.statistics.intervals import clopper_pearson, order_statistic_interval


def share(hits, clusters, favourable):
    return share_interval(np.array(hits), clusters, confidence=0.95, favourable=favourable)


def test_the_trials_are_the_clusters_and_not_the_rows():
    hits = [True] * 30 + [False] * 10
    found = share(hits, list("aabb" * 10), favourable=True)
    assert found == (0.75, *clopper_pearson(1, 2, 0.95))
    alone = share(hits, [str(n) for n in range(40)], favourable=True)
    assert alone == (0.75, *clopper_pearson(30, 40, 0.95))


def test_a_count_between_two_is_rounded_to_the_unfavourable_side():
    hits, clusters = [True, True, False, False], ["a", "a", "b", "c"]
    assert share(hits, clusters, favourable=True)[1:] == clopper_pearson(1, 3, 0.95)
    assert share(hits, clusters, favourable=False)[1:] == clopper_pearson(2, 3, 0.95)


def test_rounding_noise_does_not_cost_a_trial():
    # 0.1 + 0.2 in floating point is a little more than 0.3.
    hits = [0.1 + 0.2] * 10
    clusters = [str(n) for n in range(10)]
    for favourable in (True, False):
        assert share(hits, clusters, favourable)[1:] == clopper_pearson(3, 10, 0.95)


@pytest.mark.parametrize(("hits", "trials"), [(0, 0), (3, 2), (-1, 2), (float("nan"), 2)])
def test_counts_that_cannot_be_are_missing_evidence(hits, trials):
    with pytest.raises(MissingEvidenceError, match="is no share"):
        counted_interval(hits, trials, confidence=0.95)


@pytest.mark.parametrize(("hits", "trials"), [(0, 5), (5, 5), (1, 1), (0, 1)])
def test_none_and_all_of_the_trials_are_shares(hits, trials):
    assert counted_interval(hits, trials, confidence=0.9) == clopper_pearson(hits, trials, 0.9)


def test_no_rows_are_missing_evidence():
    with pytest.raises(MissingEvidenceError):
        share([], [], favourable=True)
    with pytest.raises(MissingEvidenceError):
        p95(np.zeros(0), [])


def p95(values, clusters):
    return upper_quantile(values, clusters, 0.95, confidence=0.95, rng=stream(1, "bounds"))


def test_a_quantile_is_a_value_that_occurred_inside_its_interval():
    values = np.arange(1000.0)
    point, interval = p95(values, np.arange(1000))
    assert point in values and interval[0] < point < interval[1]
    assert interval == order_statistic_interval(values, 0.95, 0.95)


def test_a_quantile_that_the_sample_cannot_bound_is_missing_evidence_and_never_the_point():
    fewest = draws_for_quantile(0.95, 0.95)
    assert fewest == 72 and 0.95**72 <= 0.025 < 0.95**71
    assert p95(np.arange(float(fewest)), np.arange(fewest))[1][1] == fewest - 1
    with pytest.raises(MissingEvidenceError, match=r"bound no 95% quantile .* 72 draws"):
        p95(np.arange(fewest - 1.0), np.arange(fewest - 1))


def test_copies_of_a_few_draws_bound_no_quantile():
    with pytest.raises(MissingEvidenceError, match="of 10 independent draws"):
        p95(np.arange(1000.0), np.repeat(np.arange(10), 100))


def test_the_widest_gap_by_hand():
    """Shares 1 of 30 and .5 of 30: ends from Clopper and Pearson, squared and added."""
    clusters = [str(i) for i in range(30)]
    shares = {"a": (np.ones(30), clusters), "b": (np.repeat([1.0, 0.0], 15), clusters)}
    (lower, upper), more, less = widest_gap(shares, confidence=0.95)
    a, b = clopper_pearson(30, 30), clopper_pearson(15, 30)
    assert (more, less) == ("a", "b")
    assert upper == pytest.approx(0.5 + (0.5 - b[0]))
    assert lower == pytest.approx(0.5 - np.hypot(1 - a[0], b[1] - 0.5))


def test_both_ends_of_a_gap_are_rounded_against_it():
    """Half of three clusters are one to two of them: one below, two above."""
    halves = (np.array([True, True, False, False]), ["a", "a", "b", "c"])
    none = (np.zeros(30), [str(i) for i in range(30)])
    (lower, upper), more, less = widest_gap({"a": halves, "b": none}, confidence=0.95)
    below, above = clopper_pearson(1, 3)[0], clopper_pearson(2, 3)[1]
    assert (more, less) == ("a", "b")
    assert upper == pytest.approx(0.5 + (above - 0.5))
    end = clopper_pearson(0, 30)[1]
    assert lower == pytest.approx(max(0.0, 0.5 - np.hypot(0.5 - below, end)))


def test_the_interval_of_a_count_and_the_level_of_a_share_are_those_asked_for():
    with pytest.raises(MissingEvidenceError, match=r"^3 of 2 is no share$"):
        counted_interval(3, 2, confidence=0.9)
    assert counted_interval(1.0, 3.0, confidence=0.5) == clopper_pearson(1, 3, 0.5)
    for quantile, confidence, fewest in ((0.5, 0.5, 2), (0.9, 0.8, 22), (0.5, 0.75, 3)):
        assert draws_for_quantile(quantile, confidence) == fewest
        half = (1.0 - confidence) / 2.0
        assert quantile**fewest <= half < quantile ** (fewest - 1)


def test_equal_shares_may_still_differ_and_the_widest_of_three_is_told():
    clusters = [str(i) for i in range(40)]
    same = {name: (np.ones(40), clusters) for name in "ab"}
    (lower, upper), _, _ = widest_gap(same, confidence=0.95)
    assert lower == 0.0 and 0.05 < upper < 0.15
    third = {**same, "c": (np.repeat([1.0, 0.0], [10, 30]), clusters)}
    assert widest_gap(third, confidence=0.95)[2] == "c"


def test_the_gap_covers_the_true_difference():
    """Four samples each of 60 observations, alike in an observation: .8 against .65."""
    generator = np.random.default_rng(1)
    clusters = [str(i) for i in range(60) for _ in range(4)]
    covered = 0
    for _ in range(400):
        shares = {}
        for name, mean in (("a", 0.8), ("b", 0.65)):
            own = generator.beta(4 * mean, 4 * (1 - mean), 60)
            shares[name] = (generator.random((60, 4)) < own[:, None]).ravel(), clusters
        (lower, upper), _, _ = widest_gap(shares, confidence=0.95)
        covered += lower <= 0.15 <= upper
    assert covered / 400 >= 0.95


ASKING = (modes_needed, simpler, modes_drawn, candidates, rollouts, cost, safety)
BOTH_SIDES = {"recovery_success_lower"}  # a condition that is shown to fail counts by its best end


@pytest.mark.parametrize("gate", "ABCD")
def test_every_criterion_rounds_its_counts_against_whom_it_judges(gate, repo, monkeypatch):
    """And takes an interval of the confidence of the settings, or a wider one."""
    settings, asked = settings_of(repo, gate), []

    def noted(hits, clusters, *, confidence, favourable):
        asked.append((confidence, favourable))
        return share_interval(hits, clusters, confidence=confidence, favourable=favourable)

    for module in ASKING:
        monkeypatch.setattr(module, "share_interval", noted)
    met = set()
    for item in SPECS[gate].criteria:
        if item.id == "conformance":
            continue  # of who was brought, and nobody is; it names findings and counts nothing
        asked.clear()
        item.measure(Evidence(repo), settings, *(["flow"] if item.per_candidate else []))
        assert all(confidence >= settings.confidence for confidence, _ in asked), item.id
        sides = {favourable for _, favourable in asked}
        met |= {item.id} if asked else set()
        assert sides <= ({True, False} if item.id in BOTH_SIDES else {item.comparison == ">="})
    assert len(met) == {"A": 4, "B": 2, "C": 1, "D": 5}[gate], met
