"""A policy's process that fails costs a deadline, and its journal says how it failed."""

from collections import Counter

import numpy as np
import pytest

from genpolicy.candidates.wire.faults import Fault
from genpolicy.candidates.wire.policy import WireSamples
from genpolicy.contract.latency import Term
from genpolicy.evidence.stress.latency import DeclaredTerm
from genpolicy.evidence.stress.matched import step
from genpolicy.evidence.stress.rollout import Rollout
from genpolicy.evidence.stress.state import Outcome
from genpolicy.execution.cell import ExecutionSettings
from genpolicy.verification.checker import check_messages
from genpolicy.verification.owed import Times, stated_otherwise
from genpolicy.verification.rollouts import derived_with_recoveries
from genpolicy.verification.tables import derived_tables

DEADLINE_NS, PERIOD_NS = 150_000_000, 50_000_000


class Failing:
    """Goes on with the demonstrated plan, but for invocations of some numbers, which fail."""

    stochastic = False

    def __init__(self, plan, rollout, faults):
        self.plan, self.rollout, self.faults = plan, rollout, faults

    def sample(self, observations, *, noise_names, candidates, prefix=None):
        """As a policy behind the wire: NaN and a kind of fault where there is no answer."""
        fault = self.faults.get(noise_names[0][3])
        chunks = np.asarray(self.plan(self.rollout))
        if fault is not None:
            chunks = np.full_like(chunks, np.nan)
        return WireSamples(chunks[None], 1, (fault,))


@pytest.fixture
def play(make_fixture, kit, plans):
    """A rollout in which the invocations of these numbers, from 1, fail."""

    def go(faults, *, ticks=300, **changes):
        setup = make_fixture(**changes)
        rollout = Rollout(setup, plans.starts[0], 0, calibration_epoch=kit.EPOCH)
        policy = Failing(kit.Replay(plans.actions), rollout, faults)
        for _ in range(ticks):
            if not rollout.done:
                step([rollout], policy, samples=1)
        rollout.end(Outcome.TIMEOUT)
        return rollout

    return go


def invocations(rollout):
    return [event for event in rollout.journal.events() if event.kind == "invocation"]


def test_it_is_a_missed_deadline_with_its_kind_beside_it(play, kit, tmp_path):
    rollout = play({2: Fault.LATE, 3: Fault.SHAPE, 5: Fault.LATE})
    assert rollout.outcome is Outcome.SUCCESS  # what it failed it makes up for by others
    tally = rollout.tally
    assert tally.faults == Counter(late=2, shape=1)
    assert tally.deadline_misses == 3
    # As without a fault: on some processors this plan is refused once, whatever fails.
    plain = play({}).tally
    assert (tally.rejections, tally.rejected_by) == (plain.rejections, plain.rejected_by)
    told = invocations(rollout)
    failed = [n for n, event in enumerate(told) if event.payload["stage"] == "fault"]
    assert [told[n].payload["detail"] for n in failed] == ["late", "shape", "late"]
    for n in failed:
        begun, fault, end = told[n - 1 : n + 2]
        assert (end.payload["stage"], end.payload["detail"]) == ("end", "deadline")
        assert begun.payload["id"] == fault.payload["id"] == end.payload["id"]
        # From what it saw to the deadline; it began when that arrived, within a few ms.
        seen_ns = begun.t - begun.t % PERIOD_NS
        assert fault.t == end.t == seen_ns + DEADLINE_NS and begun.t - seen_ns < 10_000_000
    assert kit.check([rollout], tmp_path).violations == []
    assert rollout.executor.conservation().error == 0
    path = tmp_path / "journal.mcap"
    (derived,) = derived_with_recoveries(path)[0].values()
    assert derived["deadline_misses"] == 3
    counted = {row["fault"]: row["count"] for row in derived_tables([path])["faults"]}
    assert counted == {"late": 2, "shape": 1}


