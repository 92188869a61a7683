"""The checker's own picture of the present: each objection alone, and stops that stay."""

import numpy as np
import pytest

from genpolicy.verification.expected import ExpectedSettings
from genpolicy.verification.world_view import WorldView

MS = 1_000_000
SETTINGS = {
    "maximum_age_ns": {"approach": 600 * MS}, "controller_mode": "m", "fallback_hash": "f",
    "maximum_divergence_m": 0.05, "maximum_scene_shift_m": 0.02,
}  # fmt: skip
EXPECTED = ExpectedSettings(
    execution_horizon=8, action_period_s=0.05, maximum_age_s={}, watchdog_s=0.1, queue_capacity=2,
    controller_mode="m", replan_lead_rows=3, late_chunk={},
    force_limit_n={"approach": 20.0, "insert": 40.0}, maximum_divergence_m=0.05,
    maximum_scene_shift_m=0.02, deadline_s=0.15,
)  # fmt: skip
CHUNK = {
    "condition_ns": 1000 * MS, "phase": "approach", "calibration_epoch": "e1",
    "checkpoint": "w", "sampler": "s", "session_epoch": 0, "source": "policy",
    "arrival": 0, "motion": None,
}  # fmt: skip


def observed(view, t_ms, phase="approach", epoch="e1", used=True, event_ms=None, away_m=None):
    event_ms = t_ms if event_ms is None else event_ms
    said = list(view.follow("observation", {
        "t": t_ms * MS, "event_time_ns": event_ms * MS, "used": used, "phase": phase,
        "calibration_epoch": epoch, "divergence_m": away_m,
        "ignored_because": "" if used else "older",
    }))  # fmt: skip
    for kind, (old, new, event_ns) in list(view._changes.items()):
        noted = {"old": old, "new": new, "event_time_ns": event_ns, "t": t_ms * MS}
        assert list(view.follow(kind, noted)) == []
    return said


@pytest.fixture
def view():
    made = WorldView()
    made.declare(SETTINGS)
    assert list(made.follow("active", {"checkpoint": "w", "sampler": "s"})) == []
    assert list(made.follow("controller", {"mode": "m", "t": 0})) == []
    assert observed(made, 1000) == []
    return made


def rules(view, t_ms=1200, kind="accept", **changes):
    return [rule for rule, _ in view.objections({**CHUNK, **changes}, kind, t_ms * MS, SETTINGS)]


def test_a_chunk_in_order_meets_no_objection_up_to_its_age(view):
    assert rules(view) == [] and rules(view, t_ms=1600) == []
    assert rules(view, t_ms=1601) == ["P1.age"]


@pytest.mark.parametrize(
    ("change", "rule"),
    [
        ({"condition_ns": 1001 * MS}, "P1.future"), ({"phase": "insert"}, "P1.phase"),
        ({"calibration_epoch": "e2"}, "P1.calibration"), ({"checkpoint": "x"}, "P1.checkpoint"),
        ({"sampler": "x"}, "P1.sampler"), ({"session_epoch": 1}, "P1.session"),
        ({"source": "fallback"}, "P1.state"),
    ],
)  # fmt: skip
def test_each_difference_has_its_own_rule(view, change, rule):
    assert rules(view, **change) == [rule]


def test_a_phase_without_an_age_accepts_nothing(view):
    observed(view, 1050, phase="insert")
    fresh = {"phase": "insert", "condition_ns": 1050 * MS}
    assert rules(view, t_ms=1050, **fresh) == ["P1.age"]


def test_a_change_of_phase_voids_what_was_seen_before(view):
    observed(view, 1100, phase="insert")
    observed(view, 1150, phase="approach")
    assert rules(view) == ["P1.void"]
    assert rules(view, condition_ns=1150 * MS) == []


def test_an_older_observation_is_used_by_nobody(view):
    assert observed(view, 1100, phase="insert", event_ms=900, used=False) == []
    assert view.phase == "approach"
    ((rule, _),) = observed(view, 1200, event_ms=900, used=True)
    assert rule == "journal.observation"


