"""What a plan can decide is what the gate would say of such rollouts."""

import json
import math
from pathlib import Path

import evidence
import numpy as np
import pandas as pd
import pytest
import yaml

from gates import planning
from gates.bounds import counted_interval, share_interval, upper_quantile
from gates.evidence import MissingEvidenceError
from gates.planning import Bound, Gain, Plan, Stated, _counted, plan_of, plan_text
from gates.proof import judge
from gates.settings import read_params
from gates.stress.cost import _rollouts_with
from gates.stress.rollouts import StressSettings
from genpolicy.cli.main import main
from genpolicy.errors import ConfigError
from genpolicy.evidence.stress.tables import POWER_CORRELATION
from genpolicy.seeds import stream
from genpolicy.statistics.eprocess import power_table

ROOT = Path(__file__).parents[2]
TRIALS = 400


@pytest.fixture
def planned(tmp_path, monkeypatch):
    """The plan of the checkout with parts of section `stress` changed; few simulated trials."""
    monkeypatch.setattr(planning, "POWER_TRIALS", TRIALS)

    def plan(**changes):
        params = read_params(ROOT)
        params = {**params, "stress": {**params["stress"], **changes}}
        (tmp_path / "params.yaml").write_text(yaml.safe_dump(params))
        return plan_of(tmp_path)

    return plan


def by_name(plan):
    return {bound.criterion: bound for bound in plan.bounds}


def limit(gate, name):
    owners = read_params(ROOT)["gate_d"]["limits"].values()
    return next(entries[name][0] for entries in owners if name in entries)


def hit(hits, starts):
    return pd.DataFrame({
        "perturbation": ["nominal"] * starts, "start": range(starts),
        "hit": [number < hits for number in range(starts)],
    })  # fmt: skip


@pytest.mark.parametrize("starts", [36, 90])
@pytest.mark.parametrize("name", ["intervention_upper", "reset_upper"])
def test_most_failures_are_those_with_which_the_gate_passes(planned, name, starts):
    bound = by_name(planned(starts=starts))[name]
    most = int(bound.says.split()[2])
    settings = StressSettings.model_construct(perturbations=("nominal",), confidence=0.95)
    values = [_rollouts_with(hit(hits, starts), settings).value for hits in (most, most + 1)]
    assert values[0] <= limit("D", name) < values[1]
    assert bound.decidable is True


@pytest.mark.parametrize("name", ["nominal_success_lower", "stress_success_lower"])
def test_fewest_successes_are_those_with_which_the_gate_passes(planned, name):
    bound = by_name(planned())[name]
    fewest = int(bound.says.split()[1])
    for successes, kept in ((fewest, True), (fewest - 1, False)):
        rows = hit(successes, 90)
        lower = share_interval(rows["hit"], rows["start"], confidence=0.95, favourable=True)[1]
        assert (lower >= limit("D", name)) == kept
    assert bound.decidable is True


def test_three_starts_decide_nothing_and_the_plan_says_so(planned):
    """Of three starts without any reset the bound is .708, and of three successes .292."""
    plan = planned(starts=3)
    found = by_name(plan)
    assert found["reset_upper"].says == "none of 3 bounds it by 0.708 only"
    assert found["nominal_success_lower"].says == "3 of 3 successes show 0.292 only"
    assert found["recovery_success_lower"].says == "3 of 3 recoveries show 0.292 only"
    assert found["force_peak_p95_n"].says == "3 starts bound no p95, 72 do"
    assert found["latency_p95_s"].decidable is None
    assert set(plan.undecidable) == {
        "verdict_reachable", "nominal_success_lower", "stress_success_lower",
        "recovery_success_lower", "force_peak_p95_n", "intervention_upper", "reset_upper",
    }  # fmt: skip
    assert "INCONCLUSIVE whatever the rollouts show: " in plan_text(plan)
    assert all(gain.candidate_success is None for gain in plan.gains)


