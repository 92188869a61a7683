"""How chunks met what was commanded before: the table of the comparison against its journals."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from gates.stated import Row, compare_rows, training_seed
from gates.stress.rollouts import STRESS
from genpolicy.integrity.tables import read_table
from genpolicy.verification.spliced import KEYS

TABLE = "splices.parquet"
RELATIVE, ABSOLUTE = 1e-6, 1e-9
"""Two libraries compute where joints have the tool, and another processor rounds otherwise."""


def rederive_splices(
    root: Path, params: Mapping[str, Any], derived: Sequence[Row], *, folder: str = STRESS
) -> None:
    """Hold each splice of the comparison against what its journal gives.

    Args:
        root: Root of the workspace.
        params: `params.yaml`.
        derived: Rows of `genpolicy.verification.spliced`.
        folder: Where the table lies.

    Raises:
        RefusedError: A way or a jerk is not what the journal gives, or a chunk is missing.
        IntegrityError: The table is missing or no regular file.
        BadInputError: It cannot be read.
    """
    path = f"{folder}/{TABLE}"
    stated = read_table(root / path).to_pylist()
    told = {_key(row): row for row in stated}
    again = [_as_told(row, told.get(_key(row), {})) for row in derived]
    compare_rows("D", path, KEYS, stated, again, seed=training_seed(params))


def _key(row: Row) -> tuple[Any, ...]:
    return tuple(row.get(column) for column in KEYS)


def _as_told(row: Row, told: Row) -> Row:
    """A derived row with the stated number wherever that differs by rounding alone."""
    return {column: _near(value, told.get(column)) for column, value in row.items()}


def _near(value: Any, told: Any) -> Any:
    both = isinstance(value, float) and isinstance(told, float)
    same = both and math.isclose(value, told, rel_tol=RELATIVE, abs_tol=ABSOLUTE)
    return told if same else value
