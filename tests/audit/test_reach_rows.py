"""Rows of reach: a share of nothing is no gap, and a drawn finding is the finding."""

from genpolicy.audit.reach_rows import FURTHER_TABLES, FindingDraw, Reach
from genpolicy.audit.rows import TABLES, Finding


def test_a_fifth_without_queries_is_no_gap():
    assert Reach("local", 1, 0, 0).share == 1.0
    assert Reach("local", 1, 8, 2).share == 0.25


def test_a_drawn_finding_is_the_finding():
    found = Finding(
        "clock", "robot", "epoch e1", "clock_residual_s", 0.05, 0.01, "s", "Correct it."
    )
    assert FindingDraw(draw=3, **vars(found)).finding == found


def test_no_table_stands_twice():
    assert not set(TABLES) & set(FURTHER_TABLES)
