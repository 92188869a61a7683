"""Chunks that layers refused: the table of the comparison against its journals."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import groupby
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from gates.stated import Row, compare_rows, training_seed
from gates.stress.rollouts import REFUSED, STRESS
from genpolicy.evidence.rows.stress import RefusedRow
from genpolicy.evidence.shadow.candidate_rows import numbers_sha256
from genpolicy.evidence.stress.worth import kept_whole
from genpolicy.integrity.rows import read_columns
from genpolicy.verification.refused import KEYS, RefusedCandidates, Rollout


def rederive_refused(
    root: Path,
    params: Mapping[str, Any],
    refused: RefusedCandidates,
    rollouts: Iterable[Row],
    *,
    folder: str = STRESS,
) -> None:
    """Hold each refused chunk that is kept against the hash that its journal states.

    Of every failure, and of every rollout that is worth a look, each one must be there.

    Args:
        root: Root of the workspace.
        params: `params.yaml`.
        refused: What the journals say of refused candidates.
        rollouts: What they say of the rollouts.
        folder: Where the table lies.

    Raises:
        RefusedError: A chunk is another one than was judged, is missing, or is too many.
        IntegrityError: The table is no regular file, or has not the columns of its row.
        BadInputError: It cannot be read.
    """
    path = f"{folder}/{Path(REFUSED).name}"
    stated = [_hashed(row) for row in read_columns(root / path, RefusedRow).to_pylist()]
    derived = list(refused.rows(_kept(rollouts)))
    compare_rows("D", path, KEYS, stated, derived, seed=training_seed(params))


def _kept(rollouts: Iterable[Row]) -> set[Rollout]:
    """The rollouts of which everything is kept."""
    found: set[Rollout] = set()
    for _, shard in groupby(sorted(rollouts, key=_rollout), lambda row: _rollout(row)[:2]):
        rows: Sequence[Row] = list(shard)
        ended: list[Any] = [SimpleNamespace(**row) for row in rows]
        whole = kept_whole(ended)
        found |= {_rollout(row) for row, kept in zip(rows, whole, strict=True) if kept}
    return found


def _rollout(row: Row) -> Rollout:
    return str(row["method"]), str(row["perturbation"]), int(row["start"])


def _hashed(row: Row) -> Row:
    """A row with the hashes of its arrays beside them."""
    return {**row, **{f"{name}_sha256": numbers_sha256(row[name]) for name in ("raw", "projected")}}
