"""The log: what is said of each kind of event, and how loudly."""

import pytest

from genpolicy.execution.journal import EVENT_FIELDS
from genpolicy.replay.messages import ERROR, INFO, WARNING
from genpolicy.replay.words import said_of

CANDIDATE = {"chunk_id": "3/1", "index": 1, "first_reason": "scene_collision"}


@pytest.mark.parametrize(
    ("kind", "payload", "level", "text"),
    [
        ("session", {"labels": {"method": "flow", "start": "0"}}, INFO,
         "session: method flow, start 0"),
        ("session", {"labels": {}}, INFO, "session"),
        ("candidate", CANDIDATE, WARNING, "rejected 3/1 candidate 1: scene_collision"),
        ("phase", {"old": "", "new": "align"}, INFO, "phase: none to align"),
        ("recovery", {"old": "idle", "new": "hold", "cause": "silence"}, WARNING,
         "recovery: idle to hold (silence)"),
        ("hold", {"reason": "empty"}, INFO, "hold: empty"),
        ("discard", {"chunk_id": "a", "reason": "expired"}, INFO, "discard a: expired"),
        ("refuse", {"chunk_id": "a", "reason": "stopped"}, WARNING, "refuse a: stopped"),
        ("supervisor", {"event": "watchdog", "state": "watchdog_hold", "detail": "150 ns"},
         WARNING, "supervisor: watchdog, now watchdog_hold (150 ns)"),
        ("supervisor", {"event": "force", "state": "protective_stop", "detail": ""}, ERROR,
         "supervisor: force, now protective_stop"),
        ("supervisor", {"event": "emergency_stop", "state": "emergency_stop", "detail": ""}, ERROR,
         "supervisor: emergency_stop, now emergency_stop"),
        ("supervisor", {"event": "human_reset", "state": "run", "detail": "spotter"}, INFO,
         "supervisor: human_reset, now run (spotter)"),
        ("reset", {"session_epoch": 2}, WARNING, "reset: session epoch 2"),
        ("person", {"stage": "took_over", "who": "ada"}, WARNING, "person: ada took over"),
        ("outcome", {"outcome": "success", "mode": "left"}, INFO, "outcome: success"),
    ],
)  # fmt: skip
def test_news(kind, payload, level, text):
    assert kind in EVENT_FIELDS
    assert said_of(kind, payload) == (level, text)


@pytest.mark.parametrize(
    ("kind", "payload"),
    [("candidate", {**CANDIDATE, "first_reason": None}), ("accept", {}), ("scene", {}),
     ("observation", {}), ("finish", {})],
)  # fmt: skip
def test_no_news(kind, payload):
    assert said_of(kind, payload) is None
