"""What Gate A reports of synthetic evidence stays what was read through."""

import json

import golden_reports
import pytest

GOLDEN = json.loads(golden_reports.golden("A").read_text())


@pytest.fixture(scope="module")
def now(_evidence, tmp_path_factory):
    return golden_reports.reports(_evidence, tmp_path_factory.mktemp("golden"), "A")


@pytest.mark.parametrize("world", golden_reports.WORLDS["A"])
def test_golden_what_gate_a_reports(world, now):
    assert now[world] == GOLDEN[world]
