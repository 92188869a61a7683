"""Type I error, power, effect size and invariance of the conditional test."""

import numpy as np
import pytest

from genpolicy.errors import ContractError
from genpolicy.seeds import stream
from genpolicy.statistics.conditional import conditional_test


def test_type_one_error():
    rng = stream(8, "null")
    blocks = np.repeat(np.arange(6), 16)
    wrong = 0
    for _ in range(300):
        # Both depend on the block, not on each other: an unconditional test would be fooled.
        labels = (rng.random(96) < 0.2 + 0.1 * blocks).astype(int)
        strata = (rng.random(96) < 0.8 - 0.1 * blocks).astype(int)
        wrong += conditional_test(labels, strata, blocks, rng=rng, permutations=99).p_value <= 0.05
    assert wrong / 300 <= 0.05 + 3 * np.sqrt(0.05 * 0.95 / 300)


def test_a_stratum_that_decides_explains_everything():
    rng = stream(9, "decides")
    blocks = np.repeat(np.arange(5), 12)
    strata = rng.integers(0, 3, 60)
    test = conditional_test(strata > 0, strata, blocks, rng=rng)
    assert test.p_value == pytest.approx(1 / 1000)
    assert test.effect == pytest.approx(1.0)
    assert test.effect_lower > 0.9


def test_an_unrelated_stratum_of_many_values_has_no_effect():
    rng = stream(10, "many")
    blocks = np.repeat(np.arange(6), 20)
    effects = [
        conditional_test(
            rng.integers(0, 2, 120),
            rng.integers(0, 6, 120),
            blocks,
            rng=rng,
            permutations=99,
        ).effect
        for _ in range(40)
    ]
    assert np.mean(effects) < 0.05  # the raw share would be about 0.2


def test_partial_effect_and_interval():
    rng = stream(11, "partial")
    blocks = np.repeat(np.arange(10), 20)
    labels = rng.integers(0, 2, 200)
    strata = np.where(rng.random(200) < 0.9, labels, 1 - labels)
    test = conditional_test(labels, strata, blocks, rng=rng)
    assert 0.3 < test.effect < 0.75  # 1 - H(.1)/H(.5) = .53
    assert test.effect_lower < 0.53 < test.effect_upper


def test_names_of_values_do_not_matter():
    labels, strata, blocks = (
        np.array([0, 1] * 20),
        np.array([1, 0, 0, 1] * 10),
        np.repeat([0, 1], 20),
    )
    first = conditional_test(labels, strata, blocks, rng=stream(1, "x"))
    second = conditional_test(
        labels.astype(str), np.array(["a", "b"])[strata], blocks, rng=stream(1, "x")
    )
    assert first == second


def test_nothing_to_tell_is_not_evidence():
    empty = conditional_test(np.zeros(9), np.arange(9), np.zeros(9), rng=stream(1, "y"))
    assert (empty.p_value, empty.effect, empty.n) == (1.0, 0.0, 0)
    with pytest.raises(ContractError):
        conditional_test(np.zeros(2), np.zeros(3), np.zeros(2), rng=stream(1, "z"))


def test_the_interval_covers():
    rng = stream(12, "coverage")
    blocks = np.repeat(np.arange(8), 15)
    hits = 0
    for _ in range(200):
        labels = rng.integers(0, 2, 120)
        strata = np.where(rng.random(120) < 0.85, labels, 1 - labels)
        test = conditional_test(labels, strata, blocks, rng=rng, permutations=99)
        hits += test.effect_lower <= 0.390 <= test.effect_upper  # 1 - H(.15)/H(.5)
    assert hits / 200 >= 0.85
