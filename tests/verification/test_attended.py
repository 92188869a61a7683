"""A person who has the arm: each thing that may not be is found; nothing is, as planned."""

import pytest

from genpolicy.execution.journal import Journal, write_journal
from genpolicy.seeds import stream
from genpolicy.verification.attended import Attended, PlannedPerson, attended_otherwise
from genpolicy.verification.rollouts import derived_with_recoveries

WHO = "ada"
FELL = ("mode", {"old": "run", "new": "fallback"})
HELD = ("recovery", {"old": "idle", "new": "hold"})
ASKED = ("recovery", {"old": "hold", "new": "ask_human"})
INTERVENES = ("mode", {"old": "fallback", "new": "intervention"})
CALLED = (FELL, HELD, ASKED, INTERVENES)
BEGINS = ("person", {"stage": "took_over", "who": WHO})
DRIVES = ("mode", {"old": "intervention", "new": "fallback"})
HAS = ("recovery", {"old": "ask_human", "new": "person"})
CAME = (BEGINS, DRIVES, HAS)
CHUNK = ("enqueue", {"arrival": 1, "chunk_id": "c", "method": WHO})
ROW = ("fallback", {"arrival": 1})
LEFT = ("person", {"stage": "handed_back", "who": WHO})
BACK = (INTERVENES, ("mode", {"old": "intervention", "new": "run"}))
FREE = ("recovery", {"old": "person", "new": "idle"})
GONE = (LEFT, *BACK, FREE)
LEAVES = ("recovery", {"old": "person", "new": "abort"})
OF_POLICY = ("enqueue", {"arrival": 2, "chunk_id": "p", "method": "flow"})
STOPPED = ("supervisor", {"event": "force", "state": "protective_stop"})
CLEARED = ("supervisor", {"event": "human_reset", "state": "run"})
LATER = ("observation", {"later": True})
WON = ("outcome", {"outcome": "success"})
NEEDED, HELPED = (("outcome", {"outcome": how}) for how in ("intervention", "assisted"))
ABORTS = (FELL, HELD, ("recovery", {"old": "hold", "new": "retreat"}),
          ("recovery", {"old": "retreat", "new": "abort"}), INTERVENES)  # fmt: skip
RAMMED = ("supervisor", {"event": "collision", "state": "protective_stop"})
COLLIDED, FORCED = (("outcome", {"outcome": how}) for how in ("collision", "force_stop"))
OVER = ("person", {"stage": "episode_over", "who": WHO})
END = (("mode", {"old": "fallback", "new": "ended"}), ("end", {}))


def rules(*events):
    """Rules that are broken; all events at one time, up to `LATER`."""
    attended, found, t = Attended(), [], 0
    for kind, m in events:
        t += "later" in m
        found += [rule for rule, _ in attended.follow(kind, {"t": t, **m})]
    return found


def test_called_come_driven_and_gone_is_in_order():
    begun = (*CALLED, LATER, *CAME, LATER, CHUNK, ROW, LATER)
    assert rules(*begun, *GONE, LATER, OF_POLICY, ("accept", {"arrival": 2}),
                 ("outcome", {"outcome": "assisted"})) == []  # fmt: skip
    given_up = ("person", {"stage": "gave_up", "who": WHO})
    assert rules(*begun, given_up, INTERVENES, LEAVES, LATER, ("end", {})) == []
    assert rules(*begun, given_up, INTERVENES, LEAVES, NEEDED, LATER, ("end", {})) == []
    assert rules(*begun, OVER, *END) == []
    assert rules(*begun, STOPPED, ("recovery", {"old": "person", "new": "stopped"}), LATER,
                 OVER, *END) == []  # fmt: skip


