"""Guesses from what others chose: never from the episode itself, and no skill by size or place."""

import numpy as np
import pytest

from genpolicy.audit.choices import Choices
from genpolicy.audit.guesses import by_best_column, by_nearest, by_one_more, by_value, right
from genpolicy.seeds import stream


def free(seed, n=150, share=0.5):
    rng = stream(seed, "free")
    mode = (rng.random(n) < share).astype(np.int64)
    even = np.tile([1.0 - mode.mean(), mode.mean()], (n, 1))
    return Choices(np.arange(n), mode, even), rng


def test_a_bigger_mode_is_no_skill():
    chosen, rng = free(5, n=400, share=0.9)
    assert chosen.chance == pytest.approx(0.5)
    hits = right(chosen, by_value(np.zeros(400, dtype=np.int64)), rng, repeats=2)
    assert chosen.weight @ hits / chosen.weight.sum() == pytest.approx(0.5, abs=0.02)


def test_what_the_place_decides_is_not_told_by_what_goes_with_the_place():
    # On the left nine of ten pass left, on the right nine of ten right, and each operator works
    # on one side: the operator tells the mode only through the place, which the policy sees.
    rng = stream(7, "place")
    side = np.arange(300) % 2
    mode = np.where(rng.random(300) < 0.9, side, 1 - side)
    own = np.array([[np.mean(mode[side == s] == m) for m in (0, 1)] for s in side])
    guess = by_value(side)
    placed = Choices(np.arange(300), mode, own)
    hits = right(placed, guess, rng, repeats=3)
    assert placed.weight @ hits / placed.weight.sum() <= placed.chance + 0.1
    blind = Choices(placed.episode, mode, np.full((300, 2), 0.5))
    hits = right(blind, guess, rng, repeats=3)
    assert hits.mean() > 0.85


def test_an_episode_is_never_guessed_from_itself():
    # Every episode has a value of its own, and a time of its own: nothing can be learned.
    chosen, rng = free(6)
    own = by_value(np.arange(150))
    assert right(chosen, own, rng, repeats=1) == pytest.approx(0.5)
    nearest = by_nearest(np.arange(150.0), 1)
    assert right(chosen, nearest, rng, repeats=3).mean() == pytest.approx(0.5, abs=0.12)


def test_a_free_choice_rarely_seems_told():
    found = []
    for seed in range(60):
        chosen, rng = free(1000 + seed)
        value = rng.integers(0, 3, 150)
        hits = right(chosen, by_value(value), rng, repeats=2)
        found.append((chosen.weight @ hits / chosen.weight.sum() - 0.5) / 0.5)
    # The standard error is .08: 0.25 lies three of them away.
    assert np.mean(found) < 0.05 and np.max(found) < 0.25


def skill(chosen, guess, rng):
    """Weighted share of right guesses."""
    return chosen.weight @ right(chosen, guess, rng, repeats=2) / chosen.weight.sum()


def test_one_more_column_adds_what_the_first_leaves_and_nothing_that_follows_from_it():
    chosen, rng = free(11, n=400)
    sign = 2.0 * chosen.mode - 1.0
    now = sign + 1.5 * rng.normal(size=400)
    early = sign + 1.5 * rng.normal(size=400)
    base, noise = now[:, None], rng.normal(size=(400, 6))
    alone = skill(chosen, by_best_column(base), rng)
    more = skill(chosen, by_one_more(base, np.column_stack([noise, early])), rng)
    same = skill(chosen, by_one_more(base, np.column_stack([noise, 3.0 * now + 1.0])), rng)
    # Two equal looks of 1.5 spreads: right in .75 with one, in .83 with both.
    assert alone == pytest.approx(0.75, abs=0.05)
    assert more - alone > 0.04
    assert abs(same - alone) < 0.03


def test_a_cue_without_error_is_no_division_by_zero():
    chosen, rng = free(12)
    flat, cue = np.zeros((150, 2)), chosen.mode[:, None].astype(float)
    assert skill(chosen, by_one_more(flat, cue), rng) == pytest.approx(1.0)
    assert skill(chosen, by_one_more(flat, flat), rng) == pytest.approx(0.5, abs=0.1)
