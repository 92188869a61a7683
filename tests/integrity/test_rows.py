"""A column is spelled once: schema, writer and reader take it from the row's class."""

from dataclasses import dataclass, make_dataclass
from pathlib import Path

import pyarrow as pa
import pytest

from genpolicy.errors import ContractError, IntegrityError
from genpolicy.integrity.rows import check_columns, columns_of, read_rows, schema_of, write_rows
from genpolicy.integrity.tables import read_table, write_table


@dataclass(frozen=True)
class Example:
    name: str
    count: int
    share: float | None
    passed: bool | None
    path: tuple[float, ...]
    paths: tuple[tuple[int, ...], ...]


ROWS = [
    Example("a", 1, 0.5, True, (1.0, 2.0), ((1,), ())),
    Example("b", 2, None, None, (), ()),
]


def test_field_order_is_column_order_and_annotations_give_the_types() -> None:
    expected = pa.schema(
        [
            ("name", pa.string()), ("count", pa.int64()), ("share", pa.float64()),
            ("passed", pa.bool_()), ("path", pa.list_(pa.float64())),
            ("paths", pa.list_(pa.list_(pa.int64()))),
        ]
    )  # fmt: skip
    assert schema_of(Example) == expected
    assert columns_of(Example) == tuple(expected.names)


def test_what_is_written_is_read_back_and_equal_rows_give_equal_bytes(tmp_path: Path) -> None:
    for name in ("one", "other"):
        write_rows(tmp_path / name, Example, ROWS)
    assert read_rows(tmp_path / "one", Example) == ROWS
    assert (tmp_path / "one").read_bytes() == (tmp_path / "other").read_bytes()
    plain = pa.Table.from_pylist([vars(row) for row in ROWS], schema_of(Example))
    write_table(tmp_path / "plain", plain)
    assert (tmp_path / "plain").read_bytes() == (tmp_path / "one").read_bytes()


def test_no_rows_give_an_empty_table_of_the_schema(tmp_path: Path) -> None:
    write_rows(tmp_path / "empty", Example, [])
    assert read_table(tmp_path / "empty").schema.equals(schema_of(Example))


def test_unknown_and_missing_columns_are_refused_by_name(tmp_path: Path) -> None:
    names = list(columns_of(Example))
    check_columns(Example, reversed(names), where="t")
    with pytest.raises(IntegrityError, match="unknown column extra and missing column name"):
        check_columns(Example, ["extra", *names[1:]], where="t.parquet")
    with pytest.raises(IntegrityError, match="missing columns count, share"):
        check_columns(Example, [n for n in names if n not in ("count", "share")], where="t")
    write_table(tmp_path / "t", pa.table({"name": ["a"]}))
    with pytest.raises(IntegrityError, match="missing columns count"):
        read_rows(tmp_path / "t", Example)


def test_a_field_of_another_type_is_refused() -> None:
    for kind in (dict, list, str | int, tuple[int, int]):
        with pytest.raises(ContractError, match=r"Odd\.x"):
            schema_of(make_dataclass("Odd", [("x", kind)]))
    with pytest.raises(ContractError, match="no dataclass"):
        schema_of(int)
