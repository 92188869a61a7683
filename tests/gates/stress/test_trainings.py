"""What the trainings of a method say of it, and that they decide nothing."""

import evidence
import numpy as np
import pytest
from asked import settings_of
from trained_more import ROLLOUTS, trained_more

from gates.claim import CHECKPOINT_ONLY, ONE_OF_SEVERAL
from gates.evidence import Evidence, MissingEvidenceError
from gates.pages.page import gate_page
from gates.proof import judge
from gates.stress.trainings import CLAIMED, UNCLAIMED, claim_of, over_trainings, within
from genpolicy.integrity.rows import read_rows

FLOW = "flow"
GOOD = {
    (FLOW, 1): lambda start: start % 10 != 1,
    (FLOW, 2): lambda start: start % 10 != 2,
}


def of(root):
    return Evidence(root), settings_of(root, "D")


def said(report, name=FLOW):
    (text,) = [text for text in report.caveats if text.startswith(f"This method, {name}: ")]
    return text


def test_one_training_is_told_as_before(ladder):
    report = judge(ladder, "D")
    assert CHECKPOINT_ONLY in report.caveats and ONE_OF_SEVERAL not in report.caveats
    assert "seeds" not in report.settings
    assert not [text for text in report.caveats if text.startswith("This method")]
    assert "This method: " not in gate_page(ladder, report)


def test_trainings_that_are_all_good_claim_the_method_and_change_no_verdict(ladder):
    before = judge(ladder, "D")
    trained_more(ladder, GOOD)
    report = judge(ladder, "D")
    assert report.settings["seeds"] == [0, 1, 2]
    assert report.candidates == before.candidates and report.promoted == before.promoted
    # The answers themselves: no criterion reads another training.
    assert report.criteria == before.criteria
    assert ONE_OF_SEVERAL in report.caveats and CHECKPOINT_ONLY not in report.caveats
    text = said(report)
    assert "3 trainings are worth" in text and "(seeds 0, 1, 2, on the same starts)" in text
    assert CLAIMED in text and "3 of 3 trainings gain more than the margin" in text
    assert "29.2 to 100 % of all its trainings" in text  # .025 to the power of a third
    assert "points by training" in text and "points by condition" in text


def test_worth_and_gain_are_those_of_the_rows(ladder):
    trained_more(ladder, GOOD)
    evidence_, settings = of(ladder)
    own = over_trainings(evidence_, settings, FLOW)
    assert own.worth.shape == (3, evidence.STARTS, len(evidence.CONDITIONS))
    assert own.each[1:] == [0.9, 0.9]
    claim = claim_of(evidence_, settings, FLOW)
    assert [one.baseline for one in claim.gains] == list(settings.baselines)
    other = over_trainings(evidence_, settings, "bc")
    gain = next(one for one in claim.gains if one.baseline == "bc")
    assert gain.gain == pytest.approx(np.mean(own.each) - np.mean(other.each))
    assert gain.low < gain.gain < gain.high
    assert own.scatter == pytest.approx(np.std(own.each, ddof=1))


def test_starts_that_all_end_alike_leave_what_so_many_cannot_show(ladder):
    """Student's t has no width there: three starts would show a gain exactly."""
    trained_more(ladder, {
        (name, seed): (lambda start: start >= 0) if name == FLOW else (lambda start: start < 0)
        for name in (FLOW, "bc") for seed in (0, 1, 2)
    })  # fmt: skip
    evidence_, settings = of(ladder)
    gain = next(one for one in claim_of(evidence_, settings, FLOW).gains if one.baseline == "bc")
    # Of gains between -1 and 1, all of which are 1: a share of starts at -1 that none shows.
    unseen = 1.0 - settings.alpha ** (1.0 / evidence.STARTS)
    assert (gain.gain, gain.high) == (1.0, 1.0)
    assert gain.low == pytest.approx(1.0 - 2.0 * unseen)
    own = over_trainings(evidence_, settings, FLOW)
    mean, low, high = own.mean(0.95)
    assert (mean, high) == (1.0, 1.0) and low == pytest.approx(0.025 ** (1.0 / evidence.STARTS))


