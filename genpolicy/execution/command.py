"""What one tick of the executor hands on."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Command:
    """What one tick hands on.

    Attributes:
        kind: `action`, `fallback` (an action of the fallback), `hold` or `stop`.
        reason: Why it holds or stops; empty with an action.
        action: The action, read-only, shape (10,); None on hold and stop.
        chunk_id: Its chunk; empty on hold and stop.
        action_index: Its row; -1 on hold and stop.
    """

    kind: str
    reason: str = ""
    action: Array | None = field(default=None, repr=False)
    chunk_id: str = ""
    action_index: int = -1
