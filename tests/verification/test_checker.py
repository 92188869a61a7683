"""The checker against journals that were tampered with after an honest run."""

import copy
from dataclasses import replace

import pytest

from genpolicy.evidence.shadow.rig import EXECUTION, HORIZONS, ROWS, Rig, passing_verdict
from genpolicy.execution.checks import CHECKS, without
from genpolicy.robot.controller import CONTROLLER_MODE
from genpolicy.verification.checker import check_messages
from genpolicy.verification.expected import ALWAYS, ExpectedSettings

EXPECTED = ExpectedSettings(
    execution_horizon=HORIZONS.execution_horizon,
    action_period_s=HORIZONS.action_period_s,
    maximum_age_s=dict(EXECUTION.maximum_age_s),
    watchdog_s=EXECUTION.watchdog_s,
    queue_capacity=EXECUTION.queue_capacity,
    controller_mode=CONTROLLER_MODE,
    replan_lead_rows=EXECUTION.replan_lead_rows,
    late_chunk=EXECUTION.late_by_phase,
    force_limit_n=EXECUTION.force_limit_n,
    maximum_divergence_m=EXECUTION.maximum_divergence_m,
    maximum_scene_shift_m=EXECUTION.maximum_scene_shift_m,
    deadline_s=EXECUTION.deadline_s,
)


def messages(events):
    """As if feasibility had issued the rig's chunks: no check is missing."""
    made = [(e.kind, {"session": e.session, "n": e.n, "t": e.t, **e.payload}) for e in events]
    made[0][1]["checks_missing"] = []
    return made


@pytest.fixture
def honest():
    rig = Rig()
    rig.run()
    rig.tick(1)
    rig.run()
    return messages(rig.end())


def rules(report):
    return {violation.rule for violation in report.violations}


def find(journal, kind):
    return next(m for k, m in journal if k == kind)


def test_an_honest_run_has_no_violation_and_every_action_is_counted(honest):
    report = check_messages(honest)
    assert report.violations == []
    assert (report.checked_actions, report.chunks, report.sessions) == (16, 2, 1)
    assert report.oldest_action_ns == 7 * 50_000_000  # row 7 of a chunk from an observation at 0 s
    assert report.longest_silence_ns == 50_000_000


TAMPERING = {
    "one bit of an action": ("accept", "action", lambda v: "1" + v[1:], "P1.bits"),
    "one bit of the chunk": ("enqueue", "actions", lambda v: "1" + v[1:], "P1.hash"),
    "a layer": ("enqueue", "layers", lambda v: {**v, "layer_3": False}, "P1.admitted"),
    "a missing layer": ("enqueue", "layers", lambda v: {"layer_0": True}, "P1.admitted"),
    "what it was checked against": ("enqueue", "motion", lambda v: None, "P6.ground"),
    "validity": ("enqueue", "valid_until_ns", lambda v: 10, "P1.valid_until"),
    "condition": ("enqueue", "condition_ns", lambda v: v - 10**9, "P1.age"),
    "condition ahead": ("enqueue", "condition_ns", lambda v: v + 10**10, "P1.future"),
    "start": ("enqueue", "start_ns", lambda v: v + 50_000_000, "P1.window"),
    "phase": ("enqueue", "phase", lambda v: "insert", "P1.phase"),
    "epoch": ("enqueue", "calibration_epoch", lambda v: "epoch-9", "P1.calibration"),
    "weights": ("enqueue", "checkpoint", lambda v: "0", "P1.checkpoint"),
    "sampler": ("enqueue", "sampler", lambda v: "0", "P1.sampler"),
    "session epoch": ("enqueue", "session_epoch", lambda v: 1, "P1.session"),
    "source": ("enqueue", "source", lambda v: "fallback", "P1.state"),
    "predecessor": ("enqueue", "predecessor", lambda v: "ghost", "P4.chain"),
    "row": ("accept", "row", lambda v: v + 1, "P1.bits"),
    "age": ("accept", "age_ns", lambda v: v + 1, "P1.age"),
    "unknown chunk": ("accept", "chunk_id", lambda v: "ghost", "P1.admitted"),
    "observed phase": ("observation", "phase", lambda v: "insert", "P1.phase"),
    "balance": ("end", "chunks", lambda v: {**v, "executed": 1}, "conservation"),
    "rows": ("finish", "rows", lambda v: {**v, "executed": 7}, "conservation"),
    "reason": ("finish", "rows", lambda v: {"executed": 8, "mislaid": 8}, "conservation"),
    "event count": ("end", "events", lambda v: v - 1, "conservation"),
    "number": ("accept", "n", lambda v: v + 5, "journal.gap"),
    "time": ("accept", "t", lambda v: v + 10**9, "journal.time"),
    "missing field": ("accept", "row", lambda v: None, "journal.malformed"),
}


@pytest.mark.parametrize("name", TAMPERING)
def test_tampering_is_found(honest, name):
    kind, key, change, rule = TAMPERING[name]
    journal = copy.deepcopy(honest)
    message = find(journal, kind)
    message[key] = change(message[key])
    assert rule in rules(check_messages(journal))


