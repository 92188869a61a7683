"""No verdict claims modes, or their absence, where nobody looked."""

from dataclasses import replace

from planted import VALID, component, counts, named

from gates.cause.numbers import Labels

ONE_ACTION = counts(two_mode_episodes=0, two_mode=0, persistent=0)


def with_component(numbers, name, **changes):
    return replace(
        numbers,
        components=tuple(
            replace(item, **changes) if item.component == name else item
            for item in numbers.components
        ),
    )


def test_one_action_says_where_it_was_looked_for_and_where_not():
    text = named(ONE_ACTION).next_action
    assert "in position, rotation and timing (gripper hardly varies)" in text
    without = with_component(ONE_ACTION, "rotation", state="absent", situations=0)
    assert "the action has no rotation" in named(without).next_action


def test_one_action_is_not_said_of_what_could_not_be_read():
    cause = named(with_component(ONE_ACTION, "rotation", state="unreadable", situations=0))
    assert (cause.text, cause.kind) == ("insufficient_support(rotation)", "component")
    both = with_component(ONE_ACTION, "rotation", state="unreadable", situations=0)
    both = with_component(both, "timing", state="unreadable", situations=0)
    cause = named(both)
    assert cause.text == "insufficient_support(rotation)" and "timing" in cause.next_action
    # Modes that were found stay found.
    assert named(with_component(VALID, "rotation", state="unreadable")).name == "valid_modes"


def test_modes_beside_those_followed_are_named_and_not_vouched_for():
    assert "others were found" not in named(VALID).next_action
    found = with_component(VALID, "rotation", two_mode=60, two_mode_episodes=30)
    text = named(found).next_action
    assert "This is about the modes of position" in text and "rotation (30 episodes)" in text
    assert named(found).beside[1:] == (text[text.index("This is about") :],)


def test_where_was_looked_is_said_beside_every_cause_that_speaks_of_modes():
    looked = "Modes were looked for in position, rotation and timing (gripper hardly varies)"
    for numbers in (VALID, ONE_ACTION):
        [said] = named(numbers).beside
        assert said == f"{looked}, of each component by itself."
    assert named(replace(VALID, components=())).beside == ()
    defect = named(replace(VALID, labels=Labels(60, 12)))
    assert defect.name == "label_contamination" and defect.beside == ()


def test_every_component_stands_among_the_answers():
    answers = [a for a in named(VALID).answers if a.question == "component_modes"]
    assert [answer.measured for answer in answers] == [45.0, 0.0, None, None, 0.0]
    assert "from 0.15 rad apart on" in answers[1].note
    assert "hardly varies" in answers[2].note and "the action has none" in answers[3].note
    assert all(answer.holds is None for answer in answers)


def test_a_component_without_a_spread_is_told_without_it():
    answers = named(replace(VALID, components=(component("position", spread=None),))).answers
    note = next(a.note for a in answers if a.question == "component_modes")
    assert "spread" not in note
