"""The rows of the evidence say what every column means, and the layers are those that judge."""

from dataclasses import fields, is_dataclass

import pytest

from genpolicy.evidence.rows import need, reproducibility, shadow, stress
from genpolicy.feasibility.settings import LAYERS
from genpolicy.integrity.rows import columns_of, schema_of

ROWS = [
    item
    for room in (need, reproducibility, shadow, stress)
    for item in vars(room).values()
    if is_dataclass(item)
]


@pytest.mark.parametrize("row", ROWS)
def test_every_row_has_a_schema_and_says_what_its_columns_mean(row: type) -> None:
    assert schema_of(row).names == [item.name for item in fields(row)]
    described = row.__doc__ or ""
    named = [name for name in columns_of(row) if f"        {name}: " in described]
    assert named == list(columns_of(row))[: len(named)]
    assert len(named) == len(fields(row)) or row is need.FactorModeRow


def test_every_table_has_a_row_of_its_own() -> None:
    assert len({row.__name__ for row in ROWS}) == len(ROWS) == 32


def test_a_candidate_has_a_column_for_every_layer_in_their_order() -> None:
    names = columns_of(shadow.CandidateRow)
    assert tuple(name for name in names if name in LAYERS) == LAYERS


def test_a_mode_of_a_variant_has_the_columns_of_a_mode() -> None:
    assert columns_of(need.FactorModeRow) == ("variant", "factor", *columns_of(need.ModeRow))
