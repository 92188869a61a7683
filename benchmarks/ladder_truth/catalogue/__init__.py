"""Every planted wrong, with the gate and the reason that have to stop it.

Written down before any of them was run. What was changed afterwards says so in `note`.
"""

from benchmarks.ladder_truth.catalogue import (
    brought,
    candidates,
    code,
    data,
    evidence,
    execution,
    limits,
    signatures,
)
from benchmarks.ladder_truth.planting import Wrong

WRONGS: tuple[Wrong, ...] = (
    *data.WRONGS,
    *candidates.WRONGS,
    *brought.WRONGS,
    *execution.WRONGS,
    *code.WRONGS,
    *evidence.WRONGS,
    *limits.WRONGS,
    *signatures.WRONGS,
)
AREAS = tuple(dict.fromkeys(wrong.area for wrong in WRONGS))

assert len({wrong.name for wrong in WRONGS}) == len(WRONGS), "a name is there twice"