def test_a_stop_stays_until_a_person_clears_it(view):
    def supervise(event, state, detail=""):
        message = {"event": event, "state": state, "detail": detail, "t": 1100 * MS}
        return [rule for rule, _ in view.follow("supervisor", message)]

    assert supervise("force", "protective_stop") == []
    assert "P7.stop" in rules(view)
    assert supervise("watchdog", "run") == ["P7.sticky"]
    assert supervise("force", "protective_stop") == []
    assert supervise("human_reset", "run", " ") == ["P7.reset"]
    for nobody in ("\u200b", "-", ""):
        assert supervise("force", "protective_stop") == []
        assert supervise("human_reset", "run", nobody) == ["P7.reset"]
    assert supervise("reset_refused", "run", "no_time, no time, by Ann") == []
    assert supervise("reset_refused", "protective_stop") == ["P7.state"]
    assert supervise("reset_refused", "run") == ["P7.sticky"]
    assert supervise("force", "protective_stop") == []
    assert supervise("reset_refused", "protective_stop") == []
    assert "P7.stop" in rules(view), "who was refused has cleared nothing"
    assert supervise("human_reset", "run", "Ann") == []
    assert rules(view) == ["P1.void"]  # seen before the stop
    observed(view, 1150)
    assert rules(view, condition_ns=1150 * MS) == []


def test_modes_are_left_as_they_were_entered_and_the_fallback_has_its_own_weights(view):
    assert list(view.follow("mode", {"old": "run", "new": "fallback", "t": 1100 * MS})) == []
    own = {"source": "fallback", "checkpoint": "f", "sampler": "f"}
    assert rules(view, kind="fallback", **own) == [] and "P1.state" in rules(view)
    ((rule, _),) = view.follow("mode", {"old": "run", "new": "run", "t": 1150 * MS})
    assert rule == "journal.mode"


def test_session_epochs_only_grow_and_a_reset_forgets(view):
    assert list(view.follow("reset", {"session_epoch": 1, "t": 1100 * MS})) == []
    assert rules(view, session_epoch=1) == ["P1.future", "P1.void"]
    ((rule, _),) = view.follow("reset", {"session_epoch": 1, "t": 1200 * MS})
    assert rule == "P3.session"


@pytest.mark.parametrize(
    ("kind", "message", "rule"),
    [
        ("gossip", {}, "journal.kind"),
        ("phase", {"new": "insert"}, "journal.phase"),
        ("epoch", {"new": "e2"}, "journal.epoch"),
    ],
)
def test_events_that_contradict_what_was_observed_are_named(view, kind, message, rule):
    assert [found for found, _ in view.follow(kind, message)] == [rule]


def test_another_mode_of_the_controller_objects_and_voids_what_was_seen_before(view):
    assert rules(view) == []
    assert list(view.follow("controller", {"mode": "x", "t": 1100 * MS})) == []
    assert set(rules(view)) == {"P1.controller", "P1.void"}
    assert list(view.follow("controller", {"mode": "m", "t": 1150 * MS})) == []
    assert rules(view) == ["P1.void"]
    observed(view, 1160)
    assert rules(view, condition_ns=1160 * MS) == []
    ((rule, _),) = view.follow("controller", {"mode": None, "t": 1170 * MS})
    assert rule == "journal.controller"
    assert "P1.controller" in rules(WorldView())


@pytest.mark.parametrize(
    ("layers", "reason", "found"),
    [
        ({"a": True, "b": True}, None, []),
        ({"a": True, "b": False}, "collision", []),
        ({"a": None}, "no_model", []),
        ({"a": True, "b": False}, None, ["journal.verdict"]),
        ({"a": True, "b": None}, "", ["journal.verdict"]),
        ({"a": True, "b": True}, "collision", ["journal.verdict"]),
        ({}, None, ["journal.verdict"]),
    ],
)
def test_layers_and_reason_of_a_verdict_agree(view, layers, reason, found):
    m = {"t": 0, "chunk_id": "c", "layers": layers, "first_reason": reason}
    assert [rule for rule, _ in view.follow("candidate", m)] == found


def test_what_was_here_at_an_event_is_void_though_it_was_seen_as_late(view):
    """A force at the very time of the observation: the chunk was there, and another came after."""
    void = {"reason": "force_event", "before_ns": 1000 * MS, "t": 1000 * MS}
    assert list(view.follow("invalidate", void, 1)) == []
    assert rules(view) == ["P1.void"] and rules(view, arrival=1) == []


