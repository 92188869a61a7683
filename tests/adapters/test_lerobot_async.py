"""LeRobot's asynchronous queue in our words, against what its own client and server executed.

Recorded from `adapters/lerobot_async.py` in LeRobot 0.6.1: two rules of its queue, three
thresholds, a robot that moves and one that stands still (whose observations its server takes for
similar), and latencies from below a tick to longer than a chunk.
"""

import json
from pathlib import Path
from types import SimpleNamespace

import pytest

from benchmarks.async_client import ages_s, as_lerobot, ended_otherwise, ours

RECORDED = json.loads((Path(__file__).parent / "recorded" / "lerobot_async.json").read_text())


@pytest.mark.parametrize("number", range(len(RECORDED)))
def test_every_tick_executes_what_lerobot_executed(number):
    recorded = RECORDED[number]
    assert as_lerobot(recorded["asked"]) == recorded["executed"]


def test_the_recording_holds_what_the_count_is_about():
    """Old actions, empty queues, and mixtures that are older than what replaces: or it is blind."""
    mixed = [one for one in RECORDED if one["asked"]["rule"] == "weighted_average"]
    replaced = [as_lerobot(one["asked"] | {"rule": "latest_only"}) for one in mixed]
    assert any(one["executed"] != other for one, other in zip(mixed, replaced, strict=True))
    every = [run for one in RECORDED for run in one["executed"]]
    assert max(ages_s(every)) > 0.9
    assert any(seen is None for run in every for seen in run[20:])


def test_what_ours_does_not_execute_is_counted_by_reason():
    events = [
        SimpleNamespace(kind=kind, payload={"rows": rows})
        for kind, rows in (
            ("discard", {"executed": 2, "late": 1, "expired": 13}),
            ("finish", {"executed": 8, "beyond_execution_horizon": 8}),
            ("discard", {"executed": 0, "expired": 16}),
            ("accept", {"executed": 1}),
        )
    ]
    assert ended_otherwise(events) == {
        "expired": 29, "beyond_execution_horizon": 8, "late": 1,
    }  # fmt: skip


def test_each_action_that_came_was_executed_or_has_a_reason():
    found = ours(1)
    left = found.generated - len(found.ages_s) - found.ended.total()
    assert 0 <= left < 16  # of the chunk that was in the queue at the end
    assert found.ended["expired"] > 0 and found.ages_s
