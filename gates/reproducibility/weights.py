"""The weights themselves: how many, of which precision, and which are no numbers.

Read from the bytes that are pinned, by safetensors alone: no framework of tensors is imported, and
numbers of half the bits stay bits.
"""

from dataclasses import dataclass

import numpy as np
from safetensors import SafetensorError, deserialize

from gates.evidence import Evidence, MissingEvidenceError

PRECISIONS = {"F64": "float64", "F32": "float32", "F16": "float16", "BF16": "bfloat16"}
"""What a file calls each precision, and what a card does."""
BITS = {"F64": "<f8", "F32": "<f4", "F16": "<f2", "BF16": "<u2"}
EXPONENT_OF_BFLOAT = 0x7F80


@dataclass(frozen=True)
class Weights:
    """What one file of weights holds.

    Attributes:
        count: Numbers.
        nonfinite: Of them NaN or infinite.
        precision: As a card says it; several, in the order of the alphabet.
    """

    count: int
    nonfinite: int
    precision: str


def weights_at(evidence: Evidence, path: str) -> Weights:
    """The weights of a checkpoint.

    Raises:
        MissingEvidenceError: No file, or none of weights.
    """
    return evidence.once(("weights", path), lambda: _read(evidence.content(path), path))


def _read(data: bytes, path: str) -> Weights:
    count, nonfinite, precisions = 0, 0, set()
    try:
        for _, tensor in deserialize(data):  # type: ignore[no-untyped-call]
            kind = tensor["dtype"]
            values = np.frombuffer(tensor["data"], dtype=BITS[kind])
            count += len(values)
            nonfinite += _nonfinite(values, kind)
            precisions.add(PRECISIONS[kind])
    except (SafetensorError, KeyError) as error:
        raise MissingEvidenceError(f"{path} is no file of weights") from error
    return Weights(count, nonfinite, ", ".join(sorted(precisions)))


def _nonfinite(values: np.ndarray, kind: str) -> int:
    if kind == "BF16":
        return int(((values & EXPONENT_OF_BFLOAT) == EXPONENT_OF_BFLOAT).sum())
    return int((~np.isfinite(values)).sum())
