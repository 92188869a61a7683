"""A verdict on one training says so, wherever somebody reads it."""

import html
import re

import pytest

from gates.card.signing import read_draft
from gates.claim import CHECKPOINT_ONLY, IN_SHORT
from gates.pages.page import gate_page
from gates.pages.summary import markdown, plain
from gates.proof import judge


def test_the_decision_to_promote_names_the_checkpoint_only(ladder):
    report = judge(ladder, "D")
    assert report.promoted and f", {IN_SHORT}" in report.decision
    assert IN_SHORT in markdown(report).split("##")[0]


@pytest.mark.parametrize("gate", "BD")
def test_page_and_summary_claim_this_checkpoint_only(ladder, gate):
    report = judge(ladder, gate)
    assert CHECKPOINT_ONLY in report.caveats
    assert plain(CHECKPOINT_ONLY) in markdown(report)
    page = html.unescape(re.sub(r"\s+", " ", gate_page(ladder, report)))
    assert CHECKPOINT_ONLY in page


def test_the_card_says_it_first(ladder):
    assert read_draft(ladder).caveats[0] == CHECKPOINT_ONLY