@pytest.mark.parametrize(("mean", "ends", "expected"), [
    (0.0, (0.0, 0.0), (-0.5, 0.5)), (0.5, (0.5, 0.5), (-0.25, 0.75)),
    (0.0, (-0.7, 0.9), (-0.7, 0.9)), (0.9, (-1.4, 1.6), (-1.0, 1.0)),
])  # fmt: skip
def test_an_interval_of_gains_is_as_wide_as_what_two_starts_cannot_have_shown(mean, ends, expected):
    """By a quarter of probability, half of the starts may be of a kind that two never showed."""
    assert within(mean, *ends, starts=2, alpha=0.25, least=-1.0) == pytest.approx(expected)


def test_the_page_says_both_claims_and_every_rollout_is_bound(ladder):
    trained_more(ladder, GOOD)
    report = judge(ladder, "D")
    for seed in (1, 2):
        assert f"artifacts/stress/seeds/{seed}/rollouts.parquet" in report.materials
    page = gate_page(ladder, report)
    for title in ("This checkpoint: what it gains", "This method: what its trainings gain",
                  "This method: how far its trainings lie apart"):  # fmt: skip
        assert title in page
    assert "is not the file that the report names" not in page
    path = ladder / "artifacts/stress/seeds/1/rollouts.parquet"
    path.write_bytes(path.read_bytes() + b"\n")
    assert "is not the file that the report names" in gate_page(ladder, report)


def other_seed(rows):
    return rows.assign(seed=2)


def elsewhere(rows):
    return rows.assign(start_sha256=rows["start_sha256"].str[::-1])


def one_start_less(rows):
    return rows[(rows["method"] != FLOW) | (rows["start"] != 7)]


def one_condition_less(rows):
    return rows[(rows["method"] != FLOW) | (rows["perturbation"] != "nominal")]


def twice(rows):
    return rows.assign(start=rows["start"].where(rows["start"] != 7, 6))


@pytest.mark.parametrize("change", [
    other_seed, elsewhere, one_start_less, one_condition_less, twice
], ids=lambda change: change.__name__)  # fmt: skip
def test_a_training_that_was_not_run_as_the_first_claims_nothing(ladder, change):
    trained_more(ladder, GOOD)
    evidence.edit_table(ladder, "stress/seeds/1/rollouts.parquet", change)
    with pytest.raises(MissingEvidenceError):
        claim_of(*of(ladder), FLOW)
    report = judge(ladder, "D")
    assert said(report).startswith(f"This method, {FLOW}: nothing is claimed of it (")
    assert report.candidates[FLOW] == "PASS"


def test_a_training_that_is_missing_claims_nothing(ladder):
    trained_more(ladder, GOOD)
    evidence.replace(ladder, "stress/seeds/2/rollouts.parquet", None)
    assert "rollouts.parquet is missing" in said(judge(ladder, "D"))


def test_promotion_is_of_the_first_seed_and_never_of_the_best(ladder):
    """The best training is the second; nothing of it makes up for the first."""
    trained_more(ladder, {
        (FLOW, 0): lambda start: start % 2 == 0,
        (FLOW, 1): lambda start: start >= 0,
        (FLOW, 2): lambda start: start >= 0,
    })  # fmt: skip
    report = judge(ladder, "D")
    assert report.candidates[FLOW] == "FAIL" and report.promoted != FLOW
    assert "worth 0.5, 1, 1 in success" in said(report)


def test_rows_of_a_further_training_stand_in_no_table_of_the_first(ladder):
    trained_more(ladder, GOOD)
    rows = read_rows(ladder / "artifacts" / ROLLOUTS, evidence.RolloutRow)
    assert {row.seed for row in rows} == {0}


def test_components_say_what_a_rollout_varies_by(ladder):
    """All that varies is the training: each of them wins on all starts or on none."""
    trained_more(ladder, {
        (FLOW, seed): lambda start, seed=seed: start + seed - start >= 1 for seed in (0, 1, 2)
    })  # fmt: skip
    found = over_trainings(*of(ladder), FLOW)
    assert found.each == [0.0, 1.0, 1.0]
    parts = found.components
    assert parts.training == pytest.approx(np.std([0, 1, 1], ddof=1))
    assert (parts.start, parts.condition, parts.rest) == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)
    assert UNCLAIMED in said(judge(ladder, "D"))
