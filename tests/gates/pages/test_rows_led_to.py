"""Rows of what was played lead to what can be opened, and to nothing that is no evidence."""

import pyarrow as pa
import pytest

from gates.pages.rows_led_to import led_to

JOURNALS = {"artifacts/shadow/journal.mcap", "artifacts/stress/journals/flow__push.mcap"}
SHADOW, STRESS = "artifacts/shadow/table.parquet", "artifacts/stress/table.parquet"


def named(path, played=JOURNALS, **columns):
    """What the rows of a table lead to: the column that is added, and its cells."""
    table = pa.table(columns)
    found = led_to(path, table, played)
    assert found.select(table.column_names).equals(table), "nothing else moves"
    added = found.column_names[len(table.column_names) :]
    return {name: found.column(name).to_pylist() for name in added}


def test_a_row_of_one_session_or_rollout_names_it():
    two = {"method": ["flow", "act"], "seed": [0, 0]}
    found = named(SHADOW, **two, fixture=["held_out", "nan_action"], observation=[8, 0])
    assert found == {"session": ["flow/held_out/8", "act/nan_action/0"]}
    found = named(STRESS, **two, perturbation=["push", "push"], start=[3, 3])
    assert found == {"rollout": ["flow/push/3", ""]}, "of act there is no journal"


def test_a_row_that_adds_up_names_where_all_of_it_lies():
    found = named(SHADOW, method=["flow"], fixture=["held_out"], generated=[12])
    assert found == {"sessions": ["flow/held_out/*"]}
    found = named(STRESS, method=["flow", "flow"], perturbation=["push", "nominal"], count=[1, 2])
    assert found == {"journal": ["artifacts/stress/journals/flow__push.mcap", ""]}


def test_nothing_is_named_that_is_no_evidence():
    assert named(SHADOW, (), method=["flow"], fixture=["x"], observation=[1]) == {"session": [""]}
    assert named(SHADOW, (), method=["flow"], fixture=["x"]) == {"sessions": [""]}
    assert named(STRESS, (), method=["flow"], perturbation=["push"]) == {"journal": [""]}


@pytest.mark.parametrize("path", ["artifacts/audit/table.parquet", "artifacts/stress2/t.parquet"])
def test_a_table_of_nothing_that_was_played_is_left_as_it_is(path):
    assert named(path, method=["flow"], perturbation=["push"], fixture=["x"]) == {}
    assert named(STRESS, candidate=[1]) == {} == named(SHADOW, fixture=["held_out"])
