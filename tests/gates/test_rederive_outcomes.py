"""An outcome that never happened is refused, though its journal and its row agree on it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from gates import rederive_monitors as monitors
from gates import rederive_outcomes as module
from gates.played_again import Recorded, recorded_rollouts
from gates.rederive_monitors import rederive_probed_outcomes
from gates.rederive_outcomes import rederive_outcomes
from gates.rederive_searched import rederive_searched_outcomes
from genpolicy.errors import BadInputError, RefusedError
from genpolicy.evidence.admission_context import make_checker
from genpolicy.evidence.monitors.plan import starts_of
from genpolicy.evidence.stress.matched import matched_starts
from genpolicy.evidence.stress.perturbations import Nominal, SidewaysPush
from genpolicy.evidence.stress.rollout import Rollout
from genpolicy.evidence.stress.state import Outcome, Setup
from genpolicy.execution.checks import without
from genpolicy.execution.journal import Journal, decode_actions, encode_actions, write_journal
from genpolicy.feasibility.checks import CHECKS as LAYER_CHECKS
from genpolicy.tasks.tabletop_insertion.episodes import demonstrate
from tests.evidence.stress.conftest import (
    EXECUTION,
    FEASIBILITY,
    HORIZONS,
    PARAMS,
    Replay,
    drive,
    latency,
    straight,
)

PUSH = {"kind": "push", "force_n": 15.0, "contact_force_n": 30.0}
HARD = PUSH | {"contact_force_n": 130.0}
LIMIT_S = 8.0
PROBE = "contact_anomaly@2"


@pytest.fixture(scope="module")
def params():
    stress = PARAMS["stress"] | {"starts": 3, "episode_limit_s": LIMIT_S}
    stress |= {"perturbations": {"nominal": {}, "push": PUSH, "hard": HARD}, "severities": {}}
    return PARAMS | {"stress": stress, "task": {"name": "tabletop_insertion"}}


@pytest.fixture(scope="module")
def roll_out(task):
    """Rollouts of some starts, each under a script of its own; no layer sees what it hits."""
    checker = make_checker(
        task, FEASIBILITY, action_period_s=HORIZONS.action_period_s,
        checks=without(LAYER_CHECKS, "scene_collision", "swept_collision"),
    )  # fmt: skip

    def go(starts, scripts, *, condition="nominal", schedule=None, probe="nominal"):
        specs = task.episode_specs(5, len(starts), shares={"nominal": 1.0})
        done = [demonstrate(replace(s, start=b)) for s, b in zip(specs, starts, strict=True)]
        plan = Replay({number: item.actions for number, item in enumerate(done)})
        setup = Setup(
            task=task, checker=checker, horizons=HORIZONS, execution=EXECUTION, latency=latency(),
            perturbation=condition, schedule=schedule or Nominal(), root_seed=PARAMS["seed"],
            method="flow", checkpoint="w" * 64, sampler="s" * 64, probe=probe,
        )  # fmt: skip
        epoch = task.calibration_epochs[-1]
        made = [Rollout(setup, start, n, calibration_epoch=epoch) for n, start in enumerate(starts)]
        ticks = round(LIMIT_S / HORIZONS.action_period_s)
        return drive(made, lambda one: scripts[one.start_index](plan, one), ticks=ticks)

    return go


def does(plan, rollout):
    """What was demonstrated."""
    return plan(rollout)


def rests(plan, rollout):
    return np.tile(rollout.world.last_action, (HORIZONS.prediction_horizon, 1))[None]


@pytest.fixture(scope="module")
def rollouts(task, roll_out):
    """One that succeeds, one that collides and one whose time runs out; and some that are pushed.

    Of those some touch the target and succeed, and of those that are pushed hard one is stopped.
    """
    starts = matched_starts(task, root_seed=PARAMS["seed"], count=3)
    push, hard = SidewaysPush(**PUSH), SidewaysPush(**HARD)
    made = {
        "nominal": roll_out(starts, (does, lambda _, one: straight(one), rests)),
        "push": roll_out(starts, (does, does, does), condition="push", schedule=push),
        "hard": roll_out(starts, (does, does, does), condition="hard", schedule=hard),
    }
    ends = [one.outcome for one in made["nominal"]]
    assert ends == [Outcome.SUCCESS, Outcome.COLLISION, Outcome.TIMEOUT]
    pushed = [one for one in made["push"] if one.outcome is Outcome.SUCCESS]
    assert any(one.tally.force_peak_n > 5.0 for one in pushed), "one succeeds after contact"
    assert Outcome.FORCE_STOP in [one.outcome for one in made["hard"]]
    return made


@pytest.fixture
def asked(rollouts, params, tmp_path):
    """Asks of the rollouts of a condition, their journals as `change` tells them."""

    def ask(condition="nominal", change=lambda one, kind, t, p: p, *, late_ns=0):
        told = []
        for number, one in enumerate(rollouts[condition]):
            journal = Journal(one.journal.session, one.journal.labels)
            for event in one.journal.events():
                payload = change(number, event.kind, event.t, event.payload)
                if payload is not None:
                    journal.add(event.kind, event.t + late_ns * (event.kind == "accept"), payload)
            told.append(journal)
        path = tmp_path / f"flow__{condition}.mcap"
        write_journal(path, told)
        rederive_outcomes(params, [path])

    return ask


def told_of(number, kind, **changes):
    """A change of one kind of event in one rollout."""
    return lambda one, k, t, p: p | changes if (one, k) == (number, kind) else p


def at_tick(number, kind, tick, change):
    """A change of the event of a kind at one tick of one rollout."""
    time_ns = round(tick * HORIZONS.action_period_s * 1e9)
    return lambda one, k, t, p: change(p) if (one, k, t) == (number, kind, time_ns) else p


@pytest.mark.parametrize("condition", ["nominal", "push", "hard"])
def test_what_happened_stands(asked, condition):
    asked(condition)


@pytest.mark.parametrize(
    ("number", "outcome", "said"),
    [
        (1, "success", "success after .* s, required collision after"),
        (1, "force_stop", "force_stop after .* s, required collision after"),
        (2, "force_stop", r"force_stop at 0\.0 N, required more than [\d.]+ N, which every"),
        (1, "intervention", "intervention after .* s, required collision after"),
        (2, "success", "success after 8.000 s, required nothing of the kind"),
        (2, "assisted", "assisted after 8.000 s, required nothing of the kind"),
        (2, "collision", "collision after 8.000 s, required nothing of the kind"),
        (0, "collision", "collision after .* s, required success after"),
        (0, "intervention", "intervention after .* s, required success after"),
        (0, "won", "won, required an end of a rollout"),
    ],
)
def test_an_outcome_that_never_happened_is_refused_by_name(asked, number, outcome, said):
    with pytest.raises(RefusedError, match=rf"flow/nominal/{number}: outcome is {said}"):
        asked(change=told_of(number, "outcome", outcome=outcome))


def test_a_timeout_before_the_time_is_over_is_refused(asked):
    with pytest.raises(RefusedError, match=r"flow/nominal/0: ends is timeout after .*8\.000 s"):
        asked(change=told_of(0, "outcome", outcome="timeout"))


def test_nothing_goes_on_behind_the_end_of_the_time(asked, params, monkeypatch):
    monkeypatch.setitem(params["stress"], "episode_limit_s", 4.0)
    with pytest.raises(RefusedError, match=r"ends is success after [5-7].*over after 4\.000 s"):
        asked()
    endless = Recorded({}, outcome="success", end_ns=1 << 62)  # counted, never played
    with pytest.raises(RefusedError, match="ends is success after"):
        module._ends_in_time(module.cells_of("D", None, params, None), "one", endless)


def test_another_command_leads_elsewhere(asked):
    def aside(p):
        action = decode_actions(p["action"]).copy()
        action[:, 1] += 1e-3
        return p | {"action": encode_actions(action)}

    with pytest.raises(RefusedError, match=r"measured at 2\.050 s is q_rad up to .* beside it"):
        asked(change=at_tick(0, "accept", 40, aside))


def test_a_command_that_is_left_out_between_two_ticks_or_one_too_many_is_refused(asked):
    with pytest.raises(RefusedError, match=r"measured at 2\.050 s is"):
        asked(change=at_tick(0, "accept", 40, lambda p: None))
    with pytest.raises(RefusedError, match=r"commanded is something at \d+1 ns, required one"):
        asked(late_ns=1)


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("q_rad", lambda v: [v[0] + 1e-4, *v[1:]], r"q_rad up to 0\.0001 beside it"),
        ("q_rad", lambda v: v[:-1], "q_rad up to inf beside it"),
        ("tcp_m", lambda v: [v[0], v[1], 1e3], "tcp_m up to"),
        ("gripper_m", lambda v: v + 0.01, r"gripper_m up to 0\.01 beside it"),
        ("force_n", lambda v: v + 0.5, "0.5 N"),
    ],
)
def test_a_state_to_which_no_command_leads_is_refused(asked, name, value, said):
    change = at_tick(2, "state", 90, lambda p: p | {name: value(p[name])})
    with pytest.raises(RefusedError, match=rf"flow/nominal/2: measured at 4\.500 s is {said}"):
        asked(change=change)


def test_a_force_that_was_felt_and_is_hidden_is_refused(asked):
    with pytest.raises(RefusedError, match=r"flow/push/\d: measured at .* is 0\.0 N, required"):
        asked("push", lambda one, kind, t, p: p | {"force_n": 0.0} if kind == "state" else p)


def test_a_push_that_was_left_out_was_felt(asked):
    with pytest.raises(RefusedError, match=r"flow/push/0: measured at .* beside it"):
        asked("push", lambda one, kind, t, p: None if kind == "push" else p)


def test_a_journal_without_states_cannot_be_asked_and_is_refused(asked):
    """An older one has none, and what it says of outcomes is proved by nothing."""
    with pytest.raises(RefusedError, match=r"measured at 0\.000 s is nothing, required a state"):
        asked(change=lambda one, kind, t, p: None if kind == "state" else p)
    with pytest.raises(RefusedError, match="outcome is nothing, required an end"):
        asked(change=lambda one, kind, t, p: None if kind == "outcome" else p)


@pytest.mark.parametrize("start", ["3", "-1", "first"])
def test_a_start_that_nobody_planned_is_bad_input(asked, rollouts, monkeypatch, start):
    monkeypatch.setitem(rollouts["nominal"][0].journal.labels, "start", start)

    def change(one, kind, t, p):
        return p | {"labels": p["labels"] | {"start": start}} if kind == "session" else p

    with pytest.raises(BadInputError, match="an event that cannot be read"):
        asked(change=change)


def test_what_a_tenth_of_a_micrometre_turns_over_may_be_either(asked, monkeypatch):
    """Another processor rounds, and an end at the edge is no lie of whoever found the other.

    Where it ends and what it measures part together: what belongs to another end is no excuse.
    """
    played = module._played

    def either(which, apart):
        def at_the_edge(cells, recorded, moved_m=0.0):
            again = played(cells, recorded)
            if which(moved_m):
                return again
            ended = None if apart == "ends" else again.ended
            states = [s | {"force_n": s["force_n"] + (apart == "feels")} for s in again.states]
            return replace(again, ended=ended, states=states)

        monkeypatch.setattr(module, "_played", at_the_edge)
        asked()

    for apart, said in (("ends", "outcome is success"), ("feels", r"measured at 0\.000 s is 0")):
        with pytest.raises(RefusedError, match=said):
            either(lambda moved_m: False, apart)
        for sign in (0, 1, -1):
            either(lambda moved_m, sign=sign: np.sign(moved_m) == sign, apart)


def test_the_states_of_one_way_and_the_end_of_another_are_none_of_both(asked, monkeypatch):
    played = module._played

    def parted(cells, recorded, moved_m=0.0):
        again = played(cells, recorded)
        if moved_m:
            return replace(again, states=[s | {"gripper_m": 1.0} for s in again.states])
        return replace(again, ended=None)

    monkeypatch.setattr(module, "_played", parted)
    with pytest.raises(RefusedError, match=r"outcome is success after .* nothing of the kind"):
        asked()


def test_of_every_rollout_and_not_of_a_sample_it_is_known_when_it_may_end(asked, monkeypatch):
    monkeypatch.setattr(module, "_asked", lambda *given: [])
    with pytest.raises(RefusedError, match=r"flow/nominal/0: ends is timeout after"):
        asked(change=told_of(0, "outcome", outcome="timeout"))
    with pytest.raises(RefusedError, match=r"flow/nominal/0: outcome is force_stop at"):
        asked(change=told_of(0, "outcome", outcome="force_stop"))


def test_rollouts_under_a_probe_begin_in_its_world_and_nobody_pushes_there(
    task, roll_out, params, tmp_path, monkeypatch
):
    settings = {
        "kinds": ["support"], "threshold_starts": 1, "judged_starts": 1, "probe_starts": 1,
        "probes": {"contact_anomaly": {"severities": [2.0]}},
    }  # fmt: skip
    watched = params | {"monitors": settings}
    (text,) = starts_of(task, "probed", root_seed=PARAMS["seed"], count=1)
    start = task.start_from_json(text)
    made = roll_out([start], (does,), condition=PROBE, probe=PROBE)
    path = tmp_path / "flow__probe.mcap"
    write_journal(path, [one.journal for one in made])
    drawn = []
    own = lambda *given, **more: drawn.append(given) or starts_of(*given, **more)  # noqa: E731
    monkeypatch.setattr(monitors, "starts_of", own)
    other = tmp_path / "mip__probe.mcap"
    write_journal(other, [one.journal for one in made])
    rederive_probed_outcomes(watched, [path, other])
    assert len(drawn) == 1, "the starts of a kind are drawn once, not for each rollout"
    push = SidewaysPush(force_n=15.0)
    made = roll_out([start], (does,), condition=PROBE, probe=PROBE, schedule=push)
    write_journal(path, [one.journal for one in made])
    with pytest.raises(RefusedError, match="pushes is some, required none, as planned"):
        rederive_probed_outcomes(watched, [path])


def test_rollouts_of_a_search_begin_where_it_asked(task, rollouts, params, tmp_path):
    path = tmp_path / "flow__nominal.mcap"
    write_journal(path, [one.journal for one in rollouts["nominal"]])
    starts = matched_starts(task, root_seed=PARAMS["seed"], count=3)
    named = {"method": "flow", "perturbation": "nominal"}
    rows = [SimpleNamespace(**named, start=n, scene_start=s.to_json())
            for n, s in enumerate(starts)]  # fmt: skip
    rederive_searched_outcomes(params, rows, [path])
    rows[0].scene_start, rows[1].scene_start = rows[1].scene_start, rows[0].scene_start
    with pytest.raises(RefusedError, match=r"Gate E refuses: .*measured at 0\.000 s"):
        rederive_searched_outcomes(params, rows, [path])


def test_a_rollout_is_played_as_it_was_rolled_out_to_the_last_bit(rollouts, params, tmp_path):
    """On one machine; what a tick of the world is, both have to agree on."""
    path = tmp_path / "flow__push.mcap"
    write_journal(path, [one.journal for one in rollouts["push"]])
    recorded = recorded_rollouts(path)
    task, begun = rollouts["push"][0].setup.task, []
    starts = matched_starts(task, root_seed=PARAMS["seed"], count=3)

    def begin(labels):
        begun.append(module.world_at(task, starts, labels))
        return begun[-1]

    cells = module.cells_of("D", task, params, begin)
    for one in rollouts["push"]:
        again = module._played(cells, recorded[one.journal.session])
        states = [e.payload for e in one.journal.events() if e.kind == "state"]
        assert list(again.states) == states
        assert begun[-1].state_sha256() == one.world.state_sha256()


def test_a_command_that_is_no_action_is_bad_input_or_refused(asked):
    short = at_tick(0, "accept", 40, lambda p: p | {"action": p["action"][:16]})
    with pytest.raises(BadInputError, match="an event that cannot be read"):
        asked(change=short)
