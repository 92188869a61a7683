"""Failures that a search found count nowhere: no criterion of Gate D can reach them."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from test_safety import JUDGES, ROOT, reached

SEARCHES = ("genpolicy.evidence.failure_search", "genpolicy.evidence.rows.failures",
            "genpolicy.evidence.documents.failures", "gates.card.searched", "stages")  # fmt: skip


@pytest.mark.parametrize("judge", [*JUDGES, "gates/stress/gate.py"])
def test_nothing_of_gate_d_reaches_what_a_search_for_failures_found(judge: str) -> None:
    """Found failures count in no promotion test: neither criteria nor choice can see them."""
    found = reached(ROOT / judge)
    near = tuple(f"{name}." for name in SEARCHES)
    assert sorted(name for name in found if f"{name}.".startswith(near)) == []
    text = "".join((ROOT / name).read_text() for name in (judge, "gates/stress/rollouts.py"))
    assert "failure_search" not in text


def test_ways_to_what_a_search_found_are_followed() -> None:
    assert "gates.card.searched" in reached(ROOT / "gates/card/judge.py")
    assert "genpolicy.evidence.rows.failures" in reached(ROOT / "gates/card/drafting.py")
