"""Outcomes that were not recorded restrict what is said, and replace nothing that was found."""

from dataclasses import replace

from planted import HIDDEN, VALID, named

from gates.cause import CauseName

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


def test_a_hidden_variable_stays_one_whatever_the_outcomes():
    cause = named(replace(BLANK, strata=(HIDDEN,)))
    assert (cause.name, cause.variable) == (CauseName.HIDDEN_STATE, "operator")
    assert cause.found


def test_without_modes_nothing_is_said_to_have_been_found():
    assert named(replace(VALID, counts=replace(VALID.counts, two_mode_episodes=0))).found == ()