def test_a_person_who_clears_nothing_voids_no_chunk_that_is_here(view):
    reset = {"event": "human_reset", "state": "run", "detail": "spotter", "t": 1000 * MS}
    assert list(view.follow("supervisor", reset, 1)) == [] and rules(view) == []


@pytest.mark.parametrize("event", ["force", "collision", "emergency_stop", "silence"])
@pytest.mark.parametrize("state", ["run", "watchdog_hold"])
def test_a_gate_that_says_why_it_stops_and_does_not_is_found(view, event, state):
    message = {"event": event, "state": state, "detail": "", "t": 1100 * MS}
    assert [rule for rule, _ in view.follow("supervisor", message)] == ["P7.gate"]
    assert "P7.stop" in rules(view)


@pytest.mark.parametrize(("event", "state"), [("watchdog", "protective stop"), ("resume", "run")])
def test_a_supervisor_has_few_words(view, event, state):
    message = {"event": event, "state": state, "detail": "", "t": 1100 * MS}
    assert [rule for rule, _ in view.follow("supervisor", message)] == ["P7.words"]


@pytest.mark.parametrize(("felt_n", "found"), [(20.0, []), (20.01, ["P7.force"])])
def test_above_the_force_that_its_phase_bears_nothing_is_accepted(felt_n, found):
    """A supervisor that is deaf says nothing; what was measured does. Another phase bears 40 N."""
    own, known = WorldView(EXPECTED), WorldView()
    for view in (own, known):
        view.declare(SETTINGS)
        list(view.follow("active", {"checkpoint": "w", "sampler": "s"}))
        list(view.follow("controller", {"mode": "m", "t": 0}))
        observed(view, 1000)
        assert list(view.follow("state", {"force_n": felt_n, "t": 1000 * MS})) == []
    assert rules(own) == found and rules(known) == []
    assert list(own.follow("state", {"force_n": 1.0, "t": 1050 * MS})) == [] and rules(own) == []


@pytest.mark.parametrize(("away_m", "found"), [
    (None, []), (0.05, []), (0.0501, ["P1.void"]), (-1.0, ["P1.void"]), (1.8e308, ["P1.void"]),
])  # fmt: skip
def test_a_divergence_voids_what_was_seen_before_though_nobody_heeds_it(view, away_m, found):
    """An executor that compares with nothing says nothing; what was measured does."""
    assert observed(view, 1050, away_m=away_m) == []
    assert rules(view) == found and rules(view, condition_ns=1050 * MS, arrival=1) == []


def test_a_divergence_of_what_is_not_used_voids_what_was_seen_before_it_came(view):
    assert observed(view, 1100, event_ms=900, used=False, away_m=0.2) == []
    assert rules(view) == ["P1.void"]


@pytest.mark.parametrize(("away_m", "found"), [(0.04, ["journal.divergence"]), (0.06, [])])
def test_a_divergence_that_nobody_observed_is_none(view, away_m, found):
    observed(view, 1050, away_m=away_m)
    noted = {"reason": "observation_divergence", "before_ns": 1050 * MS, "t": 1050 * MS}
    assert [rule for rule, _ in view.follow("invalidate", noted)] == found


@pytest.mark.parametrize(("before", "now", "felt_n", "found"), [
    ("approach", "insert", 30.0, ["P7.force"]), ("insert", "approach", 30.0, ["P7.force"]),
    ("insert", "insert", 30.0, []), ("insert", "insert", 40.01, ["P7.force"]),
    ("approach", "insert", 20.0, []), ("insert", "unknown", 1.0, ["P7.force"]),
])  # fmt: skip
def test_where_the_phase_changed_meanwhile_the_smaller_limit_holds(before, now, felt_n, found):
    view = WorldView(EXPECTED)
    view.declare(SETTINGS)
    observed(view, 1000, phase=before)
    assert list(view.follow("state", {"force_n": felt_n, "t": 1050 * MS})) == []
    observed(view, 1050, phase=now)
    assert [rule for rule in rules(view, t_ms=1050) if rule == "P7.force"] == found
    assert list(view.follow("state", {"force_n": felt_n, "t": 1100 * MS})) == []
    observed(view, 1100, phase=now)  # felt in this phase from the begin on
    limit_n = {"approach": 20.0, "insert": 40.0}.get(now, 0.0)
    assert ("P7.force" in rules(view, t_ms=1100)) == (felt_n > limit_n)


