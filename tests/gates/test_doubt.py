"""What a doubt names, how many more there are, and what is said once for several."""

import pytest

from gates.doubt import Doubt, named, said_once, texts_once


@pytest.mark.parametrize(("count", "said"), [
    (1, "a"), (3, "a, b, c"), (4, "a, b, c and 1 more"), (6, "a, b, c and 3 more"),
])  # fmt: skip
def test_three_are_named_and_the_others_counted(count, said):
    assert named("abcdef"[:count]) == said


NAMES = ("act", "flow", "flow_policy")


@pytest.mark.parametrize(
    ("said", "once"),
    [
        (["act: far.", "flow: far."], ["act and flow, each: far."]),
        (["flow: far.", "Alone.", "act: far."], ["flow and act, each: far.", "Alone."]),
        (["act: far.", "flow: farther."], ["act: far.", "flow: farther."]),
        (["How? (act) So.", "How? (flow) So.", "How? (flow_policy) So."],
         ["How? (act, flow and flow_policy, each) So."]),
        (["How? (act) So.", "Why? (flow) So."], ["How? (act) So.", "Why? (flow) So."]),
        (["act: act moved.", "flow: flow moved."], ["act: act moved.", "flow: flow moved."]),
        (["bc: far.", "act: far."], ["bc: far.", "act: far."]),
    ],
)  # fmt: skip
def test_what_holds_of_several_candidates_alike_is_said_once_with_their_names(said, once):
    """A name stands at the head or behind the question; another sentence stays another."""
    assert texts_once(said, NAMES) == once


def test_the_criterion_of_several_is_that_of_the_question_and_each_kind_stays_its_own():
    near, cold = (
        [Doubt("D", kind, f"How? ({who}) So.", ("x",), who) for who in ("act", "flow")]
        for kind in ("near", "cold")
    )
    other = Doubt("C", "near", "How? (act) So.", ("x",), "act")
    assert said_once([*near, *cold, other], NAMES) == [
        Doubt("D", "near", "How? (act and flow, each) So.", ("x",)),
        Doubt("D", "cold", "How? (act and flow, each) So.", ("x",)),
        other,
    ]


def test_the_same_words_about_two_gates_are_said_once_with_both():
    seed = [Doubt(gate, "seed", "act, flow: trained once", (gate,)) for gate in "BD"]
    assert said_once(seed, NAMES) == [
        Doubt("B", "seed", "act, flow: trained once", ("B",), also=("D",))
    ]
