"""A line between policy and supervisor that loses, doubles, delays and overtakes; and other load.

Nothing is judged by how long it took: events, counts and their order decide.
"""

import subprocess
import sys
from collections import Counter
from dataclasses import dataclass

import pytest
from arranged import (
    Ended,
    ended,
    events,
    has,
    lasting,
    linked,
    request_of,
    scripted,
    violations,
    wait_for,
    workspace,
)
from together import together

from genpolicy.integrity.documents import canonical_json
from genpolicy.wall_clock.proxy import LinePlan, planned
from genpolicy.wall_clock.run import PROXY, start

ROWS = 150
BEYOND_S, WITHIN_S = 1.9, 0.5
"""Beyond the deadline of `arranged`, and within it."""


@dataclass(frozen=True)
class Fault:
    """One row of the table: what is injected into an invocation, and what must become of it.

    Attributes:
        injected: Its name.
        ask: When each copy of the ask goes on, s.
        answer: When each copy of the answer does, s.
        ended: How the invocation must end.
        discarded: Why its chunk must be discarded; empty where it must be executed.
        unsolicited: Answers that nobody waits for.
    """

    injected: str
    ask: tuple[float, ...] = (0.0,)
    answer: tuple[float, ...] = (0.0,)
    ended: str = "answered"
    discarded: str = ""
    unsolicited: int = 0


TABLE = {
    4: Fault("ask_lost", ask=(), ended="deadline", discarded="expired"),
    6: Fault("answer_lost", answer=(), ended="deadline", discarded="expired"),
    8: Fault("answer_doubled", answer=(0.0, 0.0), unsolicited=1),
    10: Fault("ask_doubled", ask=(0.0, 0.0), unsolicited=1),
    # The next invocation begins and is answered before this answer comes: it is overtaken.
    12: Fault("overtaken", answer=(BEYOND_S,), ended="deadline", discarded="expired",
              unsolicited=1),
    14: Fault("delayed", ask=(WITHIN_S / 2,), answer=(WITHIN_S / 2,)),
}  # fmt: skip


def line(folder, plan: LinePlan) -> list[str]:
    path = folder / "line.json"
    path.write_bytes(canonical_json(plan.model_dump(mode="json")))
    return [*PROXY, str(path)]


def run(root, replay, plan, behaviour="good"):
    return start(
        root / "run",
        request_of(root, replay),
        scripted(behaviour, replay),
        line=line(root, plan),
        ready=True,
    )


@pytest.fixture(scope="module")
def disturbed(standing, sessions, tmp_path_factory) -> Ended:
    """One run with every fault of the table; what waits for clocks waits beside it."""
    root = workspace(tmp_path_factory.mktemp("line"))
    plan = LinePlan(
        asks=planned({(0, n): fault.ask for n, fault in TABLE.items()}),
        answers=planned({(0, n): fault.answer for n, fault in TABLE.items()}),
    )
    return ended(run(root, lasting(standing, ROWS), plan))


def fate(seen: Ended, number: int) -> tuple[str, str]:
    """How an invocation ended, and why its chunk was discarded."""
    name = f"scripted/wall_clock/0/{number}"
    ends = [
        e.payload["detail"]
        for e in seen.events
        if e.kind == "invocation" and e.payload["id"] == name and e.payload["stage"] == "end"
    ]
    gone = [e.payload["reason"] for e in seen.events
            if e.kind == "discard" and e.payload["chunk_id"] == name
            and e.payload["ended"] == "discarded"]  # fmt: skip
    assert len(ends) == 1 and len(gone) <= 1
    return ends[0], gone[0] if gone else ""


@pytest.mark.parametrize("number", TABLE, ids=lambda n: TABLE[n].injected)
def test_what_is_injected_is_what_is_seen(number, disturbed):
    fault = TABLE[number]
    assert fate(disturbed, number) == (fault.ended, fault.discarded)


def test_the_invariants_hold_and_every_answer_too_many_is_counted(disturbed):
    outcome = disturbed.outcome
    assert disturbed.violations == set()
    assert (outcome["stale"], outcome["invalid"], outcome["conservation_error"]) == (0, 0, 0)
    assert outcome["ticks"] + outcome["missed"] == ROWS
    # A policy that is slow to start misses deadlines before the table begins, and answers then.
    missed = Counter(
        e.payload["id"] for e in disturbed.events
        if e.kind == "invocation" and e.payload["detail"] == "deadline"
    )  # fmt: skip
    own = len(missed) - sum(fault.ended == "deadline" for fault in TABLE.values())
    expected = sum(fault.unsolicited for fault in TABLE.values())
    assert expected <= outcome["dropped"]["unsolicited"] <= expected + own
    assert outcome["dropped"]["deadline"] == len(missed)


def test_an_action_of_a_delayed_answer_is_as_old_as_it_was_long_on_the_way(disturbed):
    def youngest(number):
        name = f"scripted/wall_clock/0/{number}"
        return min(e.payload["age_ns"] for e in disturbed.events
                   if e.kind == "accept" and e.payload["chunk_id"] == name)  # fmt: skip

    delayed = next(n for n, fault in TABLE.items() if fault.injected == "delayed")
    assert youngest(delayed) >= WITHIN_S * 1e9


@together
def test_a_line_without_a_plan_changes_nothing(root, standing):
    seen = ended(run(root, lasting(standing, 2 * len(standing)), LinePlan()))
    assert seen.violations == set() and seen.outcome["accepted"] > 0
    assert seen.outcome["conservation_error"] == 0


@together
def test_what_is_no_message_is_passed_on_and_refused_where_it_arrives(root, standing):
    seen = ended(run(root, lasting(standing, 2 * len(standing)), LinePlan(), "no_json"))
    assert seen.violations == set()
    assert seen.outcome["dropped"]["malformed"] > 0


@together
def test_a_policy_that_is_killed_in_the_middle_of_its_chunk_moves_nothing_more(root, standing):
    """Rows that were admitted before may still be executed: they were checked. Then it holds."""
    running = run(root, lasting(standing, 3 * len(standing)), LinePlan())
    wait_for(lambda: has(events(running.folder), "accept"))
    running.policy.kill()
    running.policy.wait()
    begun = {e.payload["chunk_id"] for e in events(running.folder) if e.kind == "enqueue"}
    seen = ended(running)
    # What had been sent before the kill may still arrive: one more chunk at most.
    moved = {e.payload["chunk_id"] for e in seen.events if e.kind == "accept"}
    assert len(moved - begun) <= 1
    assert seen.supervisor()[-2:] == ["watchdog", "silence"]
    assert seen.accepted_after("silence") == 0
    assert seen.outcome["policy_gone"] and seen.outcome["conservation_error"] == 0
    assert seen.violations == set()


def test_other_load_on_every_core_breaks_no_invariant(pinned, standing, tmp_path):
    root = linked(pinned, tmp_path)
    spin = [sys.executable, "-c", "while True: pass"]
    load = [subprocess.Popen(spin) for _ in range(4)]
    try:
        seen = ended(run(root, lasting(standing, 2 * len(standing)), LinePlan()))
    finally:
        for process in load:
            process.kill()
            process.wait()
    outcome = seen.outcome
    assert violations(root / "run") == seen.violations == set()
    assert (outcome["stale"], outcome["invalid"], outcome["conservation_error"]) == (0, 0, 0)
    assert outcome["ticks"] + outcome["missed"] == 2 * len(standing)
