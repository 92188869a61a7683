"""Of fifteen looks one is bad by luck: it is no FAIL, and it is no PASS either."""

import pytest

from benchmarks.decision.recovery import drawn, failed_before, verdict
from gates.stress.safety import groups_of, shown_by
from genpolicy.seeds import stream
from genpolicy.statistics.intervals import clopper_pearson

LEAST, CONFIDENCE, STARTS, TRIALS = 0.5, 0.95, 90, 120
LEVEL = (1.0 - CONFIDENCE) / 2.0


def entries(share):
    return [drawn(share, STARTS, stream(5, "luck", trial)) for trial in range(TRIALS)]


def asked(rows):
    return {"least": LEAST, "confidence": CONFIDENCE, "rows": rows}


def test_a_policy_at_the_limit_fails_no_oftener_than_one_bound_is_wrong():
    """The same draws failed far oftener where each group was held to the level of one look."""
    drawn_ = entries(LEAST)
    assert len(list(groups_of(drawn_[0]))) == 15
    now = sum(verdict(**asked(rows)) == "FAIL" for rows in drawn_)
    before = sum(failed_before(**asked(rows)) for rows in drawn_)
    assert clopper_pearson(now, TRIALS)[0] <= LEVEL < clopper_pearson(before, TRIALS)[0]


def test_nothing_passes_that_did_not_pass_before():
    """Whatever speaks against a group at the level of one look still keeps the gate from a PASS."""
    for rows in entries(0.7):
        lone = [group.measured(rows, least=LEAST, among=1, confidence=CONFIDENCE)
                for group in groups_of(rows)]  # fmt: skip
        passed = min(one.bound for one in lone if one is not None) >= LEAST
        assert (verdict(**asked(rows)) == "PASS") == passed


@pytest.mark.parametrize("share", [0.1, 0.25])
def test_a_policy_that_is_bad_is_still_shown_to_be(share):
    rows = drawn(share, STARTS, stream(5, "bad"))
    assert verdict(**asked(rows)) == "FAIL" and "at best" in shown_by(**asked(rows)).caveat
