"""A term that takes longer than it may: its declared action on the clock, counted and proved."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from genpolicy.contract.latency import (
    ENDING,
    FITTING,
    DeadlineAction,
    Term,
    TermDeadline,
    overruns,
)
from genpolicy.errors import ConfigError
from genpolicy.evidence.stress.latency import DeclaredTerm
from genpolicy.evidence.stress.state import Outcome
from genpolicy.execution.cell import ExecutionSettings
from genpolicy.execution.journal import write_journal
from genpolicy.verification.owed import Times, stated_otherwise
from genpolicy.verification.rollouts import derived_with_recoveries
from genpolicy.verification.tables import derived_tables

PERIOD_S = 0.05
USUAL_S = 0.002
"""What a term takes that is not slow; it may take ten times as long."""
SENSED_S = 4 * USUAL_S
"""When an observation is there: its four terms after its exposure."""


def of_kind(rollout, kind):
    return [event for event in rollout.journal.events() if event.kind == kind]


def stages(rollout):
    """What a journal says of invocations: when, s, stage and detail."""
    return [
        (round(event.t / 1e9, 6), event.payload["stage"], event.payload["detail"])
        for event in of_kind(rollout, "invocation")
    ]


def table(**actions):
    """The eleven rows; every term may take 20 ms and goes on beyond, but for what is named."""
    return [[str(term), 0.02, str(actions.get(term, "continue"))] for term in Term]


@pytest.fixture
def play(run, kit, plans, tmp_path):
    """One rollout in which one term is slow, under a table of deadlines, and its proof."""

    def go(term, slow_s, rows, *, ticks=60, plan=None):
        execution = ExecutionSettings(**kit.PARAMS["execution"] | {"term_deadlines": rows})
        base = kit.latency()
        declared = {name: DeclaredTerm(USUAL_S, USUAL_S) for name in base.declared}
        measured = {name: np.full(8, USUAL_S) for name in base.measured}
        if term in declared:
            declared[term] = DeclaredTerm(slow_s, slow_s)
        else:
            measured[term] = np.full(8, slow_s)
        model = replace(base, declared=declared, measured=measured)
        (rollout,) = run(
            plan or kit.Replay(plans.actions), execution=execution, latency=model, ticks=ticks
        )
        report = kit.check([rollout], tmp_path, execution=execution)
        assert report.violations == [] and rollout.executor.conservation().error == 0
        path = tmp_path / "journal.mcap"
        assert list(stated_otherwise(path, times(model, rows))) == []
        (derived,) = derived_with_recoveries(path)[0].values()
        assert derived["deadline_misses"] == rollout.tally.deadline_misses
        counted = {
            (row["term"], row["action"]): row["count"]
            for row in derived_tables([path])["overruns"]
            if row["count"] > 0
        }
        assert counted == {(str(t), str(a)): n for (t, a), n in rollout.tally.overruns.items()}
        return rollout

    return go


def times(model, rows):
    """What the checker draws from: the rows of `latency.parquet` that made the model."""
    measured = [
        {"method": "scripted", "run": 1, "process": 1, "component": str(name), "repeat": repeat,
         "temperature": how, "source": "measured", "seconds": float(seconds)}
        for name, spans in model.measured.items() for how in ("cold", "warm")
        for repeat, seconds in enumerate(spans)
    ]  # fmt: skip
    return Times(
        measured,
        declared={str(n): (own.minimum_s, own.maximum_s) for n, own in model.declared.items()},
        perturbations={"nominal": {"kind": "nominal"}},
        root_seed=7,
        deadlines={term: (most_s, action) for term, most_s, action in rows},
    )


@pytest.mark.parametrize(("term", "action"), [
    ("encode", "cancel_candidate"), ("sample", "cancel_candidate"),
])  # fmt: skip
def test_an_invocation_ends_when_the_time_of_its_term_is_over(play, term, action):
    """0.5 s of one term: given up at the first tick after its 20 ms, and begun anew at once."""
    rollout = play(term, 0.5, table(**{term: action}), ticks=6)
    first = stages(rollout)[:4]
    assert [what for _, *what in first[1:3]] == [
        ["overrun", f"{term} {action}"],
        ["end", "overrun"],
    ]
    assert [when for when, *_ in first] == [SENSED_S, PERIOD_S, PERIOD_S, PERIOD_S + SENSED_S]
    assert first[3][1] == "begin"
    assert rollout.tally.action_ticks == 0 and rollout.tally.deadline_misses == 5
    (reason,) = {event.payload["reason"] for event in of_kind(rollout, "discard")} - {
        "end_of_episode"
    }
    assert reason == "expired"


@pytest.mark.parametrize(("term", "action"), [
    ("exposure", "drop_observation"), ("capture", "drop_observation"),
    ("decode", "skip_invocation"), ("transfer", "skip_invocation"),
])  # fmt: skip
def test_an_observation_that_took_too_long_is_dropped_when_it_comes(play, term, action):
    """0.13 s of one term: nothing begins before one is there, and what begins ends at once."""
    rollout = play(term, 0.13, table(**{term: action}), ticks=8)
    first = stages(rollout)[:3]
    assert first == [
        (0.136, "begin", first[0][2]), (0.15, "overrun", f"{term} {action}"),
        (0.15 if action == "drop_observation" else 0.2, "end", "overrun"),
    ]  # fmt: skip
    assert rollout.tally.action_ticks == 0 and not of_kind(rollout, "candidate")


def test_a_skipped_invocation_lets_a_period_pass(play):
    rollout = play("preprocess", 0.5, table(preprocess="skip_invocation"), ticks=6)
    begun = [when for when, stage, _ in stages(rollout) if stage == "begin"]
    assert begun == pytest.approx([k * PERIOD_S + SENSED_S for k in (0, 2, 4)])
    said = [detail for _, stage, detail in stages(rollout) if stage == "overrun"]
    assert said == ["preprocess skip_invocation"] * 3


@pytest.mark.parametrize("term", ["network", "queue"])
def test_an_answer_that_was_long_on_its_way_is_refused_when_it_comes(play, term):
    """Not before: the controller learns of it with the answer. Nothing is executed; it holds."""
    rollout = play(term, 0.11, table(**{term: "reject_stale"}), ticks=8)
    first = stages(rollout)[:3]
    assert first[1:] == [
        (0.15, "overrun", f"{term} reject_stale"), (0.15, "end", "overrun"),
    ]  # fmt: skip
    assert rollout.tally.action_ticks == 0 and rollout.tally.hold_ticks == 8
    assert not of_kind(rollout, "candidate")


def test_a_candidate_whose_check_takes_too_long_is_replaced_until_none_is_left(
    play, kit, plans, run
):
    """Three candidates: each check takes 30 ms and may take 20; none gets a verdict."""

    def three(rollout):
        return np.repeat(kit.Replay(plans.actions)(rollout), 3, axis=0)

    rollout = play("project", 0.03, table(project="reject_candidate"), ticks=4, plan=three)
    told = [(stage, detail) for _, stage, detail in stages(rollout)][:7]
    refused = ("overrun", "project reject_candidate")
    assert told[1:] == [
        refused, ("check", "0.03"), refused, ("check", "0.03"), refused, ("end", "overrun"),
    ]  # fmt: skip
    assert not of_kind(rollout, "candidate") and rollout.tally.rejections == 0
    assert (
        rollout.tally.deadline_misses == rollout.tally.overruns["project", "reject_candidate"] / 3
    )


def test_a_fallback_begins_recovery_at_once(play):
    rollout = play("encode", 0.5, table(encode="fallback"), ticks=12)
    begun = [e for e in of_kind(rollout, "recovery") if e.payload["old"] == "idle"]
    assert begun[0].payload["cause"] == "overrun of encode"
    assert begun[0].t / 1e9 == PERIOD_S
    silent = play("encode", 0.5, table(encode="cancel_candidate"), ticks=12)
    assert not of_kind(silent, "recovery"), "without it only silence leads to recovery"


def test_where_it_goes_on_it_is_counted_and_nothing_else(play, kit, plans):
    slow = play("select", 0.03, table(), ticks=300)
    assert slow.outcome is Outcome.SUCCESS
    assert slow.tally.overruns == {("select", "continue"): slow.invocations}
    held_to_nothing = play("select", 0.03, [], ticks=300)
    told = [row for row in stages(slow) if row[1] != "overrun"]
    assert told == stages(held_to_nothing) and held_to_nothing.tally.overruns == Counter()


def test_a_term_in_time_is_not_touched(play):
    """As long as it may take, and not longer."""
    rollout = play("sample", 0.02, table(sample="cancel_candidate"), ticks=300)
    assert rollout.outcome is Outcome.SUCCESS and not rollout.tally.overruns


def test_the_first_that_ends_it_is_the_last():
    spans = dict.fromkeys(map(str, Term), 0.01) | {"capture": 0.05, "encode": 0.06, "queue": 0.07}
    rows = {term: TermDeadline(0.02, DeadlineAction.CONTINUE) for term in Term}
    assert [(o.term, o.known_s) for o in overruns(spans, rows)] == [
        ("capture", pytest.approx(0.03)), ("encode", pytest.approx(0.11)),
        ("queue", pytest.approx(0.21)),
    ]  # fmt: skip
    for action in ENDING & {a for a in DeadlineAction if Term.ENCODE in FITTING[a]}:
        rows[Term.ENCODE] = TermDeadline(0.02, action)
        assert [one.term for one in overruns(spans, rows)] == ["capture", "encode"]
    assert next(overruns(spans | {"capture": float("nan")}, rows)).term == "capture"


@pytest.mark.parametrize(("change", "said"), [
    (lambda rows: rows[:-1], "no queue"),
    (lambda rows: [*rows, rows[0]], "exposure twice"),
    (lambda rows: [["exposure", 0.02, "shrug"], *rows[1:]], "shrug"),
    (lambda rows: [["exposure", 0.0, "continue"], *rows[1:]], "0.0"),
    (lambda rows: [["exposure", float("nan"), "continue"], *rows[1:]], "nan"),
    (lambda rows: [["shutter", 0.02, "continue"], *rows[1:]], "shutter"),
    (lambda rows: [["exposure", 0.02, "cancel_candidate"], *rows[1:]], "cancel_candidate"),
    (lambda rows: [["exposure", 0.02], *rows[1:]], r"\['exposure', 0.02\]"),
    (lambda rows: ["exposure", *rows[1:]], "'exposure'"),
])  # fmt: skip
def test_a_table_that_leaves_something_open_is_refused_by_name(kit, change, said):
    with pytest.raises(ConfigError, match=f"term_deadlines.*{said}"):
        ExecutionSettings(**kit.PARAMS["execution"] | {"term_deadlines": change(table())})


def test_what_ships_names_every_term_and_every_usual_answer_keeps_it(kit):
    shipped = ExecutionSettings(**kit.PARAMS["execution"]).term_deadlines
    assert set(shipped) == set(Term)
    for term, (_, most_s) in kit.PARAMS["latency"]["declared"].items():
        assert most_s < shipped[term].most_s


ACTIONS = {
    "exposure": "drop_observation", "capture": "drop_observation", "decode": "skip_invocation",
    "transfer": "skip_invocation", "preprocess": "skip_invocation", "encode": "cancel_candidate",
    "sample": "cancel_candidate", "select": "continue", "project": "reject_candidate",
    "network": "reject_stale", "queue": "reject_stale",
}  # fmt: skip
ON_ARRIVAL = ("project", "network", "queue")
"""Terms that are dealt with when the answer comes, and not when their time is over."""


@pytest.fixture
def forged(play, kit, tmp_path):
    """What the checker says of a journal whose invocations were changed, by slow term."""

    def ask(term, change, candidates=()):
        slow_s = 0.11 if term in ON_ARRIVAL else 0.5
        rows = table(**{term: ACTIONS[term]})
        rollout = play(term, slow_s, rows, ticks=14)
        journal = type(rollout.journal)(rollout.journal.session, rollout.journal.labels)
        (begun,) = of_kind(rollout, "session")
        journal.add("session", 0, begun.payload)
        for exposed in of_kind(rollout, "exposure"):
            journal.add("exposure", exposed.t, exposed.payload)
        coming = of_kind(rollout, "arrived")
        number = -1
        for when, stage, detail in change(stages(rollout)):
            while coming and coming[0].t <= when * 1e9 + 1e3:
                journal.add("arrived", coming[0].t, coming.pop(0).payload)
            number += stage == "begin"
            name = f"{journal.session}/{number}"
            journal.invocation(when, invocation_id=name, stage=stage, detail=detail)
        for index in candidates:
            journal.candidate(
                0.3, chunk_id=f"{journal.session}/0", method="scripted", index=index,
                layers={}, first_reason=None, measures={},
            )  # fmt: skip
        for late in coming:
            journal.add("arrived", late.t, late.payload)
        (end,) = of_kind(rollout, "end")
        journal.add("end", end.t, end.payload)
        write_journal(tmp_path / "other.mcap", [journal])
        base = kit.latency()
        declared, measured = (
            {n: slow_s if str(n) == term else USUAL_S for n in names}
            for names in (base.declared, base.measured)
        )
        model = replace(
            base,
            declared={n: DeclaredTerm(span, span) for n, span in declared.items()},
            measured={n: np.full(8, span) for n, span in measured.items()},
        )
        return list(stated_otherwise(tmp_path / "other.mcap", times(model, rows)))

    return ask


def of_overruns(change):
    """A change of every overrun (when, stage, detail) that a journal states."""
    return lambda rows: [change(*row) if row[1] == "overrun" else row for row in rows]


@pytest.mark.parametrize("term", ACTIONS)
def test_a_journal_that_did_what_was_declared_stands(forged, term):
    assert forged(term, lambda rows: rows) == []


@pytest.mark.parametrize("term", [term for term in ACTIONS if term not in ON_ARRIVAL])
def test_what_is_not_done_is_missing(forged, term):
    found = forged(term, lambda rows: [row for row in rows if row[1] != "overrun"])
    assert found and f"states no '{term} {ACTIONS[term]}'" in found[0]


@pytest.mark.parametrize("term", ON_ARRIVAL)
def test_what_had_to_be_refused_when_it_came_may_not_be_judged(forged, term):
    found = forged(term, lambda rows: [r for r in rows if r[1] != "overrun"], candidates=[0])
    assert found and "is judged, and it took longer than it may" in found[0]


@pytest.mark.parametrize("term", [term for term in ACTIONS if term not in ON_ARRIVAL])
def test_what_is_done_too_late_is_no_answer_to_it(forged, term):
    found = forged(term, of_overruns(lambda when, *row: (when + 0.06, *row)))
    assert found and "known at" in found[0]


@pytest.mark.parametrize("term", ACTIONS)
def test_another_action_than_the_declared_one_is_not_owed(forged, term):
    other = "fallback" if ACTIONS[term] == "continue" else "continue"
    found = forged(term, of_overruns(lambda when, stage, _: (when, stage, f"{term} {other}")))
    assert found and f"states '{term} {other}', and that term took no longer" in found[0]


@pytest.mark.parametrize("term", ACTIONS)
def test_an_overrun_of_a_term_that_was_in_time_is_not_owed(forged, term):
    other = "queue" if term != "queue" else "network"
    found = forged(
        term, of_overruns(lambda when, stage, _: (when, stage, f"{other} {ACTIONS[term]}"))
    )
    assert found and f"states '{other} {ACTIONS[term]}', and that term took no" in found[0]
