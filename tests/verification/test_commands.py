"""How far and how fast commands went, from a journal written by hand."""

import numpy as np
import pytest

from genpolicy.execution.journal import Journal, encode_actions, write_journal
from genpolicy.verification.commands import reach_of


def _session(name, moves):
    """A journal whose commands stand at these places; (kind, tick, position)."""
    journal = Journal(name, {})
    payload = {"arrival": 0, "chunk_id": "c", "row": 0, "sequence": 0, "age_ns": 0}
    journal.add("session", 0, {"labels": {}, "period_ns": 50_000_000})
    for kind, tick, position in moves:
        action = np.zeros(10)
        action[:3] = position
        journal.add(kind, tick * 50_000_000, {**payload, "action": encode_actions(action)})
    return journal


def test_speed_counts_from_command_to_command_and_a_hold_slows_nothing(tmp_path):
    first = _session(
        "a",
        [
            ("accept", 0, (0.4, 0.0, 0.1)),
            ("accept", 1, (0.41, 0.0, 0.1)),
            ("fallback", 9, (0.41, 0.02, 0.15)),
        ],
    )
    second = _session("b", [("accept", 0, (0.6, -0.1, 0.2))])
    write_journal(tmp_path / "j.mcap", [first, second])
    reach = reach_of(tmp_path / "j.mcap")
    assert reach.commands == 4
    assert reach.fastest_m_s == pytest.approx(np.hypot(0.02, 0.05) / 0.05)
    assert reach.lowest_m == (0.4, -0.1, 0.1) and reach.highest_m == (0.6, 0.02, 0.2)
    assert reach.as_document().commands == 4


def test_a_journal_without_commands_reached_nothing(tmp_path):
    write_journal(tmp_path / "j.mcap", [_session("a", [])])
    assert reach_of(tmp_path / "j.mcap").as_document().fastest_m_s is None
