"""A small session, each field of each kind of event forged alone: what the checker does not see.

Who forges one thing is found, but for the fields that are listed here, each with the reason why it
is no claim of the journal, or by whom else it is proved.
"""

import copy

import pytest

from genpolicy.evidence.shadow.rig import Rig
from genpolicy.execution.recovery import Recovery
from genpolicy.verification.checker import check_messages
from tests.execution.playing import fall_back

STEP_NS = 10**9
HEX = 16
ELSEWHERE = "another proof asks it: of motion, of tables, or of the settings that the caller knows"
SILENT = {
    ("enqueue", "motion"): ELSEWHERE,
    ("enqueue", "raw"): ELSEWHERE,
    ("enqueue", "method"): "whose chunks move an arm that a person has; of the policy its weights",
    ("enqueue", "valid_until_ns"): "later than it was: horizon and window end before",
    ("enqueue", "start_ns"): "on a virtual clock it is the observation's (`arrived`)",
    ("enqueue", "checked_rows"): "more rows than were checked have no joints in `motion`",
    ("enqueue", "predecessor"): "without one it is a new plan, which may come at any time",
    ("session", "labels"): ELSEWHERE,
    ("session", "period_ns"): ELSEWHERE,
    ("session", "queue_capacity"): ELSEWHERE,
    ("session", "watchdog_ns"): ELSEWHERE,
    ("session", "maximum_age_ns"): ELSEWHERE,
    ("session", "late_chunk"): ELSEWHERE,
    ("session", "execution_horizon"): ELSEWHERE,
    ("session", "replan_lead_rows"): ELSEWHERE,
    ("session", "maximum_divergence_m"): ELSEWHERE,
    ("session", "maximum_scene_shift_m"): ELSEWHERE,
    ("observation", "event_time_ns"): "on a virtual clock it is the tick's (`arrived`)",
    ("observation", "divergence_m"): "in a rollout it lies between state and command (`measured`)",
    ("scene", "bodies"): "in a rollout it is what the observation shows (`measured`)",
    ("supervisor", "detail"): "words for people; a person's name is asked for",
    ("hold", "reason"): "words for people, where nothing of the same chunk moves behind it",
    ("recovery", "cause"): "words for people, and a column that tables are held to",
    ("recovery", "phase"): "a column that tables are held to",
    ("invocation", "id"): "a session without a clock owes no invocation anything (`invocations`)",
    ("invocation", "stage"): "likewise",
    ("invocation", "detail"): "likewise",
    ("accept", "sequence"): "any number that grows",
    ("fallback", "sequence"): "likewise",
    ("candidate", "layers"): ELSEWHERE,
    ("candidate", "first_reason"): ELSEWHERE,
    ("candidate", "method"): ELSEWHERE,
    ("candidate", "index"): ELSEWHERE,
    ("candidate", "measures"): ELSEWHERE,
    ("candidate", "chunk_id"): ELSEWHERE,
}


@pytest.fixture(scope="module")
def honest():
    """Chunks, a phase, a force, a scene, a stop, a recovery by the fallback, a divergence."""
    rig = Rig()
    rig.see(post=0.5)
    rig.run()
    rig.executor.begin_invocation(rig.now_s, "i-1", "asked")
    rig.journal.candidate(
        rig.now_s, chunk_id="x", method="rig", index=0, layers={"fresh": False},
        first_reason="expired", measures={"votes": 3},
    )  # fmt: skip
    rig.executor.end_invocation(rig.now_s, "i-1", "answered")
    rig.phase, rig.epoch = "insert", "epoch-2"
    rig.observe()
    rig.run(2)
    rig.observe(age_s=0.01)
    rig.observe(divergence_m=0.2)
    rig.executor.force_event(rig.now_s)
    rig.tick()
    rig.run(1)
    rig.advance(0.3)
    rig.run(2)
    recovery = Recovery(rig.cell.execution, rig.journal)
    recovery.trigger(rig.now_s, rig.phase, "silence")
    fall_back(rig, recovery, ticks=2)
    recovery.primitive_failed(rig.now_s, "lost")
    rig.supervisor.observe_force(rig.now_s, 99.0, rig.phase)
    recovery.stop(rig.now_s, "force")
    rig.tick()
    rig.supervisor.human_reset(rig.now_s, "spotter")
    recovery.human_reset(rig.now_s, "spotter")
    rig.executor.end_fallback(rig.now_s)
    rig.run(2)
    made = [(e.kind, {"session": e.session, "n": e.n, "t": e.t, **e.payload}) for e in rig.end()]
    made[0][1]["checks_missing"] = []
    assert found(made) == []
    return made


