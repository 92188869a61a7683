"""Who can no longer pass: a pure function of rows, never wrong about a verdict of all starts."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from benchmarks.decision.worlds import CONDITIONS, World, draw
from gates.stress.cost import STOPS
from gates.stress.gains import inside_pairs, least_gain
from gates.stress.rollouts import NOMINAL, StressSettings
from genpolicy.errors import ContractError
from genpolicy.evidence.blocks_run import blocks_document
from genpolicy.evidence.rows.stress import RolloutRow
from genpolicy.seeds import stream
from genpolicy.statistics import planned_blocks
from genpolicy.statistics.eprocess import paired_e_value
from genpolicy.statistics.intervals import clopper_pearson
from genpolicy.statistics.planned_blocks import Counted, Rule, planned_rule
from genpolicy.statistics.possible import (
    GAIN,
    STOPPED,
    Seen,
    due,
    first_out,
    out_after,
    seen_of,
)

STARTS, BLOCK, MARGIN, ALPHA = 90, 15, 0.05, 0.05 / 3
SIMPLE = ("simple_0", "simple_1")
OWN = "candidate_0"


def rule(**other):
    given = {
        "starts": STARTS, "block": BLOCK, "conditions": CONDITIONS, "simple": SIMPLE,
        "margin": MARGIN, "alpha": ALPHA, "rehearsal": False,
    }  # fmt: skip
    return planned_rule(**given | other)


def seen(success, reset=None, intervention=None):
    """From arrays of shape (conditions, starts)."""
    success = np.asarray(success, dtype=bool)
    none = np.zeros_like(success)
    return Seen(success, none if intervention is None else intervention,
                none if reset is None else reset)  # fmt: skip


def alone(success, other=None, *, bound=None, **arguments):
    """A candidate and one simple method in one condition."""
    counted = () if bound is None else (Counted(*bound),)
    plan = Rule(len(success), 5, ("nominal",), ("simple_0",), 0.0, 0.05, counted, 0.9)
    plan = replace(plan, **arguments)
    other = np.zeros(len(success)) if other is None else other
    return plan, {OWN: seen([success]), "simple_0": seen([other])}


def test_out_is_who_cannot_reach_the_evidence_by_winning_every_start_that_is_left():
    plan, both = alone(np.zeros(20), np.ones(20))
    for starts in (5, 10, 15):
        won = np.concatenate([-np.ones(starts), np.ones(20 - starts)])
        best = paired_e_value(won, margin=0.0, alpha=0.05).e_value
        found = out_after(plan, both, OWN, starts)
        assert (found is not None) == (best < 20.0)
        if found:
            assert found.criterion == GAIN and found.value == pytest.approx(best)
            assert f"won it all of the {20 - starts} left" in found.said
            assert "over simple_0" in found.said
    end, first = first_out(plan, both, OWN)
    assert end in (5, 10, 15) and first.criterion == GAIN
    assert end == 5 or out_after(plan, both, OWN, end - 5) is None


def test_who_has_shown_a_gain_is_never_out_by_it():
    """What was shown stays shown: ten wins, and nothing but losses behind them."""
    won = np.concatenate([np.ones(10), np.zeros(30)])
    plan, both = alone(won, 1.0 - won)
    assert paired_e_value(2.0 * won - 1.0, margin=0.0, alpha=0.05).decision == "promote"
    assert first_out(plan, both, OWN) is None


def test_one_simple_method_that_cannot_be_beaten_is_enough():
    plan, both = alone(np.ones(20))
    assert first_out(plan, both, OWN) is None
    plan = replace(plan, simple=SIMPLE)
    both["simple_1"] = seen([np.ones(20)])
    assert first_out(plan, both, OWN) is not None
    assert "over simple_1" in first_out(plan, both, OWN)[1].said


@pytest.mark.parametrize("what", ["success", "reset", "intervention"])
def test_a_bound_is_broken_where_no_rest_keeps_it(what):
    """By one more hit than the planned starts forgive, and not by one less."""
    starts, limit = 40, 0.3
    good = what == "success"
    kept = [
        hits for hits in range(starts + 1)
        if (clopper_pearson(hits, starts, 0.9)[0] >= limit if good
            else clopper_pearson(hits, starts, 0.9)[1] <= limit)
    ]  # fmt: skip
    most = starts - min(kept) if good else max(kept)
    for bad, out in ((most, False), (most + 1, True)):
        hits = np.arange(starts) < bad
        own = seen([~hits if good else np.ones(starts)],
                   reset=hits[None] if what == "reset" else None,
                   intervention=hits[None] if what == "intervention" else None)  # fmt: skip
        bound = ("named", what, ("nominal",), limit)
        plan, both = alone(np.ones(starts), bound=bound, alpha=0.9, block=starts - 1)
        found = out_after(plan, {**both, OWN: own}, OWN, starts - 1)
        assert (found is not None) == out
        if out:
            assert found.criterion == "named" and found.limit == limit
            assert f"of {starts - 1} in nominal count for `named`" in found.said


def test_bounds_are_asked_in_their_own_conditions():
    plan = rule()
    where = {bound.criterion: bound.conditions for bound in plan.counted}
    assert where["nominal_success_lower"] == (NOMINAL,)
    assert where["stress_success_lower"] == tuple(n for n in CONDITIONS if n != NOMINAL)
    assert where["reset_upper"] == where["intervention_upper"] == CONDITIONS
    assert rule(rehearsal=True).counted == ()


def test_the_loosest_limits_are_those_that_the_gates_let_nobody_go_beyond():
    from gates.floors import BOUNDS

    bounds = {bound.place: bound for bound in BOUNDS if bound.gate == "D"}
    for criterion, what, limit in planned_blocks.COUNTED:
        assert bounds[criterion].bound == limit and bounds[criterion].waivable is None
        assert bounds[criterion].comparison == (">=" if what == "success" else "<=")
    assert bounds["confidence"].bound == planned_blocks.CONFIDENCE
    assert bounds["confidence"].comparison == ">=" and GAIN not in bounds
    assert tuple(STOPPED) == tuple(STOPS) and planned_blocks.NOMINAL == NOMINAL


def test_blocks_end_with_the_planned_starts():
    assert rule(block=40).ends == (40, 80, 90) and rule(block=45).ends == (45, 90)
    assert [rule(block=40).number(n) for n in (40, 80, 90, 41)] == [1, 2, 3, None]
    assert rule(block=STARTS) is rule(block=STARTS + 1) is rule(block=None) is None


def test_costs_that_are_weighed_want_all_starts_in_one_block():
    with pytest.raises(Exception, match=r"stress\.block is 15 of 90 starts, with gate_d\.utility"):
        rule(costs=True)
    assert rule(costs=True, block=None) is None
    weighed = planned_blocks.weighed
    assert weighed({"utility": {"model": {}}}) and not weighed({"utility": {}})
    assert not weighed(None) and not weighed([]) and not weighed({})


def row(method, condition, start, outcome="success", interventions=0):
    won = outcome == "success"
    return RolloutRow(
        method, 0, condition, start, "ab", outcome, won, 1.0, 20, 20, 0, 0, 4, 0, 0, 0, "", False,
        False, interventions, 0.0, None, None, None, None, 0.0, "left",
    )  # fmt: skip


def rows(plan, starts=3):
    ends = ("success", "collision", "force_stop", "timeout")
    return [
        row(method, condition, start, ends[(start + n) % 4], interventions=start % 2)
        for n, (method, condition) in enumerate(product((OWN, *SIMPLE), plan.conditions))
        for start in range(starts)
    ]


def test_rows_count_alike_in_whatever_order_they_come():
    plan = rule()
    given = [*rows(plan), row(OWN, "push@20", 0)]  # a graded size is not judged
    one = seen_of(given, plan)
    for seed in range(3):
        other = seen_of([given[i] for i in stream(seed, "order").permutation(len(given))], plan)
        assert set(other) == set(one) == {OWN, *SIMPLE}
        for name, own in one.items():
            for field in ("success", "intervention", "reset"):
                np.testing.assert_array_equal(getattr(other[name], field), getattr(own, field))
            assert own.starts == 3
    assert one[OWN].reset[0].tolist() == [False, True, True]
    assert one[OWN].intervention[0].tolist() == [False, True, False]
    assert one[OWN].success[0].tolist() == [True, False, False]


@pytest.mark.parametrize(
    ("change", "said"),
    [(lambda r: r[1:], "2 in nominal, 3 in camera_delay"), (lambda r: [*r, r[0]], "start 0 twice"),
     (lambda r: [row(OWN, NOMINAL, 7), *r[1:]], "expected the same starts, from 0 on")],
)  # fmt: skip
def test_starts_that_differ_between_conditions_are_refused(change, said):
    plan = rule()
    with pytest.raises(ContractError, match=said):
        seen_of(change(rows(plan)), plan)


def test_a_simple_method_with_fewer_starts_says_nothing_of_anybody():
    plan, both = alone(np.zeros(20), np.ones(20))
    short = both | {"simple_0": seen([np.ones(9)])}
    with pytest.raises(ContractError, match=r"rollouts of simple_0 is 9 starts where candidate_0"):
        out_after(plan, short, OWN, 10)
    with pytest.raises(ContractError, match="rollouts of simple_0 is 0 starts"):
        out_after(plan, {OWN: both[OWN]}, OWN, 5)


def test_candidates_run_until_they_are_out_and_simple_methods_as_long_as_one_is_in():
    plan, both = alone(np.zeros(20), np.ones(20))
    end, _ = first_out(plan, both, OWN)
    better = seen([np.ones(20)])
    both["simple_0"] = seen([np.zeros(20)])
    assert first_out(plan, both, OWN) is None or end  # without a loss it lasts longer
    both["simple_0"] = seen([np.arange(20) % 2 == 0])
    out = first_out(plan, both, OWN)
    assert out is not None
    with_one_in = both | {"candidate_1": better}
    assert due(plan, with_one_in, [OWN, "candidate_1"]) == {
        OWN: out[0], "candidate_1": 20, "simple_0": 20,
    }  # fmt: skip
    assert due(plan, both, [OWN]) == {OWN: out[0], "simple_0": out[0]}
    assert due(plan, both, []) == {"simple_0": 20}
    said = blocks_document(plan, with_one_in | {OWN: seen([np.zeros(out[0])])})
    assert said.last == {OWN: out[0] // 5, "candidate_1": 4, "simple_0": 4}
    assert said.out == {OWN: GAIN} and (said.block, said.starts) == (5, 20)
    odd = blocks_document(plan, both | {OWN: seen([np.zeros(7)])})
    assert odd.last[OWN] == 0  # ends with no block


GAINS = (-0.3, -0.2, -0.1, 0.0, 0.05, 0.1, 0.2, 0.3)
TRIALS = 60


def trial(gain, number):
    """One trial of a world with this gain: both candidates gain it, and stop now and then."""
    world = World("w", "", ("promoted",), (0.5, 0.4), (0.5 + gain, 0.5 + gain / 2))
    rng = stream(7, "blocks", f"{gain:g}", number)
    drawn = draw(world, STARTS, rng)
    found = {name: seen(drawn.baselines[n]) for n, name in enumerate(SIMPLE)}
    often = rng.choice([0.0, 0.02, 0.1])
    for n, own in enumerate(drawn.candidates):
        reset = ~own.astype(bool) & (rng.random(own.shape) < often)
        called = rng.random(own.shape) < often
        found[f"candidate_{n}"] = seen(own, reset, called)
    return found


def passes(plan, found, name):
    """Whether a candidate passes by all starts: the gate's rule, and every bound of a count."""
    settings = StressSettings.model_construct(margin=MARGIN, family_alpha=ALPHA, candidates=("x",))
    own = found[name].success.astype(float)
    pairs = {other: own - found[other].success for other in SIMPLE}
    envelope = CONDITIONS.index("envelope")
    inside = inside_pairs({other: of[envelope] for other, of in pairs.items()}, settings)
    means = {other: of.mean(axis=0) for other, of in pairs.items()}
    measured = least_gain(means, inside, settings).measured
    kept = all(
        clopper_pearson(hits, STARTS, 0.95)[0] >= bound.limit if bound.what == "success"
        else clopper_pearson(hits, STARTS, 0.95)[1] <= bound.limit
        for bound in plan.counted for condition in bound.conditions
        for hits in [int(getattr(found[name], bound.what)[CONDITIONS.index(condition)].sum())]
    )  # fmt: skip
    return measured is not None and measured >= 1.0 / ALPHA and kept


@pytest.mark.parametrize("gain", GAINS)
def test_no_trial_that_would_pass_is_stopped_and_the_verdict_is_the_same(gain):
    plan, stopped, promoted, whys = rule(), 0, 0, set()
    for number in range(TRIALS):
        found = trial(gain, number)
        for name in ("candidate_0", "candidate_1"):
            out, full = first_out(plan, found, name), passes(plan, found, name)
            in_blocks = False if out else full
            assert in_blocks == full, (gain, number, name, out)
            promoted += full
            if out:
                stopped += 1
                whys.add(out[1].criterion)
                later = [end for end in plan.ends[:-1] if end > out[0]]
                assert all(out_after(plan, found, name, end) for end in later)
    if gain <= 0.0:
        assert stopped > 1.4 * TRIALS and promoted == 0  # nearly all of both
    if gain == 0.3:
        assert promoted > 0.3 * TRIALS and stopped < 1.2 * TRIALS
    assert GAIN in whys and whys <= {GAIN, *(c for c, _, _ in planned_blocks.COUNTED)}
