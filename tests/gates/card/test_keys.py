"""Keys of small order, and what is no key at all."""

import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from gates.card.keys import PRIME, key_weakness

# The eight points of small order, as published (y and sign; two points share a y but for it).
SMALL = (
    "0100000000000000000000000000000000000000000000000000000000000000",
    "ecffffffffffffffffffffffffffffffffffffffffffffffffffffffffffff7f",
    "0000000000000000000000000000000000000000000000000000000000000000",
    "0000000000000000000000000000000000000000000000000000000000000080",
    "26e8958fc2b227b045c3f489f2ef98f0d5dfac05d3c63339b13802886d53fc05",
    "26e8958fc2b227b045c3f489f2ef98f0d5dfac05d3c63339b13802886d53fc85",
    "c7176a703d4dd84fba3c0b760d10670f2a2053fa2c39ccc64ec7fd7792ac037a",
    "c7176a703d4dd84fba3c0b760d10670f2a2053fa2c39ccc64ec7fd7792ac03fa",
)


@pytest.mark.parametrize("text", SMALL)
def test_points_of_small_order_are_no_keys(text):
    assert "small order" in key_weakness(bytes.fromhex(text))


@pytest.mark.parametrize("y", [PRIME, PRIME + 1, 2**255 - 1])
def test_a_second_encoding_is_no_key(y):
    assert "one encoding" in key_weakness(y.to_bytes(32, "little"))


def test_what_is_no_point_and_what_is_no_key_s_length():
    none = [n for n in range(2, 12) if "no point" in key_weakness(n.to_bytes(32, "little"))]
    assert none and len(none) < 10
    assert "no point" in key_weakness(b"\1" * 31)


def test_a_part_of_small_order_is_refused_and_people_s_keys_are_not():
    mixed = 0
    for number in range(2, 60):
        mixed += "prime-order" in key_weakness(number.to_bytes(32, "little"))
    assert mixed
    for _ in range(5):
        key = Ed25519PrivateKey.generate().public_key().public_bytes_raw()
        assert key_weakness(key) == ""


def test_a_key_moved_by_the_point_of_order_two_is_refused():
    """(-x, -y): of the curve, of no small order, and verifies under another encoding."""
    for _ in range(4):
        key = Ed25519PrivateKey.generate().public_key().public_bytes_raw()
        number = int.from_bytes(key, "little")
        sign, y = number >> 255, number & ((1 << 255) - 1)
        moved = (PRIME - y) | ((1 - sign) << 255)
        assert "prime-order" in key_weakness(moved.to_bytes(32, "little"))


def test_zero_has_no_sign():
    for y in (1, PRIME - 1):
        assert "one encoding" in key_weakness((y | 1 << 255).to_bytes(32, "little"))
