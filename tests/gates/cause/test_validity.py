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


def _held(numbers, limits=None):
    """Modes whose success is held to the limit where the cause is named."""
    answers = named(numbers, limits or limit()).answers
    found = [a for a in answers if a.question == "mode_success_lower" and a.limit is not None]
    return [answer.what.split()[2].strip(",") for answer in found]


def test_of_several_choices_the_one_whose_weaker_mode_succeeds_most_is_held():
    worse, better = (GOOD, (38, 40)), ((39, 40), (39, 40))
    assert _held(starts(worse, better)) == ["m2", "m3"]
    assert _held(starts(better, worse)) == ["m0", "m1"]
    assert _held(starts((GOOD, POOR), worse)) == ["m2", "m3"]


def test_the_best_choice_is_the_surest_and_not_the_one_that_may_be_best():
    """Twelve of twelve may be all and are surely fewer than 39 of 40: the lower ends decide."""
    few, many = ((12, 12), (12, 12)), ((39, 40), (39, 40))
    assert clopper_pearson(12, 12)[1] > clopper_pearson(39, 40)[1]
    assert _held(starts(few, many)) == ["m2", "m3"]
    assert _held(starts(many, few)) == ["m0", "m1"]


def test_starts_together_count_from_two_on_and_no_mode_below_the_limit():
    """Seven of ten is the limit itself; six of ten is below it, and surely nothing."""
    seven = [(FEW, FEW)] * 7
    assert named(starts(*seven, (FEW, (7, 10)))).name is CauseName.VALID_MODES
    assert named(starts(*seven, (FEW, (6, 10)))).kind == "success_undecided"
    assert named(starts(*seven, ((6, 10), FEW))).kind == "success_undecided"
    assert named(starts(*[(FEW, FEW)] * 2)).name is CauseName.VALID_MODES
    both = starts(*seven, (FEW, (7, 10)))
    blocked = replace(both.modes[-1], checked=40, admissible=4)
    assert named(replace(both, modes=(*both.modes[:-1], blocked))).name is not CauseName.VALID_MODES


def test_the_modes_of_all_starts_are_taken_together_by_how_frequent_they_are():
    frequent, rare = (12, 12), (9, 10)
    answers = named(starts(*[(rare, frequent), (frequent, rare)] * 4)).answers
    notes = {a.what: a.note for a in answers if "starts together" in a.what}
    assert list(notes.values()) == [
        "100 % (96 of 96 episodes) succeed", "90 % (72 of 80 episodes) succeed",
    ]  # fmt: skip


def test_what_of_one_mode_alone_is_not_recorded_leaves_the_choice_open():
    known, blank = VALID.modes[0], replace(VALID.modes[1], episodes=0, successes=0)
    cause = named(replace(VALID, modes=(known, blank)))
    assert (cause.name, cause.kind) == (CauseName.INSUFFICIENT_SUPPORT, "success_undecided")
    one = replace(VALID.modes[1], episodes=1, successes=1)
    assert named(replace(VALID, modes=(known, one))).kind == "success_undecided"


def test_a_pair_without_a_checked_chunk_is_a_choice_and_is_not_known_to_be_feasible():
    blank = tuple(replace(m, checked=0, admissible=0) for m in VALID.modes)
    numbers = replace(VALID, modes=blank)
    assert named(numbers).name is CauseName.VALID_MODES
    assert asked_of_every_mode(numbers, "mode_feasible_share").measured is None
    one = tuple(replace(m, checked=1, admissible=1) for m in VALID.modes)
    assert asked_of_every_mode(replace(VALID, modes=one), "mode_feasible_share").measured == 1.0


def test_a_mode_beside_the_choice_is_no_target_where_it_surely_fails_or_breaks_limits():
    upper = clopper_pearson(5, 10, 0.95)[1]
    few = ModeOutcome("few", "approach", 10, 5, 0.2, upper, 40, 40)

    def asked(mode, question="mode_success_lower", **limits):
        numbers = replace(VALID, modes=(*VALID.modes, mode))
        return deciding_answer(question, numbers, limit(**limits))

    # Up to the upper end itself nothing is claimed of it.
    assert not asked(few, mode_success_lower=upper).red
    assert asked(few, mode_success_lower=upper + 1e-9).red
    assert "few" in asked(few, mode_success_lower=upper + 1e-9).what
    blank = replace(few, episodes=0, successes=0)
    assert asked(blank).measured is None and "few" in asked(blank).what
    assert asked(replace(few, admissible=35), "mode_feasible_share").red
    assert not asked(replace(few, admissible=36), "mode_feasible_share").red


def test_a_success_that_is_known_has_its_interval():
    answer = asked_of_every_mode(VALID)
    assert answer.interval == clopper_pearson(39, 40) and answer.measured == answer.interval[0]
    blank = asked_of_every_mode(BLANK)
    assert (blank.measured, blank.interval) == (None, None)
