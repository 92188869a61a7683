"""One look: criteria that are broken speak, open ones are unknown, numbers say where they stand."""

import pandas as pd
import pytest
from causes_planted import FLOW
from test_walk import turned

from gates.diagnosis.looking import Look, p95_of, share_of, value_text
from gates.evidence import MissingEvidenceError
from gates.stress.rollouts import ROLLOUTS
from genpolicy.evidence.rows.stress import RolloutRow
from genpolicy.seeds import stream


def test_a_criterion_that_holds_is_a_number_and_no_cause(honest):
    look = Look(honest, FLOW)
    look.criteria("D.hold_share_upper")
    (number,) = look.numbers
    assert number.where == "reports/gate_d.json: hold_share_upper of flow"
    assert number.counted == "80 starts" and number.limit == "<= 25 %" and number.verdict == "PASS"
    assert look.causes == look.unknown == []


def test_a_broken_one_speaks_and_an_open_one_is_not_decided(honest):
    look = Look(turned(honest, "D.hold_share_upper", "FAIL", FLOW), FLOW)
    look.criteria("D.hold_share_upper")
    assert look.causes[0].startswith("hold_share_upper: 5 %, required <= 25 %. Worst in ")
    look = Look(turned(honest, "D.hold_share_upper", "INCONCLUSIVE", FLOW), FLOW)
    look.criteria("D.hold_share_upper")
    assert look.causes == look.unknown == []
    assert look.undecided[0].startswith("hold_share_upper is INCONCLUSIVE, required <= 25 %")


def test_what_only_shows_the_symptom_is_no_cause_even_where_it_is_red(honest):
    look = Look(turned(honest, "B.outside_modes_upper", "FAIL", FLOW), FLOW)
    look.shown("B.outside_modes_upper")
    assert look.causes == [] and look.numbers[0].verdict == "FAIL"


def test_rows_are_those_of_the_candidate_or_of_everybody(honest):
    look = Look(honest, FLOW)
    assert set(look.rows("D", ROLLOUTS, RolloutRow)["method"]) == {FLOW}
    assert "bc" in set(look.rows("D", ROLLOUTS, RolloutRow, all_methods=True)["method"])


def test_a_rule_without_evidence_is_unknown_once(honest):
    def rule(look):
        raise MissingEvidenceError("no table")

    look = Look(honest, FLOW)
    look.ask(rule)
    look.ask(rule)
    assert look.unknown == ["no table"]


def test_a_mistake_of_ours_is_not_taken_for_missing_evidence(honest):
    with pytest.raises(ZeroDivisionError):
        Look(honest, FLOW).ask(lambda look: 1 / 0)


def test_values_are_shown_with_their_interval(honest):
    answer = honest.answer("D.reset_upper", FLOW)
    assert value_text(answer) == "6.77 % (0.0316 to 6.77 %)"
    assert value_text(answer.model_copy(update={"interval": None})) == "6.77 %"


def test_a_share_is_exact_over_clusters_to_both_sides():
    """Ten clusters of two rows, one row in four hit: 5 of 20; Clopper-Pearson at 2 and 3 of 10."""
    hits = pd.Series([True, False, False, False] * 5)
    share, (low, high) = share_of(hits, pd.Series(sorted([*range(10)] * 2)), confidence=0.95)
    assert share == 0.25
    assert low == pytest.approx(0.0252, abs=1e-4) and high == pytest.approx(0.6525, abs=1e-4)


def test_a_quantile_needs_enough_clusters():
    rng = stream(0, "test")
    values = pd.Series(range(100), dtype=float)
    point, (low, high) = p95_of(values, pd.Series(range(100)), confidence=0.95, rng=rng)
    assert point == 95.0 and low <= point <= high
    with pytest.raises(MissingEvidenceError, match="bound no 95% quantile"):
        p95_of(values[:9], pd.Series(range(9)), confidence=0.95, rng=rng)
