import contextlib
import tracemalloc

import msgpack
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from genpolicy.candidates.wire.packing import MAXIMUM_MESSAGE_BYTES, pack, unpack
from genpolicy.errors import IntegrityError

PLAIN = st.sampled_from(["<f8", "<f4", "<f2", "<i8", "<u2", "|u1", "|b1", ">f8"])


@given(arrays.arrays(PLAIN.map(np.dtype), arrays.array_shapes(min_dims=0, max_dims=4, min_side=0)))
def test_an_array_comes_back_bit_for_bit(array):
    back = unpack(pack({"a": array}))["a"]
    assert (back.dtype, back.shape, back.tobytes()) == (array.dtype, array.shape, array.tobytes())


def test_the_bytes_are_those_of_openpis_clients():
    """Golden: the map that openpi-client's `msgpack_numpy` writes (keys of bytes, C order)."""
    wire = msgpack.packb({
        "actions": {
            b"__ndarray__": True, b"data": np.arange(4.0).tobytes(), b"dtype": "<f8",
            b"shape": [2, 2],
        },
        "n": {b"__npgeneric__": True, b"data": 2, b"dtype": "<i4"},
    })  # fmt: skip
    assert pack({"actions": np.arange(4.0).reshape(2, 2), "n": np.int32(2)}) == wire
    back = unpack(wire)
    assert back["actions"].tolist() == [[0.0, 1.0], [2.0, 3.0]]
    assert back["n"] == np.int32(2)


def test_what_is_written_is_in_order_of_rows_whatever_lies_in_memory():
    turned = np.arange(6.0).reshape(2, 3).T
    assert unpack(pack({"a": turned}))["a"].tolist() == turned.tolist()


@given(st.binary(max_size=200))
def test_a_strangers_bytes_are_a_message_or_refused(data):
    with contextlib.suppress(IntegrityError):
        assert isinstance(unpack(data), dict)


@given(st.lists(st.tuples(st.integers(0, 160), st.integers(0, 255)), min_size=1, max_size=4))
def test_a_damaged_message_is_a_message_or_refused(changes):
    damaged = bytearray(pack({"a": np.arange(6.0).reshape(2, 3), "b": np.float32(2), "c": [{}]}))
    for place, value in changes:
        damaged[place % len(damaged)] = value
    with contextlib.suppress(IntegrityError):
        unpack(bytes(damaged))


def ndarray(**changes):
    fields = {"__ndarray__": True, "data": b"\0" * 8, "dtype": "<f8", "shape": [1], **changes}
    return msgpack.packb({"a": {key.encode(): value for key, value in fields.items()}})


@pytest.mark.parametrize(
    ("data", "found"),
    [
        (b"", "not msgpack"),
        (b"\x93\x01\x02\x03", "no map of names"),
        (msgpack.packb({b"a": 1}), "no map of names"),
        (b"\x81\xa1a" * 3000, "not msgpack"),
        (ndarray(dtype="|O"), "'|O'"),
        (ndarray(dtype="<f8,(1000000000,)f8"), "an array of"),
        (ndarray(dtype="<c16", data=b"\0" * 16), "'<c16'"),
        (ndarray(dtype=8), "an array of 8"),
        (ndarray(shape=[2]), "not as long as its shape"),
        (ndarray(shape=[-1]), "without a shape"),
        (ndarray(shape=[True]), "without a shape"),
        (ndarray(shape=[1] * 9), "without a shape"),
        (ndarray(shape=[1 << 40, 1 << 40]), "not as long as its shape"),
        (ndarray(data="text"), "not as long as its shape"),
        (
            msgpack.packb({"a": {b"__npgeneric__": True, b"data": "1", b"dtype": "<f8"}}),
            "a number that is none",
        ),
        (
            msgpack.packb({"a": {b"__npgeneric__": True, b"data": 300, b"dtype": "|u1"}}),
            "beyond its type",
        ),
    ],
)
def test_what_is_no_message_is_refused_by_what_it_is(data, found):
    with pytest.raises(IntegrityError, match="a message of a policy's process") as error:
        unpack(data)
    assert found in error.value.found


def test_a_message_beyond_the_limit_is_not_read():
    with pytest.raises(IntegrityError, match=f"of {MAXIMUM_MESSAGE_BYTES + 1} bytes"):
        unpack(b"\0" * (MAXIMUM_MESSAGE_BYTES + 1))


@pytest.mark.parametrize("value", [object(), {1}, np.array(["a"]), np.array([None]), 1j, 1 << 70])
def test_only_plain_values_are_written(value):
    with pytest.raises(IntegrityError, match="not to be written"):
        pack({"a": value})


def many(count, what=b"\x80"):
    return b"\x81\xa1a\xdd" + count.to_bytes(4, "big") + what * count


@pytest.mark.parametrize(
    "data",
    [
        many(1 << 20),  # an empty map is a byte here and sixty in memory
        many(1 << 20, b"\x90"),
        many(1 << 20, b"\xc0"),
        many(17, b"\xdc\x10\x00" + b"\xc0" * 4096),
        many(1000, b"\xdc\x00\x42" + b"\x80" * 66),
        many(15 << 20, b"\xc0"),  # eight bytes of memory each before the list is whole
    ],
)
def test_a_message_of_very_many_things_is_refused_before_it_is_built(data):
    tracemalloc.start()
    with pytest.raises(IntegrityError):
        unpack(data)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 16 << 20


def test_as_many_things_as_a_message_needs_are_read():
    rows = {"rows": [[number] * 64 for number in range(900)], "of": {"a": {}, "b": {}}}
    assert unpack(pack(rows)) == rows
