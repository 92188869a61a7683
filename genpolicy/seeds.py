"""One root seed, named streams: which number is drawn never depends on order or batching.

Every random draw in the project comes from a generator named by what it is for, so that adding
a draw in one place moves no draw in another. Noise of the samplers is counter-based (Philox):
the key is a hash of the names, the draw a pure function of it.
"""

import hashlib
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


def stream(root_seed: int, *names: str | int) -> np.random.Generator:
    """Random generator of the stream `names` below `root_seed`.

    Equal arguments give equal draws in every process; other arguments give independent ones.
    """
    return np.random.Generator(np.random.Philox(key=_key(root_seed, names)))


def integer_seed(root_seed: int, *names: str | int) -> int:
    """A 63-bit seed of the stream `names`, for libraries that take an integer."""
    return int(_key(root_seed, names)[0] >> np.uint64(1))


def counter_noise(names: Sequence[str | int], *, shape: tuple[int, ...]) -> NDArray[np.float32]:
    """Standard normal noise that is a pure function of `names` and `shape`.

    Args:
        names: What the noise belongs to: checkpoint hash, observation key, candidate, sampler
            step. Batching, threads and order are not among them.
        shape: Shape of the result.

    Returns:
        Float32 array of the given shape.
    """
    generator = np.random.Generator(np.random.Philox(key=_key(0, tuple(names))))
    return generator.standard_normal(shape, dtype=np.float32)


def _key(root_seed: int, names: tuple[str | int, ...]) -> NDArray[np.uint64]:
    plain = [name if isinstance(name, str) else int(name) for name in names]
    digest = hashlib.sha256(repr((int(root_seed), plain)).encode()).digest()
    return np.frombuffer(digest[:16], dtype="<u8").astype(np.uint64)