@pytest.mark.parametrize("kind", ["session", "enqueue", "accept", "finish", "end", "active"])
def test_a_removed_event_is_found_even_when_the_rest_is_renumbered(honest, kind):
    journal = copy.deepcopy(honest)
    journal.remove(next(item for item in journal if item[0] == kind))
    for n, (_, message) in enumerate(journal):
        message["n"] = n
    assert check_messages(journal).violations


def test_a_repeated_accept_is_found(honest):
    journal = copy.deepcopy(honest)
    at = next(i for i, (kind, _) in enumerate(journal) if kind == "accept")
    journal.insert(at, copy.deepcopy(journal[at]))
    for n, (_, message) in enumerate(journal):
        message["n"] = n
    assert {"P3.row", "P3.sequence", "P3.due"} <= rules(check_messages(journal))


def test_a_stop_that_clears_itself_is_found():
    rig = Rig()
    rig.run()
    rig.supervisor.emergency_stop(rig.now_s)
    rig.journal.add(
        "supervisor", rig.now_ns, {"event": "ood_score", "state": "run", "detail": "0.01"}
    )
    assert "P7.sticky" in rules(check_messages(messages(rig.end())))


@pytest.mark.parametrize(("state", "found"), [
    ("protective_stop", {"P7.stop"}), ("emergency_stop", {"P7.stop"}),
    ("run", {"P7.stop", "P7.restart"}), ("watchdog_hold", {"P7.stop", "P7.restart"}),
])  # fmt: skip
def test_an_action_between_a_new_start_of_the_supervisor_and_a_person_is_found(
    honest, state, found
):
    """Whatever the new one says of itself, and whatever it says next."""
    first = next(i for i, (kind, _) in enumerate(honest) if kind == "accept")
    place = next(i for i in range(first + 1, len(honest)) if honest[i][0] == "accept")

    def told(event, state, person=""):
        base = {key: honest[place][1][key] for key in ("session", "t")}
        return ("supervisor", {**base, "n": 0, "event": event, "state": state, "detail": person})

    def judged(*events):
        journal = copy.deepcopy(honest[:place] + list(events) + honest[place:])
        for n, (_, message) in enumerate(journal):
            message["n"] = n
        journal[-1][1]["events"] += len(events)
        report = check_messages(journal)
        return rules(report), sum(v.rule == "P7.stop" for v in report.violations)

    after = sum(kind == "accept" for kind, _ in honest[place:])
    names, stopped = judged(told("restarted", state))
    assert names == found | {"P1.void"} and stopped == after
    names, stopped = judged(told("restarted", state), told("watchdog_recovered", "run"))
    assert names == found | {"P1.void", "P7.sticky"} and stopped == after
    names, stopped = judged(told("restarted", state), told("human_reset", "run", "spotter"))
    # The person clears it; what was made before, and where the arm stands since, is another rule.
    assert names == found - {"P7.stop"} | {"P1.void", "P5.continuity"} and stopped == 0


def test_declared_limits_are_compared_with_the_expected_ones(honest):
    report = check_messages(honest, EXPECTED)
    assert rules(report) == set()
    looser = replace(EXPECTED, maximum_age_s={"approach": 0.3})
    assert "settings.limits" in rules(check_messages(honest, looser))


def late_run(**changes):
    """A chunk that comes a row too late in the phase `insert`, and the next one, in time."""
    rig = Rig(**changes)
    rig.phase = "insert"
    rig.observe()
    rig.advance(0.2)
    first = {"condition_observation_event_time_s": 0.0, "action_start_time_s": 0.0}
    rig.deliver(rig.chunk(**first, verdict=passing_verdict(rows=(4, ROWS))))
    rig.tick(2)
    rig.run(2, predecessor_chunk_id="")
    return messages(rig.end())


def test_a_late_chunk_is_executed_only_where_the_phase_says_so():
    kept, laxer = late_run(), late_run(late_chunk={"continue": ("approach", "insert")})
    assert rules(check_messages(kept, EXPECTED)) == set()
    assert rules(check_messages(laxer)) == set()
    assert sum(kind == "accept" for kind, _ in laxer) > sum(kind == "accept" for kind, _ in kept)
    # What the phase says is known from elsewhere; a journal that claims another thing is none.
    assert rules(check_messages(laxer, EXPECTED)) == {"P1.late", "settings.limits"}
    for claimed in ("hold", "fallback", None):
        laxer[0][1]["late_chunk"]["insert"] = claimed
        assert rules(check_messages(laxer)) == {"P1.late"}
    laxer[0][1]["late_chunk"]["insert"] = "hold"
    laxer[0][1]["replan_lead_rows"] = 4
    assert rules(check_messages(laxer)) == set()
    assert rules(check_messages(laxer, EXPECTED)) == {"P1.late", "settings.limits"}


def test_a_session_without_end_is_no_proof():
    rig = Rig()
    rig.run()
    assert "journal.no_end" in rules(check_messages(messages(rig.journal.events())))


