"""A criterion: named by its function, ordered by definition, its evidence what it read."""

import types

from asking import SPEC, second_in_the_alphabet

from gates.criterion import Criterion, Measured, criteria_of, criterion
from gates.proof import SPECS


def test_identifier_is_the_functions_name_and_order_that_of_definition():
    assert [item.id for item in SPEC.criteria] == [
        "second_in_the_alphabet", "first_in_the_alphabet",
    ]  # fmt: skip


def test_what_a_module_only_imports_is_not_its_own():
    module = types.ModuleType("another")
    module.borrowed = second_in_the_alphabet
    assert criteria_of(vars(module)) == ()


def test_a_number_is_pending_only_where_that_is_said():
    found = Measured(1.0)
    assert (found.interval, found.caveat, found.pending) == (None, "", False)


def test_who_is_asked_of_each_candidate():
    """Of all other criteria the answer is one for all methods."""
    asked = {gate: {i.id for i in s.criteria if i.per_candidate} for gate, s in SPECS.items()}
    assert asked["A"] == asked["E"] == set()
    common = {gate: {i.id for i in s.criteria} - asked[gate] for gate, s in SPECS.items()}
    assert common["B"] == {"baseline_fall_upper"}
    assert common["C"] == {"mutants_undetected", "checker_violations"}
    assert common["D"] == {"verdict_reachable", "checker_violations"}


def test_what_is_said_of_a_criterion_is_what_it_is():
    made = criterion(">=", question="?", look_at="There.")(lambda evidence, settings: None)
    assert (made.comparison, made.question, made.look_at) == (">=", "?", "There.")
    assert (made.per_candidate, made.always, made.derived) == (False, False, None)


def test_every_gate_asks_each_question_once():
    for spec in SPECS.values():
        names = [item.id for item in spec.criteria]
        assert len(names) == len(set(names)) >= 7
        assert all(isinstance(item, Criterion) and item.measure.__doc__ for item in spec.criteria)


def test_what_guards_people_or_the_proof_always_applies():
    always = {gate: {i.id for i in s.criteria if i.always} for gate, s in SPECS.items()}
    assert always["A"] == {
        "unasked_checks", "data_defects", "cause_accepted", "remedy_valid_share",
    }  # fmt: skip
    assert always["B"] == {
        "unpinned_items", "metadata_mismatches", "nfe_mismatch", "nonfinite_weights",
        "samples_difference", "varied_difference", "conformance",
    }  # fmt: skip
    assert always["C"] == {
        "stub_stale", "stub_invalid", "stub_violation_upper", "conservation_error",
        "incidents_miscounted", "checker_violations", "mutants_undetected", "changed_answers",
    }  # fmt: skip
    assert always["D"] == {
        "stub_violations", "conservation_error", "checker_violations", "promotion_e_value",
        "unmatched_starts", "verdict_reachable", "changed_answers",
    }  # fmt: skip
    assert always["E"] == {item.id for item in SPECS["E"].criteria}
