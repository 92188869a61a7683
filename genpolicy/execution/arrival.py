"""What claims to be an admitted chunk is looked at here before anything else is asked."""

from typing import TYPE_CHECKING

import numpy as np

from genpolicy.contract.action import ACTION_DIM
from genpolicy.contract.chunk import ChunkMetadata, actions_sha256
from genpolicy.errors import GenpolicyError
from genpolicy.execution.ledger import ChunkTimes
from genpolicy.execution.settings import LAYER_COUNT

if TYPE_CHECKING:
    from genpolicy.feasibility.admission import Admitted

MALFORMED = "<malformed>"


def shape_of(admitted: "Admitted") -> tuple[int, str]:
    """Number of rows and name of whatever was delivered, malformed things included."""
    actions = getattr(admitted, "actions", None)
    metadata = getattr(admitted, "metadata", None)
    rows = len(actions) if isinstance(actions, np.ndarray) and actions.ndim == 2 else 0
    return rows, metadata.chunk_id if isinstance(metadata, ChunkMetadata) else MALFORMED


def is_whole(admitted: "Admitted", *, period_ns: int, disabled: frozenset[str]) -> bool:
    """Shape, finiteness, times, period, verdict and hash of what claims to be admitted."""
    try:
        times = ChunkTimes.of(admitted.metadata)
        actions, layers = admitted.actions, admitted.verdict.layers
        shaped = actions.ndim == 2 and actions.shape[1] == ACTION_DIM and len(actions) > 0
        passed = len(layers) == LAYER_COUNT and all(layer.passed is True for layer in layers)
        first, last = admitted.verdict.rows
        checked = 0 <= first < last <= len(actions)
        hashed = actions_sha256(actions) == admitted.actions_sha256
    except (AttributeError, TypeError, ValueError, GenpolicyError):
        return False
    return (
        shaped
        and times.period_ns == period_ns
        and checked
        and ((passed and bool(np.isfinite(actions).all())) or "infeasible" in disabled)
        and (hashed or "action_hash" in disabled)
    )