def test_an_action_in_another_mode_of_the_controller_is_found_whatever_it_claims(honest):
    place = next(i for i, (kind, _) in enumerate(honest) if kind == "controller")
    assert honest[place][1]["mode"] == CONTROLLER_MODE
    for mode in ("joint_position", ""):
        journal = copy.deepcopy(honest)
        journal[place][1]["mode"] = mode
        assert "P1.controller" in rules(check_messages(journal))
    journal = copy.deepcopy(honest)
    journal[0][1]["controller_mode"] = "joint_position"
    assert "P1.controller" in rules(check_messages(journal))
    assert "settings.limits" in rules(check_messages(journal, EXPECTED))


def test_a_mode_that_changes_voids_what_was_seen_before():
    rig = Rig()
    rig.observe()
    chunk = rig.chunk()
    rig.deliver(chunk)
    rig.tick(2)
    kept = messages(rig.journal.events())
    place = max(i for i, (kind, _) in enumerate(kept) if kind == "accept")
    accept = kept[place][1]
    for mode in ("joint_position", CONTROLLER_MODE):
        event = {"session": accept["session"], "n": 0, "t": accept["t"], "mode": mode}
        kept.insert(place, ("controller", event))
        place += 1
    for n, (_, message) in enumerate(kept):
        message["n"] = n
    found = rules(check_messages(kept))
    assert "P1.void" in found and "P1.controller" not in found


@pytest.mark.parametrize(
    "event",
    [
        lambda rig: rig.executor.force_event(rig.now_s),
        lambda rig: rig.executor.collision_event(rig.now_s),
        lambda rig: rig.observe(divergence_m=1.0),
        lambda rig: (
            rig.supervisor.emergency_stop(rig.now_s)
            or rig.supervisor.human_reset(rig.now_s, "spotter")
        ),
    ],
)
def test_an_event_as_late_as_the_observation_voids_the_chunk_that_is_here(event):
    """Executor and stub that have forgotten it: nobody else would say so."""
    names = {check.name for check in CHECKS if check.name.startswith("after_")}
    rig = Rig(checks=without(CHECKS, "issued", *names))
    rig.tick(1)
    rig.observe()
    rig.deliver(rig.chunk())
    event(rig)
    rig.tick(2)
    assert rig.stub.accepted == 2
    assert rules(check_messages(messages(rig.end()))) == {"P1.void"}


def judged(honest, passed):
    """The first chunk was judged so, just before it came."""
    layers = dict.fromkeys((f"layer_{n}" for n in range(5)), True) | {"layer_5": passed}
    place = next(i for i, (kind, _) in enumerate(honest) if kind == "enqueue")
    verdict = {**{key: honest[place][1][key] for key in ("session", "n", "t", "chunk_id")},
               "method": "rig", "index": 0, "layers": layers, "measures": {},
               "first_reason": None if passed else "expired"}  # fmt: skip
    journal = [*honest[:place], ("candidate", verdict), *copy.deepcopy(honest[place:])]
    for n, (_, message) in enumerate(journal):
        message["n"] = n
    journal[-1][1]["events"] += 1
    return journal


def test_a_chunk_that_was_refused_when_it_was_judged_does_not_come(honest):
    assert rules(check_messages(judged(honest, True))) == set()
    assert rules(check_messages(judged(honest, False))) == {"P1.verdict"}


@pytest.mark.parametrize(("key", "value"), [("version", 8), ("fallback_hash", "c" * 64)])
def test_what_every_session_declares_is_no_choice_of_its_own(honest, key, value):
    assert honest[0][1][key] == ALWAYS[key]
    honest[0][1][key] = value
    assert rules(check_messages(honest)) == {"settings.limits"}


def test_a_chunk_ends_under_its_own_name(honest):
    find(honest, "finish")["chunk_id"] = "chunk-9"
    assert rules(check_messages(honest)) == {"conservation"}


@pytest.mark.parametrize("key", ["q_cmd_rad", "q_before_rad"])
def test_numbers_that_are_none_are_a_violation_and_no_crash(key):
    rig = Rig()
    rig.run(2)
    rig.advance(0.15)
    rig.run(2)
    journal = messages(rig.end())
    chunks = [m for kind, m in journal if kind == "enqueue"]
    chunks[1]["motion"][key] = "00" * 9
    assert "journal.malformed" in rules(check_messages(journal))


def test_a_chain_of_predecessors_that_is_closed_is_read_to_an_end(honest):
    """The second names the first; here the first comes again and names the second."""
    honest[0][1]["labels"]["joining"] = "ensemble_oldest"
    first, second = (m for kind, m in honest if kind == "enqueue")
    assert second["predecessor"] == first["chunk_id"]
    at = {"session": "rig", "n": 0, "t": honest[-1][1]["t"]}
    made = {**at, "invocation": "i", "draw": 0, "rule": "ensemble_oldest", "parents": {}}
    honest[-1:-1] = [
        ("enqueue", {**first, **at, "arrival": 2, "predecessor": second["chunk_id"]}),
        ("joined", {**made, "chunk_id": second["chunk_id"]}),
        ("enqueue", {**second, **at, "arrival": 3}),
    ]
    for n, (_, message) in enumerate(honest):
        message["n"] = n
    assert "P3.duplicate" in rules(check_messages(honest))
