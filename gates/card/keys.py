"""Public keys that can stand for a person: points of the prime-order group of Ed25519.

A key of small order verifies signatures that nobody made; one with a part of small order verifies
under several encodings. No person's key is either, so both are refused.
"""

import functools

PRIME = 2**255 - 19
ORDER = 2**252 + 27742317777372353535851937790883648493
CURVE_D = -121665 * pow(121666, -1, PRIME) % PRIME
ROOT_OF_MINUS_ONE = pow(2, (PRIME - 1) // 4, PRIME)

Point = tuple[int, int, int, int]
"""Extended coordinates, each below the prime: x = X/Z, y = Y/Z, x y = T/Z."""

NEUTRAL: Point = (0, 1, 1, 0)


@functools.cache
def key_weakness(public_key: bytes) -> str:
    """Why 32 bytes are no key of a person; empty if they may be one."""
    point = _decoded(public_key)
    if point is None:
        return "no point of the curve in its one encoding"
    if _is_neutral(_times(8, point)):
        return "a point of small order, under which anybody signs"
    if not _is_neutral(_times(ORDER, point)):
        return "a point outside the prime-order group"
    return ""


def _decoded(data: bytes) -> Point | None:
    """The point, or its opposite: both have one order, and nothing else is asked of it."""
    if len(data) != 32:
        return None
    number = int.from_bytes(data, "little")
    sign, y = number >> 255, number & ((1 << 255) - 1)
    if y >= PRIME:
        return None
    square = (y * y - 1) * pow(CURVE_D * y * y + 1, -1, PRIME) % PRIME
    x = pow(square, (PRIME + 3) // 8, PRIME)
    if (x * x - square) % PRIME:
        x = x * ROOT_OF_MINUS_ONE % PRIME
    if (x * x - square) % PRIME or (x == 0 and sign):
        return None
    return x, y, 1, x * y % PRIME


def _sum(one: Point, two: Point) -> Point:
    a = (one[1] - one[0]) * (two[1] - two[0]) % PRIME
    b = (one[1] + one[0]) * (two[1] + two[0]) % PRIME
    c = 2 * one[3] * two[3] * CURVE_D % PRIME
    d = 2 * one[2] * two[2] % PRIME
    e, f, g, h = b - a, d - c, d + c, b + a
    return e * f % PRIME, g * h % PRIME, f * g % PRIME, e * h % PRIME


def _times(factor: int, point: Point) -> Point:
    result = NEUTRAL
    while factor:
        if factor & 1:
            result = _sum(result, point)
        point = _sum(point, point)
        factor >>= 1
    return result


def _is_neutral(point: Point) -> bool:
    return point[0] == 0 and point[1] == point[2]