@pytest.mark.parametrize("starts", [71, 72])
def test_a_p95_takes_as_many_starts_as_bound_it(planned, starts):
    """The gate's own quantile of so many starts, each its own draw."""
    found = by_name(planned(starts=starts))
    values = pd.Series(range(starts), dtype=float).to_numpy()
    try:
        upper_quantile(values, list(map(str, range(starts))), 0.95, confidence=0.95,
                       rng=stream(1, "any"))  # fmt: skip
        bounded = True
    except MissingEvidenceError:
        bounded = False
    assert bounded == (starts == 72)
    assert found["force_peak_p95_n"].decidable == bounded
    assert found["latency_p95_s"].decidable == (True if bounded else None)


def test_the_smallest_gain_is_found_and_one_point_less_is_not(planned):
    plan = planned()
    settings = read_params(ROOT)
    for gain in plan.gains:
        if gain.candidate_success is None:
            assert gain.promote_share < plan.power
            continue
        for less, enough in ((0.0, True), (0.01, False)):
            (row,) = power_table(
                [(gain.baseline_success, gain.candidate_success - less)], margin=plan.margin,
                alpha=plan.alpha, pairs=90, correlation=POWER_CORRELATION, trials=TRIALS,
                rng=stream(settings["seed"], "plan", f"{gain.baseline_success:g}"),
            )  # fmt: skip
            assert (row.promote_share >= plan.power) == enough
    shown = [gain for gain in plan.gains if gain.candidate_success is not None]
    assert len(shown) >= 3
    assert {gain.baseline_success for gain in plan.gains} >= {0.1, 0.5, 0.9}


def test_more_starts_find_smaller_gains(planned):
    few, many = planned(starts=60), planned(starts=240)
    for before, after in zip(few.gains, many.gains, strict=True):
        if before.candidate_success is not None:
            assert after.candidate_success < before.candidate_success


def test_rollouts_and_time_are_those_of_methods_conditions_and_starts(planned):
    params = read_params(ROOT)
    methods = {*params["train_generators"]["samplers"], *params["stress"]["baselines"]}
    plan = planned(starts=90, episode_limit_s=6.0)
    assert plan.rollouts == len(methods) * len(params["stress"]["perturbations"]) * 90
    assert plan.longest_s == plan.rollouts * 6.0


def test_what_is_waived_is_said_and_blocks_nothing(tmp_path, planned):
    planned(starts=3)
    path = tmp_path / "params.yaml"
    params = yaml.safe_load(path.read_text())
    safety = params["gate_d"]["limits"]["safety"]
    del safety["force_peak_p95_n"]
    params["gate_d"]["not_applicable"] = {"safety": {"force_peak_p95_n": "nothing is touched"}}
    path.write_text(yaml.safe_dump(params))
    plan = plan_of(tmp_path)
    assert by_name(plan)["force_peak_p95_n"].says == "declared not applicable"
    assert "force_peak_p95_n" not in plan.undecidable


@pytest.mark.parametrize(("starts", "code"), [(3, 3), (90, 0)])
def test_the_command_leaves_with_3_where_nothing_can_be_decided(
    planned, tmp_path, capsys, starts, code
):
    planned(starts=starts)
    assert main(["plan", "--root", str(tmp_path)]) == code
    text = capsys.readouterr().out
    assert max(map(len, text.splitlines())) <= 80
    assert main(["plan", "--root", str(tmp_path), "--json"]) == code
    document = json.loads(capsys.readouterr().out)
    assert document["starts"] == starts and bool(document["undecidable"]) == (code == 3)


def test_a_plan_without_its_section_is_bad_configuration(tmp_path):
    (tmp_path / "params.yaml").write_text("{}\n")
    with pytest.raises(ConfigError, match="gate_d"):
        plan_of(tmp_path)


