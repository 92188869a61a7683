"""How a session began: its labels, every maker in force, scene and arm as they were first seen."""

import numpy as np

from genpolicy.execution.journal import Journal, write_journal
from genpolicy.verification.begun import begun_sessions

HERE = {"post": (np.array([0.5, 0.25, 0.0]), np.array([1.0, 0.0, 0.0, 0.0]))}
THERE = {"post": (np.array([0.6, 0.25, 0.0]), np.array([1.0, 0.0, 0.0, 0.0]))}


def test_the_first_scene_and_every_maker_are_told_by_session(tmp_path):
    one, other = Journal("one", {"method": "flow"}), Journal("other", {"method": "bc"})
    for journal in (one, other):
        journal.add("session", 0, {"labels": journal.labels})
    one.add("active", 0, {"checkpoint": "a", "sampler": "s"})
    one.scene(0.0, HERE)
    one.scene(0.05, THERE)
    told = {"tcp_m": [0.0] * 3, "tcp_rotation": [0.0] * 6, "gripper_m": 0.0, "force_n": 0.0}
    one.add("state", 0, {"q_rad": [0.25, -1.5], **told})
    one.add("state", 50_000_000, {"q_rad": [0.5, -1.5], **told})
    one.add("active", 50_000_000, {"checkpoint": "b", "sampler": "s"})
    other.add("active", 0, {"checkpoint": "c", "sampler": "t"})
    write_journal(tmp_path / "journal.mcap", [one, other])
    found = begun_sessions(tmp_path / "journal.mcap")
    assert set(found) == {"one", "other"}
    assert found["one"].labels == {"method": "flow"}
    assert found["one"].makers == [("a", "s"), ("b", "s")]
    np.testing.assert_array_equal(found["one"].bodies["post"], [0.5, 0.25, 0, 1, 0, 0, 0])
    assert found["one"].q_rad.tolist() == [0.25, -1.5] and found["other"].q_rad is None
    assert found["other"].makers == [("c", "t")] and found["other"].bodies is None