@pytest.mark.parametrize(
    ("events", "rule"),
    [
        ((*CALLED[:3], BEGINS), "P8.take_over"),
        ((*CALLED, *CAME, BEGINS), "P8.take_over"),
        ((*CALLED, ("person", {"stage": "took_over", "who": " "})), "P8.take_over"),
        ((FELL, HELD, INTERVENES, BEGINS), "P8.take_over"),
        ((*CALLED, STOPPED, *CAME), "P8.stop"),
        ((*CALLED, *CAME, STOPPED, CLEARED), "P8.reset"),
        ((*CALLED, *CAME, OF_POLICY), "P8.queue"),
        ((*CALLED, OF_POLICY), "P8.queue"),
        ((OF_POLICY, *CALLED, *CAME, ("fallback", {"arrival": 2})), "P8.drives"),
        ((*CALLED, *CAME, CHUNK, *GONE, ROW), "P8.drives"),
        ((FELL, HELD, CHUNK, ROW), "P8.drives"),
        ((*CALLED, *CAME, BACK[1], LEFT, FREE), "P8.mode"),
        ((*CALLED, *CAME, *GONE, WON), "P8.success"),
        # A call alone is enough, whether somebody came or not.
        ((*CALLED, WON), "P8.success"),
        ((FELL, HELD, ("recovery", {"old": "hold", "new": "retreat"}),
          ("recovery", {"old": "retreat", "new": "abort"}), WON), "P8.success"),
        ((LEFT,), "P8.person"),
        ((*CALLED, *CAME, ("person", {"stage": "lost", "who": WHO})), "P8.person"),
        # The person is left out: the state, the mode and the going say that there was one.
        ((*CALLED, HAS), "P8.person"),
        ((*CALLED, DRIVES), "P8.mode"),
        ((*CALLED, *CAME, LATER, FREE), "P8.person"),
        ((*CALLED, *CAME, LATER, LEAVES), "P8.person"),
        # Or its state is.
        ((*CALLED, BEGINS, DRIVES, LATER), "P8.person"),
        ((*CALLED, *CAME, LATER, LEFT, *BACK, ("end", {})), "P8.person"),
        ((*CALLED, *CAME, LATER, OVER, LATER), "P8.person"),
        ((*CALLED[:3], LATER), "P8.called"),
        ((*CALLED[:3], ("end", {})), "P8.called"),
    ],
)  # fmt: skip
def test_each_thing_that_may_not_be_is_found(events, rule):
    assert rules(*events) == [rule]


@pytest.mark.parametrize(
    "events",
    [
        (*CALLED, NEEDED),
        (*ABORTS, NEEDED),
        (*CALLED, LATER, ("recovery", {"old": "ask_human", "new": "abort"}), NEEDED),
        (*CALLED, LATER, HELPED),
        (RAMMED, COLLIDED),
        (STOPPED, FORCED),
        (*CALLED, *CAME, LATER, STOPPED, ("recovery", {"old": "person", "new": "stopped"}),
         FORCED),
        (WON,),
        (("outcome", {"outcome": "timeout"}),),
    ],
)  # fmt: skip
def test_an_end_for_which_there_is_a_reason_at_that_time_is_in_order(events):
    assert rules(*events) == []


@pytest.mark.parametrize(
    ("events", "rule"),
    [
        # Nobody was called, or was long ago: what would have succeeded is cut off by a word.
        ((NEEDED,), "P8.outcome"),
        ((FELL, HELD, NEEDED), "P8.outcome"),
        ((*CALLED, LATER, NEEDED), "P8.outcome"),
        ((*ABORTS, LATER, NEEDED), "P8.outcome"),
        ((*CALLED, *CAME, LATER, NEEDED), "P8.outcome"),
        ((*CALLED, *CAME, LATER, *GONE, NEEDED), "P8.outcome"),
        ((*CALLED, STOPPED, ("recovery", {"old": "ask_human", "new": "stopped"}), NEEDED),
         "P8.outcome"),
        ((HELPED,), "P8.outcome"),
        ((FELL, HELD, HELPED), "P8.outcome"),
        ((COLLIDED,), "P7.outcome"),
        ((FORCED,), "P7.outcome"),
        ((STOPPED, COLLIDED), "P7.outcome"),
        ((RAMMED, FORCED), "P7.outcome"),
        ((STOPPED, LATER, FORCED), "P7.outcome"),
        ((STOPPED, CLEARED, FORCED), "P7.outcome"),
        ((("supervisor", {"event": "silence", "state": "protective_stop"}), FORCED), "P7.outcome"),
    ],
)  # fmt: skip
def test_an_end_without_a_reason_at_that_time_is_found(events, rule):
    assert rules(*events) == [rule]


@pytest.mark.parametrize("kind", ["accept", "fallback"])
def test_of_the_policy_nothing_is_executed_while_a_person_has_the_arm(kind):
    assert "P8.drives" in rules(OF_POLICY, *CALLED, *CAME, (kind, {"arrival": 2}))


PLAN = PlannedPerson((0.5, 1.5), 2.0, 11)