def promoted_by(starts, *, baseline, candidate, correlation, margin, alpha):
    """Chance that the e-process has reached 1 / alpha after each number of starts, exactly.

    Independent of the product: the evidence depends on wins and losses alone, whose distribution
    is carried from start to start; what has reached the threshold leaves.

    Returns:
        Shape (starts,).
    """
    wins = correlation * max(candidate - baseline, 0.0)
    wins += (1.0 - correlation) * candidate * (1.0 - baseline)
    losses = correlation * max(baseline - candidate, 0.0)
    losses += (1.0 - correlation) * baseline * (1.0 - candidate)
    some = np.arange(starts + 1)
    a, c = some[:, None], some[None, :]
    left, reached, path = np.zeros((starts + 1, starts + 1)), 0.0, []
    left[0, 0] = 1.0
    for n in range(1, starts + 1):
        after = left * (1.0 - wins - losses)
        after[1:] += left[:-1] * wins
        after[:, 1:] += left[:, :-1] * losses
        value = np.zeros_like(after)
        for share in (0.35, 0.45, 0.55, 0.65, 0.75, 0.85):
            stake = share / (1.0 + margin)
            value += np.exp(
                a * math.log1p(stake * (1 - margin)) + c * math.log1p(-stake * (1 + margin))
                + (n - a - c) * math.log1p(-stake * margin)
            ) / 6  # fmt: skip
        over = (value >= 1.0 / alpha) & (a + c <= n)
        reached += after[over].sum()
        left = np.where(over, 0.0, after)
        path.append(reached)
    return np.array(path)


def test_golden_power_and_starts_needed_are_those_of_an_exact_calculation(planned, monkeypatch):
    """The shipped plan: dynamic programming over wins and losses gives .8624 and 80 starts."""
    monkeypatch.setattr(planning, "POWER_TRIALS", 4000)
    plan = planned()
    exact = promoted_by(
        200, baseline=0.5, candidate=0.8, correlation=POWER_CORRELATION, margin=plan.margin,
        alpha=plan.alpha,
    )  # fmt: skip
    assert exact[plan.starts - 1] == pytest.approx(0.86243, abs=1e-5)
    error = math.sqrt(exact[89] * (1 - exact[89]) / 4000)
    assert abs(plan.stated.promote_share - exact[89]) < 4 * error
    least = int(np.flatnonzero(exact >= plan.power)[0]) + 1
    assert least == 80
    # What 4000 trials blur: starts at which the exact share lies within four errors of the power.
    near = np.flatnonzero(np.abs(exact - plan.power) < 4 * error) + 1
    assert near[0] <= plan.stated.starts_needed <= near[-1] + 1


def test_golden_smallest_gains_are_those_of_an_exact_calculation(planned, monkeypatch):
    """The same calculation: at the gain that is named enough is found, two points below not."""
    monkeypatch.setattr(planning, "POWER_TRIALS", 4000)
    plan = planned()
    for gain in plan.gains:
        if gain.candidate_success is None:
            continue
        for less, enough in ((-0.01, True), (0.02, False)):
            exact = promoted_by(
                90, baseline=gain.baseline_success, candidate=gain.candidate_success - less,
                correlation=POWER_CORRELATION, margin=plan.margin, alpha=plan.alpha,
            )  # fmt: skip
            assert (exact[-1] >= plan.power) == enough


@pytest.mark.parametrize(("starts", "verdict"), [(76, "INCONCLUSIVE"), (90, "PASS")])
def test_the_gate_says_of_its_power_what_the_plan_said(planned, repo, starts, verdict):
    """One table, one rule: 76 starts find the shipped effect too seldom, 90 often enough."""
    plan = planned(starts=starts)
    settings = {"starts": starts, "margin": 0.05, "alpha": 0.05, "planned_effect": [0.5, 0.8]}
    share = plan.stated.promote_share

    def change(params):
        params["stress"] = {**params["stress"], **settings}

    evidence.write_params(repo, change)
    row = {"baseline_success": 0.5, "correlation": 0.3, "margin": 0.05, "pairs": starts,
           "median_pairs": None}  # fmt: skip
    evidence.edit_document(
        repo, "stress/power.json",
        lambda _: {"margin": 0.05, "alpha": 0.025, "pairs": starts, "rows": [
            {**row, "candidate_success": 0.8, "promote_share": share, "return_share": 1 - share},
            {**row, "candidate_success": 0.55, "promote_share": 0.01, "return_share": 0.99},
        ]},
    )  # fmt: skip
    (found,) = [a for a in judge(repo, "D").criteria if a.id == "verdict_reachable"]
    assert found.verdict == verdict
    bound = by_name(plan)["verdict_reachable"]
    assert bound.decidable == (verdict == "PASS")
    assert bound.says.split(";")[0] == found.caveat.removeprefix("not measured: ").split(";")[0]
    assert ("verdict_reachable" in plan.undecidable) == (verdict == "INCONCLUSIVE")