def found(journal):
    return [(v.event, v.rule) for v in check_messages(journal).violations]


def forged(value):
    """The same, otherwise: a little, much, none, and of what has parts each part."""
    if isinstance(value, bool):
        return [not value]
    if isinstance(value, int):
        return [value + 1, value - 1, value + STEP_NS, value - STEP_NS]
    if isinstance(value, float):
        return [value + 0.01, -value - 0.001]
    if isinstance(value, str):
        whole = len(value) > HEX and set(value) <= set("0123456789abcdef")
        bit = f"{value[:5]}{'1' if value[5] != '1' else '2'}{value[6:]}" if whole else "x"
        return [text for text in (bit, f"{value}x", "") if text != value]
    if isinstance(value, dict):
        parts = [{**value, key: one} for key in value for one in forged(value[key])]
        return [*parts, *({k: v for k, v in value.items() if k != key} for key in value)]
    return [[*value, "x"]] if isinstance(value, list) else [0, "x"]


def test_each_field_that_is_forged_alone_is_found_or_listed(honest):
    silent, seen = set(), set()
    for kind in dict.fromkeys(kind for kind, _ in honest):
        first = next(n for n, (own, _) in enumerate(honest) if own == kind)
        for n in (first, max(n for n, (own, _) in enumerate(honest) if own == kind)):
            message = honest[n][1]
            for field in message.keys() - {"session", "n", "t"}:
                seen.add((kind, field))
                if (kind, field) in SILENT:
                    continue
                before = message[field]
                for value in forged(before):
                    message[field] = value
                    if found(honest) == []:
                        silent.add((kind, field))
                        break
                message[field] = before
    assert silent == set()
    assert SILENT.keys() <= seen and len(seen) > 80


@pytest.mark.parametrize("kind", [
    "observation", "phase", "epoch", "enqueue", "accept", "fallback", "discard", "finish", "mode",
    "recovery", "active", "controller", "session", "end",
])  # fmt: skip
def test_an_event_that_is_left_out_is_found(honest, kind):
    journal = copy.deepcopy(honest)
    place = next(n for n, (own, _) in enumerate(journal) if own == kind)
    del journal[place]
    for n, (_, message) in enumerate(journal):
        message["n"] = n
    if kind != "end":
        journal[-1][1]["events"] = len(journal) - 1
    assert found(journal) != []


def test_what_the_stub_refused_is_discarded_there_and_nowhere_else():
    """A refusal that is left out would be one bad arrival less at the stub."""
    rig = Rig()
    rig.observe()
    rig.deliver(rig.chunk())
    rig.tick(1)
    rig.stub.note_active("another", "sampler")  # the executor does not know
    rig.tick(1)
    assert rig.stub.stale == 1
    told = [(e.kind, {"session": e.session, "n": e.n, "t": e.t, **e.payload}) for e in rig.end()]
    told[0][1]["checks_missing"] = []
    assert found(told) == []
    for place in ("queue", "arrival", "x"):
        changed = copy.deepcopy(told)
        next(m for kind, m in changed if kind == "discard")["at"] = place
        assert "journal.refused" in [rule for _, rule in found(changed)]
    changed = [item for item in copy.deepcopy(told) if item[0] != "refuse"]
    for n, (_, message) in enumerate(changed):
        message["n"] = n
    changed[-1][1]["events"] = len(changed) - 1
    assert [rule for _, rule in found(changed)] == ["journal.refused"]