def planned(
    tmp_path, *, later=0, had_ns=1_000_000_000, comes=True, waits=40, period_s=0.05, outcome=""
):
    """A journal in which a person is called at 1 s, comes as drawn or later, and stays a while.

    One that nobody comes to is aborted after so many ticks. An outcome follows behind that.
    """
    period_ns = round(period_s * 1e9)
    journal = Journal("r", {"perturbation": "push", "start": "4"})
    journal.add("session", 0, {"labels": journal.labels, "period_ns": period_ns})
    asked = {"old": "hold", "new": "ask_human", "cause": "", "phase": "", "failures": 0}
    journal.add("recovery", 1_000_000_000, asked)
    due_s = stream(11, "person", "push", 4, 0).uniform(0.5, 1.5)
    came_ns = 1_000_000_000 + round(period_s * 1e9 * (int(due_s / period_s) + 1 + later))
    if comes:
        journal.add("recovery", came_ns, asked | HAS[1])
        journal.add("person", came_ns, BEGINS[1])
        journal.add("person", came_ns + had_ns, LEFT[1])
    elif waits is not None:
        aborted = {"old": "ask_human", "new": "abort"}
        journal.add("recovery", 1_000_000_000 + waits * period_ns, asked | aborted)
    if outcome:
        journal.add("outcome", journal.events()[-1].t, {"outcome": outcome, "mode": ""})
    journal.add("end", 9_000_000_000, {})
    write_journal(tmp_path / "j.mcap", [journal])
    return tmp_path / "j.mcap"


def ended(tmp_path, outcome, *states):
    """A journal that ends so at 1 s, behind states of recovery at times in s."""
    journal = Journal("r", {"perturbation": "push", "start": "4"})
    journal.add("session", 0, {"labels": journal.labels, "period_ns": 50_000_000})
    for time_s, old, new in states:
        told = {"old": old, "new": new, "cause": "", "phase": "", "failures": 0}
        journal.add("recovery", round(time_s * 1e9), told)
    journal.add("outcome", 1_000_000_000, {"outcome": outcome, "mode": ""})
    journal.add("end", 1_000_000_000, {})
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
     ({"had_ns": 2_200_000_000}, "had the arm for 2.200 s"),
     ({"comes": False}, "nobody took over"), ({"comes": False, "waits": None}, "nobody took over")],
)  # fmt: skip
def test_who_comes_at_another_time_or_stays_too_long_is_found(tmp_path, changes, said):
    (found,) = attended_otherwise(planned(tmp_path, **changes), PLAN)
    assert said in found and found.startswith("in 'r'")


def test_who_would_have_come_too_late_is_not_missed_and_a_period_need_be_no_whole_ns(tmp_path):
    due_s = stream(11, "person", "push", 4, 0).uniform(0.5, 1.5)
    for more, found in ((1, 0), (2, 1)):
        path = planned(tmp_path, comes=False, waits=int(due_s / 0.05) + more)
        assert len(list(attended_otherwise(path, PLAN))) == found
    assert list(attended_otherwise(planned(tmp_path, period_s=1 / 30), PLAN)) == []


@pytest.mark.parametrize(
    ("states", "with_nobody", "with_one"),
    [
        ((), 1, 1),
        (((0.9, "idle", "hold"), (0.9, "hold", "retreat")), 1, 1),
        # Asked at that time: where nobody is planned it is over, where one is it is waited for.
        (((0.5, "idle", "hold"), (1.0, "hold", "ask_human")), 0, 1),
        (((0.5, "idle", "hold"), (0.95, "hold", "ask_human")), 1, 1),
        (((0.5, "idle", "retreat"), (1.0, "retreat", "abort")), 0, 0),
        (((0.5, "idle", "retreat"), (0.95, "retreat", "abort")), 1, 1),
    ],
)
def test_an_end_for_want_of_a_person_needs_recovery_to_miss_one_then(
    tmp_path, states, with_nobody, with_one
):
    path = ended(tmp_path, "intervention", *states)
    for plan, count in ((None, with_nobody), (PLAN, with_one)):
        found = list(attended_otherwise(path, plan))
        assert ["whom recovery does not miss" in one for one in found] == [True] * count
    (row,) = derived_with_recoveries(path)[0].values()
    assert row["interventions"] >= (not with_nobody), "what stands was called, and counts"


def test_who_gave_up_or_did_not_come_ends_it_and_an_assisted_one_had_been_called(tmp_path):
    late = {"comes": False, "waits": 5}
    assert list(attended_otherwise(planned(tmp_path, **late, outcome="intervention"), PLAN)) == []
    assert list(attended_otherwise(planned(tmp_path, outcome="assisted"), PLAN)) == []
    found = list(attended_otherwise(planned(tmp_path, outcome="assisted"), None))
    assert any("an outcome is assisted" in one for one in found)
    for plan in (None, PLAN):
        (found,) = attended_otherwise(ended(tmp_path, "assisted"), plan)
        assert "an outcome is assisted" in found