def stands(x_m, y_m=0.0):
    return {"post": np.array([x_m, y_m, 0.1, 1.0, 0.0, 0.0, 0.0], "<f8").tobytes().hex()}


@pytest.mark.parametrize(("checked", "found"), [
    (stands(0.5), []), (stands(0.51), []), (stands(0.5, 0.021), ["P1.scene"]), ({}, ["P1.scene"]),
    ({"fixture": stands(0.5)["post"]}, ["P1.scene"]),
])  # fmt: skip
def test_a_chunk_that_was_checked_in_another_scene_than_the_one_seen_is_found(view, checked, found):
    motion = {"scene": checked, "measured_ns": 1000 * MS}
    assert rules(view, motion=motion) == ["P1.scene"]  # nobody has said any
    assert list(view.follow("scene", {"bodies": stands(0.5)})) == []
    assert rules(view, motion=motion) == found
    assert list(view.follow("scene", {"bodies": {"": ""}})) == []
    assert rules(view, motion=motion) == ["P1.scene"]


@pytest.mark.parametrize(("measured_ms", "found"), [(1050, []), (1049, ["P1.void"])])
def test_what_an_event_voids_it_voids_by_the_joints_too(view, measured_ms, found):
    """What it saw came after; where the arm stood when it was checked came before."""
    assert list(view.follow("scene", {"bodies": stands(0.5)})) == []
    assert list(view.follow("reset", {"session_epoch": 1, "t": 1050 * MS})) == []
    observed(view, 1100)
    chunk = {"condition_ns": 1100 * MS, "session_epoch": 1, "arrival": 9}
    motion = {"scene": stands(0.5), "measured_ns": measured_ms * MS}
    assert rules(view, motion=motion, **chunk) == found


def test_a_change_that_nobody_notes_or_notes_otherwise_is_found(view):
    said = {"t": 1100 * MS, "event_time_ns": 1100 * MS, "used": True, "phase": "insert",
            "calibration_epoch": "e1", "divergence_m": None, "ignored_because": ""}  # fmt: skip
    assert list(view.follow("observation", said)) == []
    ((rule, _),) = view.follow("scene", {"bodies": {}})
    assert rule == "journal.phase" and list(view.follow("scene", {"bodies": {}})) == []
    assert list(view.follow("observation", said | {"phase": "approach"})) == []
    noted = {"old": "align", "new": "approach", "event_time_ns": 1100 * MS}
    ((rule, _),) = view.follow("phase", noted)
    assert rule == "journal.phase"


@pytest.mark.parametrize(("events", "found"), [
    ([("watchdog", "watchdog_hold"), ("watchdog_recovered", "run")], []),
    ([("watchdog_recovered", "run")], ["P7.state"]), ([("watchdog", "run")], ["P7.state"]),
    ([("watchdog", "watchdog_hold"), ("watchdog", "watchdog_hold")], ["P7.state"]),
    ([("human_reset", "watchdog_hold")], ["P7.state"]), ([("human_reset", "run")], []),
])  # fmt: skip
def test_a_supervisor_goes_from_state_to_state(view, events, found):
    told = [{"event": event, "state": state, "detail": "Ann", "t": 1100 * MS}
            for event, state in events]  # fmt: skip
    assert [rule for m in told for rule, _ in view.follow("supervisor", m)] == found


@pytest.mark.parametrize(("steps", "found"), [
    ([("hold", "retreat", 0), ("retreat", "hold", 1), ("retreat", "abort", 2)], []),
    ([("retreat", "hold", 0)], ["P8.failures"]), ([("hold", "retreat", 1)], ["P8.failures"]),
    ([("retreat", "abort", 1), ("abort", "stopped", 1), ("stopped", "idle", 0)], []),
    ([("retreat", "abort", 1), ("abort", "idle", 1)], ["P8.failures"]),
])  # fmt: skip
def test_failed_primitives_are_counted(view, steps, found):
    told = [{"old": old, "new": new, "failures": count, "cause": ""} for old, new, count in steps]
    assert [rule for m in told for rule, _ in view.follow("recovery", m)] == found
