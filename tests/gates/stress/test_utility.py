"""What a rollout is worth: a failure nothing, a success at least its floor, and costs by hand."""

import evidence
import numpy as np
import pytest
from asked import found_in, settings_of
from hypothesis import given, settings, strategies

from gates.card.rollback import rollback_of
from gates.evidence import Evidence, MissingEvidenceError
from gates.pages.desk_gain import gain_of
from gates.proof import judge
from gates.report import read_report
from gates.stress.gate import best_baseline
from gates.stress.pairs import paired_by_condition, paired_differences
from gates.stress.rollouts import rollouts
from gates.stress.utility import mean_worth, utilities
from gates.stress.weights import LEAST_OF_A_SUCCESS
from gates.words import points
from genpolicy.seeds import stream
from genpolicy.statistics.eprocess import gain_interval, paired_e_value

TABLE = "stress/rollouts.parquet"
LIMIT_S = 12.0
SLOW = {"model": {"duration": (0.5, "slow successes block the cell")}}


def of(root, method, utility):
    plan = settings_of(root, "D").model_copy(update={"utility": utility})
    rows = rollouts(Evidence(root), plan, method)
    return rows, utilities(Evidence(root), plan, method, rows)


def test_the_mean_worth_is_that_of_the_rollouts(ladder):
    plan = settings_of(ladder, "D").model_copy(update={"utility": SLOW})
    rows, worth = of(ladder, "flow", SLOW)
    assert mean_worth(Evidence(ladder), plan, "flow", rows) == worth.mean() < 1.0


def as_json(utility):
    return {o: {n: list(entry) for n, entry in of.items()} for o, of in utility.items()}


def state(root, utility):
    evidence.write_params(root, lambda params: params["gate_d"].update(utility=as_json(utility)))


def lasting(root, seconds, methods):
    """Rollouts of some methods take so long, whatever becomes of them."""
    change = lambda f: f.assign(  # noqa: E731
        duration_s=f["duration_s"].mask(f["method"].isin(methods), seconds)
    )
    evidence.edit_table(root, TABLE, change)


def test_without_weights_it_is_success_to_the_bit(ladder):
    rows, worth = of(ladder, "flow", {})
    np.testing.assert_array_equal(worth, rows["success"].to_numpy(dtype=np.float64))


def test_each_cost_by_hand(ladder):
    won = lambda rows: rows["success"].to_numpy()  # noqa: E731
    rows, worth = of(ladder, "flow", {"model": {"duration": (0.3, "a")}})
    np.testing.assert_allclose(worth, won(rows) * (1 - 0.3 * 8 / LIMIT_S))
    rows, worth = of(ladder, "flow", {"safety": {"fallback": (0.3, "a")}})
    np.testing.assert_allclose(worth, won(rows) * (1 - 0.3 * (8 * 2 / 160) / LIMIT_S))
    rows, worth = of(ladder, "flow", {"safety": {"recovery": (0.3, "a")}})
    drilled = (rows["perturbation"] == "recovery_drill").to_numpy()
    spent_s = np.where(drilled, 2.0 + 0.01 * rows["start"], 0.0)
    np.testing.assert_allclose(worth, won(rows) * (1 - 0.3 * spent_s / LIMIT_S))
    both = {"model": {"duration": (0.3, "a")}, "safety": {"recovery": (0.2, "a")}}
    rows, worth = of(ladder, "flow", both)
    by_hand = won(rows) * (1 - 0.3 * 8 / LIMIT_S - 0.2 * spent_s / LIMIT_S)
    np.testing.assert_allclose(worth, by_hand)


def test_a_failure_is_worth_nothing_however_cheap_and_a_success_its_floor(ladder):
    lasting(ladder, 0.05, ["bc"])
    rows, worth = of(ladder, "bc", SLOW)
    lost = ~rows["success"].to_numpy()
    assert lost.any() and (worth[lost] == 0.0).all()
    lasting(ladder, LIMIT_S, ["bc"])
    rows, worth = of(ladder, "bc", SLOW)
    assert (worth[rows["success"].to_numpy()] == LEAST_OF_A_SUCCESS).all()


