"""A person who has the arm: each thing that may not be is found; nothing is, as planned."""

import pytest

from genpolicy.execution.journal import Journal, write_journal
from genpolicy.seeds import stream
from genpolicy.verification.attended import Attended, PlannedPerson, attended_otherwise

WHO = "ada"
CALLED = ("mode", {"old": "fallback", "new": "intervention"})
CAME = ("person", {"stage": "took_over", "who": WHO})
DRIVES = ("mode", {"old": "intervention", "new": "fallback"})
CHUNK = ("enqueue", {"arrival": 1, "chunk_id": "c", "method": WHO})
ROW = ("fallback", {"arrival": 1})
GONE = ("person", {"stage": "handed_back", "who": WHO})
BACK = ("mode", {"old": "intervention", "new": "run"})
OF_POLICY = ("enqueue", {"arrival": 2, "chunk_id": "p", "method": "flow"})
STOPPED = ("supervisor", {"event": "force", "state": "protective_stop"})
CLEARED = ("supervisor", {"event": "human_reset", "state": "run"})
ENDED = ("outcome", {"outcome": "assisted"})


def rules(*events):
    attended = Attended()
    return [rule for kind, m in events for rule, _ in attended.follow(kind, m)]


def test_called_come_driven_and_gone_is_in_order():
    assert rules(CALLED, CAME, DRIVES, CHUNK, ROW, GONE, BACK, OF_POLICY,
                 ("accept", {"arrival": 2}), ENDED) == []  # fmt: skip


@pytest.mark.parametrize(
    ("events", "rule"),
    [
        ((CAME,), "P8.take_over"),
        ((CALLED, CAME, DRIVES, CAME), "P8.take_over"),
        ((CALLED, ("person", {"stage": "took_over", "who": " "})), "P8.take_over"),
        ((CALLED, STOPPED, CAME), "P8.stop"),
        ((CALLED, CAME, DRIVES, STOPPED, CLEARED), "P8.reset"),
        ((CALLED, CAME, DRIVES, OF_POLICY), "P8.queue"),
        ((OF_POLICY, CALLED, CAME, DRIVES, ("accept", {"arrival": 2})), "P8.drives"),
        ((OF_POLICY, CALLED, CAME, DRIVES, ("fallback", {"arrival": 2})), "P8.drives"),
        ((CALLED, CAME, DRIVES, CHUNK, GONE, ROW), "P8.drives"),
        ((CALLED, CAME, DRIVES, BACK), "P8.mode"),
        ((CALLED, CAME, DRIVES, GONE, BACK, ("outcome", {"outcome": "success"})), "P8.success"),
        ((GONE,), "P8.person"),
        ((CALLED, CAME, DRIVES, ("person", {"stage": "lost", "who": WHO})), "P8.person"),
    ],
)
def test_each_thing_that_may_not_be_is_found(events, rule):
    assert rules(*events) == [rule]


PLAN = PlannedPerson((0.5, 1.5), 2.0, 11)
PERIOD_NS = 50_000_000


def planned(tmp_path, *, later=0, had_ns=1_000_000_000):
    """A journal in which a person is called at 1 s, comes as drawn or later, and stays a while."""
    journal = Journal("r", {"perturbation": "push", "start": "4"})
    journal.add("session", 0, {"labels": journal.labels, "period_ns": PERIOD_NS})
    asked = {"old": "hold", "new": "ask_human", "cause": "", "phase": "", "failures": 0}
    journal.add("recovery", 1_000_000_000, asked)
    due_s = stream(11, "person", "push", 4, 0).uniform(0.5, 1.5)
    came_ns = 1_000_000_000 + PERIOD_NS * (int(due_s / 0.05) + 1 + later)
    journal.add("person", came_ns, CAME[1])
    journal.add("person", came_ns + had_ns, GONE[1])
    write_journal(tmp_path / "j.mcap", [journal])
    return tmp_path / "j.mcap"


def test_the_person_is_drawn_again(tmp_path):
    path = planned(tmp_path)
    assert list(attended_otherwise(path, PLAN)) == []
    assert "none was planned" in next(attended_otherwise(path, None))
    other = PlannedPerson(PLAN.reaction_s, PLAN.longest_s, 12)
    assert "took over at" in next(attended_otherwise(path, other))


@pytest.mark.parametrize(
    ("changes", "said"),
    [({"later": 1}, "took over at"), ({"later": -1}, "took over at"),
     ({"had_ns": 2_200_000_000}, "had the arm for 2.200 s")],
)  # fmt: skip
def test_who_comes_at_another_time_or_stays_too_long_is_found(tmp_path, changes, said):
    (found,) = attended_otherwise(planned(tmp_path, **changes), PLAN)
    assert said in found and found.startswith("in 'r'")
