"""Does the row of a rollout agree with itself?

Criteria read one column each: a hold share asks `hold_ticks`, a gain `success`. A row of which one
column was edited, or written wrong, would be judged by that column alone. What the comparison
keeps in every row that it writes (`genpolicy.evidence.stress.shard_rows`) is asked here of all.
Whether a row is what its journal says is asked of the journal (`genpolicy verify report`).
"""

from collections.abc import Iterator
from itertools import chain

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from gates.evidence import MissingEvidenceError, flags, numbers

SUCCESS = "success"
"""How a rollout ended that succeeded."""
PARTS = ("action_ticks", "hold_ticks", "fallback_ticks")
"""What a tick is, one of them: it commands an action of the policy, it holds, or it falls back."""
ANSWERS = ("deadline_misses", "rejections")
"""Parts of the invocations; one may be both."""

Found = tuple[NDArray[np.bool_], str]


def require_itself(rows: pd.DataFrame, method: str) -> None:
    """Refuse to judge a rollout of which one column denies another.

    Args:
        rows: Rollouts of one method; columns of `RolloutRow`.
        method: Its name.

    Raises:
        MissingEvidenceError: In some row they differ; it and the columns are named. Or a column
            that counts holds no numbers.
    """
    for holds, told in chain(_ended(rows), _ticked(rows), _answered(rows)):
        if len(differ := rows[~holds]):
            row = differ.iloc[0]
            where = f"rollout {method}, {row['perturbation']}, start {row['start']}"
            raise MissingEvidenceError(f"{where}: {told.format(**row)}")


def _ended(rows: pd.DataFrame) -> Iterator[Found]:
    """The end says whether it succeeded."""
    yield (
        flags(rows, "success") == (rows["outcome"] == SUCCESS).to_numpy(),
        "success is {success}, and it ended in {outcome}",
    )


def _ticked(rows: pd.DataFrame) -> Iterator[Found]:
    """Every tick is one of three things."""
    ticks, parts = numbers(rows, "ticks"), {part: numbers(rows, part) for part in PARTS}
    for part, of in parts.items():
        told = f"{part} is no part of ticks ({{{part}}} of {{ticks}})"
        yield (ticks > 0) & (of >= 0) & (of <= ticks), told
    told = " + ".join(f"{part} {{{part}}}" for part in PARTS)
    yield np.equal(sum(parts.values()), ticks), f"{told} do not add up to ticks {{ticks}}"


def _answered(rows: pd.DataFrame) -> Iterator[Found]:
    """What was missed or rejected was asked for, and so was what was commanded."""
    asked = numbers(rows, "invocations")
    for part in ANSWERS:
        of = numbers(rows, part)
        told = f"{part} is no part of invocations ({{{part}}} of {{invocations}})"
        yield (of >= 0) & (of <= asked), told
    yield (
        (numbers(rows, "action_ticks") == 0) | (asked > 0),
        "action_ticks {action_ticks} were commanded by no invocation",
    )