@pytest.mark.parametrize(
    ("column", "value", "cost"),
    [("duration_s", 12.1, "duration"), ("duration_s", -0.1, "duration"),
     ("fallback_ticks", 161, "fallback"), ("fallback_ticks", -1, "fallback")],
)  # fmt: skip
def test_a_cost_outside_of_its_rollout_is_no_evidence(ladder, column, value, cost):
    change = lambda f: f.assign(**{column: f[column].mask(f["success"], value)})  # noqa: E731
    evidence.edit_table(ladder, TABLE, change)
    with pytest.raises(MissingEvidenceError, match=r"no part of|more \w+ than a rollout"):
        of(ladder, "flow", {"model": {cost: (0.1, "a")}})


def test_a_gain_of_costs_alone_is_one_of_utility_and_none_of_success(ladder):
    """As many successes as the baseline, each in a sixth of the time: by weights it is promoted."""
    change = lambda f: f.assign(success=True)  # noqa: E731
    evidence.edit_table(ladder, TABLE, change)
    names = settings_of(ladder, "D").baselines
    lasting(ladder, LIMIT_S, names)
    lasting(ladder, 2.0, ["flow", "diffusion"])
    (plain,) = [
        c for c in found_in(judge(ladder, "D"), "promotion_e_value") if c.candidate == "flow"
    ]
    assert plain.verdict == "FAIL"
    state(ladder, SLOW)
    report = judge(ladder, "D")
    (found,) = [c for c in found_in(report, "promotion_e_value") if c.candidate == "flow"]
    gain = 0.5 * (LIMIT_S - 2.0) / LIMIT_S
    assert found.verdict == "PASS" and f"mean gain in utility {points(gain)}" in found.caveat
    assert "in success alone +0 points over" in found.caveat
    assert f"utility on {evidence.STARTS} starts in each condition" in found.caveat
    assert f"inside the envelope {points(gain)} of utility" in found.caveat
    said = gain_of({"D": report}, Evidence(ladder))
    assert f"worth {1 - 0.5 / 6:.3g} against 0.5: +{100 * gain:.3g} points of utility" in said
    plan = settings_of(ladder, "D")
    pairs = paired_differences(Evidence(ladder), plan, report.promoted, names[0])
    low, _ = gain_interval(pairs, alpha=plan.alpha)
    assert f"between +{100 * low:.3g} and" in said
    each = paired_by_condition(Evidence(ladder), plan, "flow", names[0])
    assert all(found.mean() == pytest.approx(gain) for found in each.values())


def test_who_is_the_best_simple_method_is_asked_by_the_same_measure(ladder):
    change = lambda f: f.assign(  # noqa: E731
        success=f["success"] | f["method"].isin(["bc", "act"]) & (f["start"] > 0)
    )
    evidence.edit_table(ladder, TABLE, change)
    more = lambda f: f.assign(success=f["success"] | (f["method"] == "bc"))  # noqa: E731
    evidence.edit_table(ladder, TABLE, more)
    lasting(ladder, LIMIT_S, ["bc"])
    assert best_baseline(Evidence(ladder), settings_of(ladder, "D")) == "bc"
    reports = {gate: read_report(ladder, gate)[0] for gate in "AD"}
    assert rollback_of(reports, Evidence(ladder)).policy == "bc"
    state(ladder, SLOW)
    assert best_baseline(Evidence(ladder), settings_of(ladder, "D")) == "act"
    plan = {**reports["D"].settings, "utility": as_json(SLOW)}
    weighed = reports["D"].model_copy(update={"settings": plan})
    found = rollback_of({**reports, "D": weighed}, Evidence(ladder))
    assert found.policy == "act" and f"at a mean utility of {found.utility:.4g}" in found.text