def test_a_policy_that_never_answers_is_a_rollout_of_misses_and_no_exception(play, kit, tmp_path):
    rollout = play(dict.fromkeys(range(1, 1000), Fault.GONE), ticks=40)
    tally = rollout.tally
    assert tally.action_ticks == 0 and tally.deadline_misses == tally.faults["gone"] > 3
    assert kit.check([rollout], tmp_path).violations == []


def test_a_journal_that_hides_or_invents_a_fault_is_found(play, kit, tmp_path):
    rollout = play({2: Fault.LATE}, ticks=40)
    events = rollout.journal.events()

    def rules(events):
        made = [(e.kind, {"session": "s", "t": e.t, **e.payload}) for e in events]
        numbered = [(kind, {**m, "n": n}) for n, (kind, m) in enumerate(made)]
        return {violation.rule for violation in check_messages(numbered).violations}

    (at,) = [n for n, event in enumerate(events) if event.payload.get("stage") == "fault"]
    assert rules(events) == set()
    assert "clock.fault" in rules(events[: at + 1] + events[at + 2 :])  # no missed deadline
    answered = [n for n, e in enumerate(events) if e.payload.get("detail") == "answered"]
    first = events[answered[0]].payload["id"]
    events[at].payload["id"] = first
    assert "clock.fault" in rules(events)


def test_a_term_that_ends_it_before_the_deadline_says_the_fault_too(play, kit, tmp_path):
    """A slow encoder is cut off after 20 ms; that the process failed as well stands beside it."""
    rows = [[str(term), 0.02, "cancel_candidate" if term == "encode" else "continue"]
            for term in Term]  # fmt: skip
    execution = ExecutionSettings(**kit.PARAMS["execution"] | {"term_deadlines": rows})
    base = kit.latency(0.01)
    measured = {name: np.full(8, 0.5 if name == "encode" else 0.002) for name in base.measured}
    model = type(base)(base.declared, measured, 0.0)
    rollout = play({1: Fault.REFUSED}, ticks=3, execution=execution, latency=model)
    told = [(e.payload["stage"], e.payload["detail"]) for e in invocations(rollout)]
    assert told[1:4] == [
        ("overrun", "encode cancel_candidate"), ("fault", "refused"), ("end", "overrun"),
    ]  # fmt: skip
    assert kit.check([rollout], tmp_path, execution=execution).violations == []


@pytest.mark.parametrize("seconds", [0.002, 0.4])
def test_what_a_failed_invocation_owes_ends_with_its_deadline(play, kit, tmp_path, seconds):
    """The queue would have taken too long after the deadline: nobody waits for that."""
    rows = [[str(term), 0.02, "continue"] for term in Term]
    execution = ExecutionSettings(**kit.PARAMS["execution"] | {"term_deadlines": rows})
    base = kit.latency(0.01)
    declared = {name: DeclaredTerm(0.002, 0.002) for name in base.declared}
    measured = {name: np.full(8, 0.002) for name in base.measured} | {"sample": np.full(8, seconds)}
    declared["queue"] = DeclaredTerm(0.5, 0.5)
    model = type(base)(declared, measured, 0.0)
    rollout = play(
        dict.fromkeys(range(1, 99), Fault.CLOSED), ticks=40, execution=execution, latency=model
    )
    assert kit.check([rollout], tmp_path, execution=execution).violations == []
    table = [
        {"method": "scripted", "run": 1, "process": 1, "component": str(name), "repeat": repeat,
         "temperature": how, "source": "measured", "seconds": float(value)}
        for name, spans in measured.items() for how in ("cold", "warm")
        for repeat, value in enumerate(spans)
    ]  # fmt: skip
    times = Times(
        table,
        declared={str(n): (own.minimum_s, own.maximum_s) for n, own in declared.items()},
        perturbations={"nominal": {"kind": "nominal"}},
        root_seed=kit.ROOT_SEED,
        deadlines={term: (most_s, action) for term, most_s, action in rows},
    )
    assert list(stated_otherwise(tmp_path / "journal.mcap", times)) == []
