"""The rows of the evidence say what every column means, and the layers are those that judge."""

from dataclasses import fields, is_dataclass

import pytest

from genpolicy.evidence import rows
from genpolicy.feasibility.settings import LAYERS

ROWS = [item for item in vars(rows).values() if isinstance(item, type) and is_dataclass(item)]


@pytest.mark.parametrize("row", ROWS)
def test_every_row_has_a_schema_and_says_what_its_columns_mean(row: type) -> None:
    assert rows.schema_of(row).names == [item.name for item in fields(row)]
    described = row.__doc__ or ""
    named = [name for name in rows.columns_of(row) if f"        {name}: " in described]
    assert named == list(rows.columns_of(row))[: len(named)]
    assert len(named) == len(fields(row)) or row is rows.FactorModeRow


def test_every_row_is_public() -> None:
    assert {row.__name__ for row in ROWS} <= set(rows.__all__)


def test_a_candidate_has_a_column_for_every_layer_in_their_order() -> None:
    names = rows.columns_of(rows.CandidateRow)
    assert tuple(name for name in names if name in LAYERS) == LAYERS


def test_a_mode_of_a_variant_has_the_columns_of_a_mode() -> None:
    own = rows.columns_of(rows.FactorModeRow)
    assert own == ("variant", "factor", *rows.columns_of(rows.ModeRow))
