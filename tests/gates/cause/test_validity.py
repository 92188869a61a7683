"""Outcomes that were not recorded restrict what is said, and replace nothing that was found."""

from dataclasses import replace

import pytest
from planted import HIDDEN, VALID, limit, named

from gates.cause import CauseName, deciding_answer
from genpolicy.audit.reach_rows import Alternative
from genpolicy.audit.rows import ModeOutcome
from genpolicy.statistics.intervals import clopper_pearson

BLANK = replace(VALID, modes=tuple(replace(m, episodes=0, successes=0) for m in VALID.modes))


def test_modes_without_outcomes_are_reported_and_not_called_valid():
    cause = named(BLANK)
    assert (cause.name, cause.text) == (
        CauseName.INSUFFICIENT_SUPPORT, "insufficient_support(outcome)",
    )  # fmt: skip
    assert cause.kind == "not_recorded"
    assert "2 modes of position were found in 45 of 50 held-out episodes" in cause.next_action
    assert "95% of the episodes keep their mode" in " ".join(cause.found)
    assert "operator tells most of them: 5%" in " ".join(cause.found)


def test_what_tells_no_more_than_a_guess_is_said_so():
    told = replace(VALID.told[0], told=-0.9, told_lower=-1.2, told_upper=-0.5)
    assert named(replace(VALID, told=(told,))).found[-1] == (
        "Of 1 variable operator tells most of them, and no more than a guess."
    )


def test_a_hidden_variable_stays_one_whatever_the_outcomes():
    cause = named(replace(BLANK, strata=(HIDDEN,)))
    assert (cause.name, cause.variable) == (CauseName.HIDDEN_STATE, "operator")
    assert cause.found


def test_without_modes_nothing_is_said_to_have_been_found():
    assert named(replace(VALID, counts=replace(VALID.counts, two_mode_episodes=0))).found == ()


def starts(*counts):
    """Numbers with two modes a start: (successes, episodes) of one, and of the other."""
    modes, pairs = [], []
    for first, second in counts:
        names = []
        for successes, episodes in (first, second):
            names.append(f"m{len(modes)}")
            ends = clopper_pearson(successes, episodes)
            modes.append(ModeOutcome(names[-1], "approach", episodes, successes, *ends, 0, 0))
        pairs.append(Alternative("approach", *names, 10))
    return replace(VALID, modes=tuple(modes), alternatives=tuple(pairs))


GOOD, FEW, POOR = (40, 40), (10, 10), (8, 40)


@pytest.mark.parametrize(
    ("numbers", "name", "kind"),
    [
        (starts((GOOD, GOOD)), "valid_modes", ""),
        (starts((GOOD, POOR)), "unimodal", "one_valid_mode"),
        # Two good modes of two starts are no choice.
        (starts((GOOD, POOR), (GOOD, POOR)), "unimodal", "one_valid_mode"),
        (starts((GOOD, POOR), (GOOD, GOOD)), "valid_modes", ""),
        # Ten of ten prove nothing at one start, and something at four.
        (starts((FEW, FEW)), "insufficient_support", "success_undecided"),
        (starts(*[(FEW, FEW)] * 4), "valid_modes", ""),
        (starts(*[(FEW, FEW)] * 4, (FEW, (5, 10))), "insufficient_support", "success_undecided"),
        (starts(*[(FEW, FEW)] * 4, (FEW, (1, 10))), "insufficient_support", "success_undecided"),
        (starts(*[(FEW, (1, 10))] * 4), "unimodal", "one_valid_mode"),
        (replace(starts((GOOD, GOOD)), alternatives=()), "insufficient_support", "linking"),
    ],
)
def test_a_choice_is_between_modes_of_one_observation_that_both_succeed(numbers, name, kind):
    cause = named(numbers)
    assert (cause.name, cause.kind) == (name, kind)


def test_second_modes_of_all_starts_are_held_to_the_limit_together():
    weak = [(FEW, (8, 10))] * 4
    assert named(starts(*weak)).kind == "success_undecided"
    assert named(starts(*weak), limit(mode_success_lower=0.6)).name == CauseName.VALID_MODES


def test_modes_of_a_chain_of_situations_are_of_one_start():
    numbers = starts((FEW, FEW), (FEW, FEW))
    joined = replace(
        numbers, alternatives=(*numbers.alternatives, Alternative("approach", "m1", "m2", 3))
    )
    assert named(numbers).name == CauseName.VALID_MODES
    assert named(joined).kind == "success_undecided"


def test_a_mode_that_is_not_feasible_is_no_part_of_a_choice():
    numbers = starts((GOOD, GOOD))
    blocked = replace(numbers.modes[1], checked=40, admissible=4)
    assert named(replace(numbers, modes=(numbers.modes[0], blocked))).kind == "one_valid_mode"


def asked_of_every_mode(numbers, question="mode_success_lower"):
    return deciding_answer(question, numbers, limit())


def test_a_mode_that_surely_fails_is_held_to_the_limit_wherever_it_stands():
    """Beside a good pair, beside a choice that all starts show together, and in another phase."""
    failing = ModeOutcome("lost", "approach", 40, 0, 0.0, 0.1, 40, 40)
    pooled = starts(*[(FEW, FEW)] * 4)
    for numbers in (starts((GOOD, GOOD)), pooled):
        assert not asked_of_every_mode(numbers).red
        beside = replace(numbers, modes=(*numbers.modes, failing))
        elsewhere = replace(numbers, elsewhere=(replace(failing, phase="retreat"),))
        for found in map(asked_of_every_mode, (beside, elsewhere)):
            assert found.red and "lost" in found.what and found.measured < 0.2


def test_a_mode_elsewhere_of_which_nothing_was_checked_is_not_known():
    blank = ModeOutcome("lost", "retreat", 40, 40, 0.9, 1.0, 0, 0)
    assert asked_of_every_mode(VALID, "mode_feasible_share").measured == 0.96
    found = asked_of_every_mode(replace(VALID, elsewhere=(blank,)), "mode_feasible_share")
    assert found.measured is None and "lost" in found.what
