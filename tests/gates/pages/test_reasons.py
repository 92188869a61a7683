"""Reasons in words: every one of them."""

from gates.feasibility.settings import REASONS
from gates.pages.reasons import REASON_WORDS, said
from genpolicy.feasibility.reasons import Reason


def test_every_reason_is_said_in_words_and_in_the_order_of_the_checks():
    assert tuple(REASON_WORDS) == REASONS == tuple(Reason)
    assert len(set(REASON_WORDS.values())) == len(REASON_WORDS)
    assert all(text and not text.endswith(".") for text in REASON_WORDS.values())
    assert said("joint_jerk") == "joint jerk"
