"""Linear layers, and what stands directly before or behind them, on float32 rows.

A sum over the inputs of a layer begins with its bias, to which the sums of blocks of inputs are
added, each from zero and input after input, product and sum rounded once. Every row is treated
alone; eight rows go together only so that each weight is read once for them.
"""

import numpy as np
from numpy.typing import NDArray

from genpolicy.compiled import compiled

Array = NDArray[np.float32]

TOGETHER = 8
"""Rows that share a reading of the weights."""
INPUTS = 4
"""Inputs added up between two readings of a partial sum."""


@compiled("void(f4[:,::1], f4[:,::1], i8, i8, i8, f4[:,::1])", fused=True)
def _eight_rows(rows: Array, weight: Array, row: int, first: int, last: int, sums: Array) -> None:
    """Add inputs from `first` to before `last` of eight rows to their sums, shape (8, N)."""
    r0, r1, r2, r3 = rows[row], rows[row + 1], rows[row + 2], rows[row + 3]
    r4, r5, r6, r7 = rows[row + 4], rows[row + 5], rows[row + 6], rows[row + 7]
    s0, s1, s2, s3 = sums[0], sums[1], sums[2], sums[3]
    s4, s5, s6, s7 = sums[4], sums[5], sums[6], sums[7]
    whole = last - (last - first) % INPUTS
    for k in range(first, whole, INPUTS):
        a0, a1, a2, a3 = r0[k], r0[k + 1], r0[k + 2], r0[k + 3]
        b0, b1, b2, b3 = r1[k], r1[k + 1], r1[k + 2], r1[k + 3]
        c0, c1, c2, c3 = r2[k], r2[k + 1], r2[k + 2], r2[k + 3]
        d0, d1, d2, d3 = r3[k], r3[k + 1], r3[k + 2], r3[k + 3]
        e0, e1, e2, e3 = r4[k], r4[k + 1], r4[k + 2], r4[k + 3]
        f0, f1, f2, f3 = r5[k], r5[k + 1], r5[k + 2], r5[k + 3]
        g0, g1, g2, g3 = r6[k], r6[k + 1], r6[k + 2], r6[k + 3]
        h0, h1, h2, h3 = r7[k], r7[k + 1], r7[k + 2], r7[k + 3]
        w0, w1, w2, w3 = weight[k], weight[k + 1], weight[k + 2], weight[k + 3]
        for n in range(len(w0)):
            x0, x1, x2, x3 = w0[n], w1[n], w2[n], w3[n]
            s0[n] = s0[n] + a0 * x0 + a1 * x1 + a2 * x2 + a3 * x3
            s1[n] = s1[n] + b0 * x0 + b1 * x1 + b2 * x2 + b3 * x3
            s2[n] = s2[n] + c0 * x0 + c1 * x1 + c2 * x2 + c3 * x3
            s3[n] = s3[n] + d0 * x0 + d1 * x1 + d2 * x2 + d3 * x3
            s4[n] = s4[n] + e0 * x0 + e1 * x1 + e2 * x2 + e3 * x3
            s5[n] = s5[n] + f0 * x0 + f1 * x1 + f2 * x2 + f3 * x3
            s6[n] = s6[n] + g0 * x0 + g1 * x1 + g2 * x2 + g3 * x3
            s7[n] = s7[n] + h0 * x0 + h1 * x1 + h2 * x2 + h3 * x3
    for k in range(whole, last):
        for place in range(TOGETHER):
            for n in range(weight.shape[1]):
                sums[place, n] += rows[row + place, k] * weight[k, n]


@compiled("void(f4[::1], f4[:,::1], i8, i8, f4[::1])", fused=True)
def _one_row(row: Array, weight: Array, first: int, last: int, sums: Array) -> None:
    """Add inputs from `first` to before `last` of one row to its sums, shape (N,)."""
    step = 2 * INPUTS
    whole = last - (last - first) % step
    for k in range(first, whole, step):
        for n in range(weight.shape[1]):
            total = sums[n]
            for own in range(step):
                total += row[k + own] * weight[k + own, n]
            sums[n] = total
    for k in range(whole, last):
        for n in range(weight.shape[1]):
            sums[n] += row[k] * weight[k, n]


