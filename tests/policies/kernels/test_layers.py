"""Layers add up in one order, whatever the company of a row; their rest is rounded as written."""

import numpy as np
import pytest

from genpolicy.policies.kernels.layers import (
    TOGETHER,
    added,
    enter,
    gained,
    linear,
    modulated,
)

INPUTS, OUTPUTS = 23, 17


@pytest.fixture
def rng():
    return np.random.default_rng(5)


def numbers(rng, *shape):
    return rng.normal(size=shape).astype(np.float32)


def layer(rng, block, inputs=INPUTS):
    room = np.empty((TOGETHER, OUTPUTS), np.float32)
    return numbers(rng, inputs, OUTPUTS), numbers(rng, OUTPUTS), block, room


def rounded_once(one, other, third):
    """one * other + third, rounded once: extended precision holds the product exactly."""
    exact = one.astype(np.longdouble) * other.astype(np.longdouble) + third.astype(np.longdouble)
    return exact.astype(np.float32)


def by_hand(rows, weight, bias, block, _):
    """As the module says it: bias, plus blocks of inputs, each added up from zero."""
    total = np.broadcast_to(bias, (len(rows), len(bias)))
    for first in range(0, len(weight), block):
        part = np.zeros_like(total)
        for k in range(first, min(first + block, len(weight))):
            part = rounded_once(rows[:, k : k + 1], weight[k], part)
        total = total + part
    return total


def of(rows, own):
    out = np.full((len(rows), OUTPUTS), np.nan, np.float32)
    linear(rows, out, *own)
    return out


@pytest.mark.parametrize("block", [1, 5, 8, 12, INPUTS, 64])
@pytest.mark.parametrize("rows", [1, 2, 7, 8, 9, 16, 21])
def test_a_layer_adds_up_block_by_block_and_input_by_input(rng, rows, block):
    own, seen = layer(rng, block), numbers(rng, rows, INPUTS)
    assert of(seen, own).tobytes() == by_hand(seen, *own).tobytes()


def test_another_block_gives_other_bits(rng):
    """The fault that the comparison is for: sums of another order are equal to rounding only."""
    weight, bias, _, room = layer(rng, 8)
    seen = numbers(rng, 8, INPUTS)
    one, other = (of(seen, (weight, bias, block, room)) for block in (8, INPUTS))
    assert not np.array_equal(one, other)
    assert np.allclose(one, other, atol=1e-5)


def test_a_row_has_its_bits_alone_and_in_company(rng):
    own, seen = layer(rng, 8), numbers(rng, 19, INPUTS)
    whole = of(seen, own)
    for row in range(len(seen)):
        assert of(seen[row : row + 1], own).tobytes() == whole[row].tobytes()


def test_what_is_not_finite_stays_in_its_row(rng):
    own, seen = layer(rng, 8), numbers(rng, 11, INPUTS)
    clean = of(seen, own)
    seen[3, 2] = np.nan
    found = of(seen, own)
    assert np.isnan(found[3]).all()
    assert np.array_equal(np.delete(found, 3, axis=0), np.delete(clean, 3, axis=0))


@pytest.mark.parametrize("each", [True, False])
def test_values_are_multiplied_before_they_enter(rng, each):
    own, values = layer(rng, 8), numbers(rng, 9, INPUTS)
    gains = numbers(rng, 9 if each else 1)
    out, room = np.empty((9, OUTPUTS), np.float32), np.empty_like(values)
    enter(values, gains, room, out, *own)
    assert out.tobytes() == by_hand(gains[:, None] * values, *own).tobytes()


@pytest.mark.parametrize("each", [True, False])
def test_rows_are_shifted_and_scaled_by_their_columns(rng, each):
    own, rows, first = layer(rng, 8), numbers(rng, 9, INPUTS), 3
    context = numbers(rng, 9 if each else 1, 3 * INPUTS)
    out, room = np.empty((9, OUTPUTS), np.float32), np.empty_like(rows)
    modulated(rows, context, first, room, out, *own)
    shift, scale = context[:, first : first + INPUTS], context[:, first + INPUTS :][:, :INPUTS]
    expected = rounded_once(rows, np.float32(1.0) + scale, np.broadcast_to(shift, rows.shape))
    assert out.tobytes() == by_hand(expected, *own).tobytes()


def test_a_layer_is_added_after_it_was_added_up(rng):
    own, rows, before = layer(rng, 8), numbers(rng, 9, INPUTS), numbers(rng, 9, OUTPUTS)
    out = before.copy()
    added(rows, np.empty_like(out), out, *own)
    assert out.tobytes() == (before + by_hand(rows, *own)).tobytes()


@pytest.mark.parametrize("each", [True, False])
def test_gains_are_rounded_product_by_product(rng, each):
    values, residual = numbers(rng, 9, INPUTS), numbers(rng, 9, INPUTS)
    skip, outer = numbers(rng, 9 if each else 1), numbers(rng, 9 if each else 1)
    out = np.empty_like(values)
    gained(values, residual, skip, outer, out)
    assert out.tobytes() == (skip[:, None] * values + outer[:, None] * residual).tobytes()
