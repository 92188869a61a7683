"""What claims to be an admitted chunk is read here; nothing is asked of what cannot be read."""

import numpy as np

from genpolicy.contract.action import ACTION_DIM
from genpolicy.contract.chunk import ChunkMetadata, actions_sha256
from genpolicy.errors import GenpolicyError, IntegrityError
from genpolicy.execution.checks import Chunk
from genpolicy.execution.nanoseconds import ChunkTimes
from genpolicy.feasibility.admission import Admitted

LAYER_COUNT = 6
MALFORMED = "<malformed>"


def issued_by_feasibility(chunk: object) -> bool:
    """Whether the feasibility module made this very object, and its actions are unchanged."""
    if type(chunk) is not Admitted:
        return False
    try:
        chunk.verify()
    except IntegrityError:
        return False
    return True


def shape_of(admitted: Admitted) -> tuple[int, str]:
    """Number of rows and name of whatever was delivered, malformed things included."""
    actions = getattr(admitted, "actions", None)
    metadata = getattr(admitted, "metadata", None)
    rows = len(actions) if isinstance(actions, np.ndarray) and actions.ndim == 2 else 0
    return rows, metadata.chunk_id if isinstance(metadata, ChunkMetadata) else MALFORMED


def read_chunk(admitted: Admitted, *, arrival: int, source: str) -> Chunk | None:
    """What the table of checks asks about; None where shape, times or rows cannot be read."""
    try:
        times = ChunkTimes.of(admitted.metadata)
        actions, layers = admitted.actions, admitted.verdict.layers
        passed = len(layers) == LAYER_COUNT and all(layer.passed is True for layer in layers)
        first, last = admitted.verdict.rows
        shaped = actions.ndim == 2 and actions.shape[1] == ACTION_DIM and len(actions) > 0
        if not (shaped and times.period_ns > 0 and 0 <= first < last <= len(actions)):
            return None
        return Chunk(
            metadata=admitted.metadata,
            times=times,
            source=source,
            arrival=arrival,
            rows=len(actions),
            checked_rows=(first, last),
            passed=passed and bool(np.isfinite(actions).all()),
            hashed=actions_sha256(actions) == admitted.actions_sha256,
        )
    except (AttributeError, TypeError, ValueError, GenpolicyError):
        return None
