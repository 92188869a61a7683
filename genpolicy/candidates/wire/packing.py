"""Messages of the wire: msgpack with arrays, as openpi's clients and servers write them.

An array is a map of the keys `__ndarray__`, `data`, `dtype` and `shape`, a NumPy number one of
`__npgeneric__`, `data` and `dtype`, both with keys of bytes. Only plain numbers are read: no
object, no field, no string, so that nothing of a message can be code.
"""

import math
import re
from typing import Any

import msgpack
import numpy as np

from genpolicy.errors import IntegrityError

MAXIMUM_MESSAGE_BYTES = 16 << 20
"""Room for 64 chunks of 512 rows and 32 columns, and for a few small pictures; no more."""
PLAIN_KINDS = "biuf"
PLAIN_TYPE = re.compile(r"[<>|](b1|[iu][1248]|f[248])")
MOST_AXES = 8
MOST_ITEMS = 4096
"""Of one list or map, as its header says; what is in it is counted only when it is whole."""
MOST_OF_ALL = 65_536
"""Things in a message: an empty map is a byte on the wire and sixty in memory."""


def pack(message: dict[str, Any]) -> bytes:
    """The bytes of a message.

    Raises:
        IntegrityError: Something in it is no number, text, list, map or array of plain numbers.
    """
    try:
        packed: bytes = msgpack.packb(message, default=_plain)
    except (TypeError, ValueError, OverflowError) as error:
        raise _refused(f"not to be written ({error})") from error
    return packed


def unpack(data: bytes) -> dict[str, Any]:
    """The message of bytes that a stranger may have written.

    Raises:
        IntegrityError: Larger than a message may be, no msgpack, no map, or an array that is not
            of plain numbers or not as long as its shape says.
    """
    if len(data) > MAXIMUM_MESSAGE_BYTES:
        raise _refused(f"of {len(data)} bytes")
    try:
        message = _read(data)
    except IntegrityError:
        raise
    except (ValueError, RecursionError) as error:  # msgpack's own errors are ValueErrors
        raise _refused(f"not msgpack ({type(error).__name__}: {error})") from error
    if not isinstance(message, dict) or not all(isinstance(key, str) for key in message):
        raise _refused("no map of names")
    return message


def _read(data: bytes) -> Any:
    items = 0

    def counted(found: Any) -> Any:
        nonlocal items
        items += 1 + len(found)
        if items > MOST_OF_ALL:
            raise _refused(f"of more than {MOST_OF_ALL} things")
        return found

    return msgpack.unpackb(
        data, object_hook=lambda found: _array(counted(found)), list_hook=counted,
        max_array_len=MOST_ITEMS, max_map_len=MOST_ITEMS, strict_map_key=True,
    )  # fmt: skip


def _plain(value: object) -> dict[bytes, Any]:
    if isinstance(value, np.ndarray | np.generic) and value.dtype.kind not in PLAIN_KINDS:
        raise TypeError(f"an array of {value.dtype}")
    if isinstance(value, np.ndarray):
        return {
            b"__ndarray__": True,
            b"data": np.ascontiguousarray(value).tobytes(),
            b"dtype": value.dtype.str,
            b"shape": list(value.shape),
        }
    if isinstance(value, np.generic):
        return {b"__npgeneric__": True, b"data": value.item(), b"dtype": value.dtype.str}
    raise TypeError(f"a {type(value).__name__}")


def _array(found: dict[Any, Any]) -> Any:
    if b"__ndarray__" in found:
        dtype, shape, data = _dtype(found), _shape(found.get(b"shape")), found.get(b"data")
        if not isinstance(data, bytes) or len(data) != math.prod(shape) * dtype.itemsize:
            raise _refused(f"an array that is not as long as its shape {shape}")
        return np.frombuffer(data, dtype=dtype).reshape(shape).copy()
    if b"__npgeneric__" in found:
        value = found.get(b"data")
        if not isinstance(value, bool | int | float):
            raise _refused("a number that is none")
        try:
            with np.errstate(over="raise"):
                return _dtype(found).type(value)
        except (OverflowError, ValueError, FloatingPointError) as error:
            raise _refused(f"a number beyond its type ({error})") from error
    return found


def _shape(found: Any) -> list[int]:
    sized = isinstance(found, list) and len(found) <= MOST_AXES
    if not (sized and all(type(size) is int and size >= 0 for size in found)):
        raise _refused("an array without a shape")
    shape: list[int] = found
    return shape


def _dtype(found: dict[Any, Any]) -> "np.dtype[Any]":
    said = found.get(b"dtype")
    # NumPy reads a text as a small language of its own; a stranger's is not given to it.
    if not (isinstance(said, str) and PLAIN_TYPE.fullmatch(said)):
        raise _refused(f"an array of {said!r}"[:80])
    return np.dtype(said)


def _refused(found: str) -> IntegrityError:
    return IntegrityError(
        where="a message of a policy's process",
        found=found,
        expected=f"a msgpack map with arrays of numbers, up to {MAXIMUM_MESSAGE_BYTES} bytes",
        action="Look at what the policy's process sends.",
    )