@compiled("void(f4[:,::1], f4[:,::1], f4[:,::1], f4[::1], i8, f4[:,::1])")
def linear(rows: Array, out: Array, weight: Array, bias: Array, block: int, sums: Array) -> None:
    """A linear layer.

    Args:
        rows: Shape (B, K).
        out: Written. Shape (B, N).
        weight: Shape (K, N).
        bias: Shape (N,).
        block: Inputs that are added up before they are added to the bias.
        sums: Room. Shape (8, N).
    """
    count, inputs = rows.shape
    outputs = len(bias)
    for row in range(count):
        for n in range(outputs):
            out[row, n] = bias[n]
    row = 0
    while row < count:
        together = TOGETHER if count - row >= TOGETHER else 1
        for first in range(0, inputs, block):
            last = min(first + block, inputs)
            for place in range(together):
                for n in range(outputs):
                    sums[place, n] = np.float32(0.0)
            if together == TOGETHER:
                _eight_rows(rows, weight, row, first, last, sums)
            else:
                _one_row(rows[row], weight, first, last, sums[0])
            for place in range(together):
                for n in range(outputs):
                    out[row + place, n] += sums[place, n]
        row += together


@compiled("void(f4[:,::1], f4[:,::1], i8, f4[:,::1])", fused=True)
def _modulate(rows: Array, context: Array, first: int, out: Array) -> None:
    count, width = rows.shape
    for row in range(count):
        own = context[row if len(context) > 1 else 0]
        shift, scale = own[first : first + width], own[first + width : first + 2 * width]
        for n in range(width):
            out[row, n] = shift[n] + rows[row, n] * (np.float32(1.0) + scale[n])


@compiled("void(f4[:,::1], f4[:,::1])")
def _add(rows: Array, out: Array) -> None:
    for row in range(len(rows)):
        for n in range(rows.shape[1]):
            out[row, n] += rows[row, n]


LAYER = "f4[:,::1], f4[::1], i8, f4[:,::1]"
"""Of `linear`: weight, bias, block and sums."""


@compiled(f"void(f4[:,::1], f4[::1], f4[:,::1], f4[:,::1], {LAYER})")
def enter(
    values: Array, gains: Array, room: Array, out: Array,
    weight: Array, bias: Array, block: int, sums: Array,
) -> None:  # fmt: skip
    """A layer of values (B, K) times their gain, of each row or one for all; by `room` (B, K)."""
    for row in range(len(values)):
        gain = gains[row if len(gains) > 1 else 0]
        for k in range(values.shape[1]):
            room[row, k] = gain * values[row, k]
    linear(room, out, weight, bias, block, sums)


@compiled(f"void(f4[:,::1], f4[:,::1], i8, f4[:,::1], f4[:,::1], {LAYER})")
def modulated(
    rows: Array, context: Array, first: int, room: Array, out: Array,
    weight: Array, bias: Array, block: int, sums: Array,
) -> None:  # fmt: skip
    """A layer of rows (B, W) that are shifted and scaled; by `room` (B, W).

    The shift is columns of `context` from `first` on, the scale, over one, the W after them; it has
    a row for each, or one for all.
    """
    _modulate(rows, context, first, room)
    linear(room, out, weight, bias, block, sums)


@compiled(f"void(f4[:,::1], f4[:,::1], f4[:,::1], {LAYER})")
def added(
    rows: Array, room: Array, out: Array, weight: Array, bias: Array, block: int, sums: Array
) -> None:
    """A layer of rows (B, W), added to `out` (B, N); by `room` (B, N)."""
    linear(rows, room, weight, bias, block, sums)
    _add(room, out)


@compiled("void(f4[:,::1], f4[:,::1], f4[::1], f4[::1], f4[:,::1])")
def gained(values: Array, residual: Array, skip: Array, outer: Array, out: Array) -> None:
    """`skip` values + `outer` residual, rows (B, K); gains of each row, or one for all."""
    for row in range(len(values)):
        one, other = skip[row if len(skip) > 1 else 0], outer[row if len(outer) > 1 else 0]
        for k in range(values.shape[1]):
            out[row, k] = one * values[row, k] + other * residual[row, k]