def test_an_effect_that_no_number_of_starts_finds_is_said(planned, monkeypatch):
    monkeypatch.setattr(planning, "MOST_STARTS", 20)
    plan = planned()
    assert plan.stated.starts_needed is None
    assert "in 80% not even by 20 starts" in plan_text(plan)


def made(*bounds, gains=(), needed=77):
    return Plan(
        starts=90, methods=8, conditions=("nominal", "push"), candidates=("diffusion", "flow"),
        rollouts=12_600, longest_s=63_000.0, margin=0.05, alpha=0.0125, power=0.8,
        stated=Stated(0.5, 0.8, 0.86, needed), bounds=bounds, gains=gains,
    )  # fmt: skip


def test_golden_what_a_person_reads_of_a_plan():
    """Written by hand: a mark, a column as wide as the longest name, and lines of 80 that hang."""
    long = "none of 90 bounds it by 0.0324 only, whatever is done and however often it is run"
    text = plan_text(made(
        Bound("kept", True, "up to 3 of 90"), Bound("never_kept", False, long),
        Bound("open", None, "declared not applicable"),
        gains=(Gain(0.1, 0.29, 0.81), Gain(0.95, None, 0.34)),
    ))  # fmt: skip
    assert text.splitlines() == [
        "90 starts of 8 methods in 2 conditions: 12,600 rollouts,",
        "at most 17.5 h of virtual time",
        "2 registered candidates, each at alpha 0.0125; margin 0.05",
        "",
        "The stated effect: success 80% against 50% (stress.planned_effect)",
        "  found in 86% of trials with 90 starts; in 80% from about 77 starts on",
        "",
        "What these starts can show",
        "  kept        up to 3 of 90",
        "! never_kept  none of 90 bounds it by 0.0324 only, whatever is done and however",
        "              often it is run",
        "? open        declared not applicable",
        "",
        "Smallest gain that is found in 80% of trials with 90 starts",
        "  baseline 10%: 19 points, a candidate of 29%",
        "  baseline 95%: none; a candidate that never fails in 34% only",
        "",
        "Gate D would be INCONCLUSIVE whatever the rollouts show: never_kept. Plan more",
        "starts (stress.starts) before any is run.",
    ]


def test_a_plan_that_can_be_decided_warns_of_nothing():
    for plan in (made(), made(Bound("kept", True, "x"), Bound("open", None, "y"))):
        assert "INCONCLUSIVE" not in plan_text(plan) and plan.undecidable == ()
    found = made(Bound("kept", True, "x"), Bound("b", False, "y"), Bound("a", False, "z"))
    assert found.undecidable == found.as_document()["undecidable"] == ("b", "a")


@pytest.mark.parametrize("name", ["intervention_upper", "nominal_success_lower"])
def test_a_limit_at_the_bound_itself_is_kept(name):
    """The least hits keep it where it lies at their very end, and none where it lies beside."""
    low, high = counted_interval(3, 30, confidence=0.95)
    at, step = (high, -1e-9) if name == "intervention_upper" else (low, 1e-9)
    assert " 3 " in _counted(name, at, 30, 0.95).says
    assert " 3 " not in _counted(name, at + step, 30, 0.95).says