def test_no_weight_moves_the_answer_to_anything_but_the_gain(ladder):
    """Every other number, limit and verdict is the same: no cost and no stop is for sale."""
    lasting(ladder, 2.0, ["flow", "diffusion"])
    before = judge(ladder, "D")
    state(ladder, SLOW)
    after = judge(ladder, "D")
    answers = lambda report: {  # noqa: E731
        (c.id, c.candidate): (c.measured, c.threshold, c.verdict, c.interval)
        for c in report.criteria
    }
    one, other = answers(before), answers(after)
    assert {key for key in one if one[key] != other[key]} <= {
        ("promotion_e_value", name) for name in before.candidates
    }
    assert one.keys() == other.keys()


@pytest.mark.parametrize(
    ("criterion", "columns", "of_three"),
    [
        ("reset_upper", {"outcome": "force_stop", "success": False}, 1),
        ("intervention_upper", {"interventions": 1}, 1),
        ("force_peak_p95_n", {"force_peak_n": 900.0}, 1),
        ("fallback_share_upper", {"fallback_ticks": 150}, 2),
        ("hold_share_upper", {"hold_ticks": 150}, 2),
    ],
)
def test_a_broken_criterion_stays_broken_under_the_weights_that_suit_it_best(
    ladder, criterion, columns, of_three
):
    """Cheap beyond compare, and dear baselines: the gain is shown, and the candidate is stopped."""

    def plant(frame):
        own = (frame["method"] == "flow") & (frame["start"] % 3 < of_three)
        return frame.assign(**{k: frame[k].mask(own, v) for k, v in columns.items()})

    lasting(ladder, LIMIT_S, settings_of(ladder, "D").baselines)
    lasting(ladder, 1.0, ["flow"])
    evidence.edit_table(ladder, TABLE, plant)
    state(ladder, SLOW)
    report = judge(ladder, "D")
    told = {c.id: c.verdict for c in report.criteria if c.candidate == "flow"}
    assert told["promotion_e_value"] == "PASS" and told[criterion] == "FAIL"
    assert report.candidates["flow"] == "FAIL" and report.promoted != "flow"


@settings(max_examples=60, deadline=None)
@given(strategies.integers(0, 2**32 - 1), strategies.floats(0.0, 0.5))
def test_graded_pairs_are_the_mean_of_the_coins_that_they_are(seed, margin):
    """The identity on which power by coins rests, for one pair and one wager, over both coins."""
    rng = np.random.default_rng(seed)
    own, other = rng.random(2)
    wager = rng.uniform(0.0, 1.0 / (1.0 + margin))
    factor = lambda d: 1.0 + wager * (d - margin)  # noqa: E731
    chances = [(a, b, (own if a else 1 - own) * (other if b else 1 - other))
               for a in (0, 1) for b in (0, 1)]  # fmt: skip
    assert sum(p * factor(a - b) for a, b, p in chances) == pytest.approx(factor(own - other))
    grown = sum(p * np.log(factor(a - b)) for a, b, p in chances)
    assert grown <= np.log(factor(own - other)) + 1e-12


@pytest.mark.parametrize("margin", [0.0, 0.05])
def test_graded_pairs_at_the_margin_are_promoted_in_at_most_alpha_of_trials(margin):
    """Utilities of 0, or in [.5, 1]; the candidate wins by cheaper successes, and more of them."""
    rng, wrong, trials = stream(13, "graded", f"{margin:g}"), 0, 400
    for _ in range(trials):
        own = (rng.random(90) < 0.8) * (1.0 - 0.5 * rng.random(90))
        other = (rng.random(90) < (0.6 - margin) / 0.75) * rng.choice([0.5, 1.0], size=90)
        pairs = own - other
        assert np.all(np.abs(pairs) <= 1.0)
        wrong += paired_e_value(pairs, margin=margin, alpha=0.05).decision == "promote"
    assert wrong / trials <= 0.05
