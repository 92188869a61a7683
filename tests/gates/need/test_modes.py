"""Modes: only held-out situations count, bounds are exact, what was not checked is missing."""

import re

import evidence
import pytest
from asked import asked, settings_of
from editing import cells

from gates.evidence import MissingEvidenceError
from gates.need import modes
from gates.proof import judge
from genpolicy.statistics.intervals import clopper_pearson

SITUATIONS = "audit/neighbourhoods.parquet"


def value(ladder, criterion):
    return asked(ladder, criterion, gate="A").value


def test_situations_of_training_episodes_do_not_count(ladder):
    def judged():
        return int(re.search(r"of (\d+) situations", said())[1])

    def said():
        return asked(ladder, modes.mean_defeated_share, gate="A").caveat

    everything = judged()
    first = lambda frame: frame["split"] == "validation"  # noqa: E731
    evidence.edit_table(ladder, SITUATIONS, cells("split", "train", where=first))
    assert 0 < judged() < everything


@pytest.mark.parametrize(
    ("path", "key"), [("audit/summary.json", "persistent"), ("audit/persistence.json", "n")]
)
def test_a_situation_needs_two_modes_that_persist_and_long_enough_to_see_it(ladder, path, key):
    before = value(ladder, modes.multimodal_situations)

    def fewer(document):
        (document if key in document else document["counts"])[key] = 12

    evidence.edit_document(ladder, path, fewer)
    assert value(ladder, modes.multimodal_situations) == 12 < before
    assert value(ladder, modes.held_out_situations) == 90


@pytest.mark.parametrize(
    ("path", "key"), [("audit/summary.json", "persistent"), ("audit/persistence.json", "n")]
)
def test_too_few_situations_are_no_refutation(ladder, path, key):
    def fewer(document):
        (document if key in document else document["counts"])[key] = 9

    evidence.edit_document(ladder, path, fewer)
    report = judge(ladder, "A")
    answers = {answer.id: answer for answer in report.criteria}
    said = answers["multimodal_situations"]
    assert (said.verdict, said.measured) == ("INCONCLUSIVE", None)
    assert "9 of 10 needed" in said.caveat and "record more" in said.caveat
    assert answers["cause_accepted"].verdict == report.verdict == "INCONCLUSIVE"


def test_no_modes_where_there_was_enough_to_see_them_are_one(ladder):
    def none(document):
        document["counts"] |= {"two_mode": 0, "two_mode_episodes": 0, "persistent": 0}

    evidence.edit_document(ladder, "audit/summary.json", none)
    for name in ("sides", "resamples"):
        evidence.edit_table(
            ladder, f"audit/{name}.parquet", lambda f: f.assign(two_mode=0, two_mode_episodes=0)
        )
    report = judge(ladder, "A")
    answers = {answer.id: answer for answer in report.criteria}
    assert "unimodal" in answers["cause_accepted"].caveat
    assert answers["multimodal_situations"].verdict == report.verdict == "FAIL"
    assert answers["multimodal_situations"].measured == 0


def test_counts_that_cannot_be_are_missing_evidence(ladder):
    evidence.edit_table(ladder, "audit/modes.parquet", cells("successes", 26, share=0.01))
    with pytest.raises(MissingEvidenceError, match="26 of 25 episodes of left, which cannot be"):
        value(ladder, modes.mode_success_lower)


def test_the_worst_mode_decides_by_its_exact_lower_bound(ladder):
    def change(frame):
        return frame.assign(episodes=40, successes=[40] * (len(frame) - 1) + [30],
                            checked=50, admissible=[50] * (len(frame) - 1) + [45])  # fmt: skip

    evidence.edit_table(ladder, "audit/modes.parquet", change)
    confidence = settings_of(ladder, "A").confidence
    assert value(ladder, modes.mode_success_lower) == clopper_pearson(30, 40, confidence)[0]
    assert value(ladder, modes.mode_feasible_share) == 0.9


def test_a_mode_without_a_checked_chunk_is_missing_evidence(ladder):
    evidence.edit_table(ladder, "audit/modes.parquet", cells("checked", 0, share=0.01))
    evidence.edit_table(ladder, "audit/modes.parquet", cells("admissible", 0, share=0.01))
    with pytest.raises(MissingEvidenceError, match="of left: no chunk was checked"):
        value(ladder, modes.mode_feasible_share)


def test_persistence_counts_beyond_its_null(ladder):
    evidence.edit_document(
        ladder, "audit/persistence.json", lambda d: {**d, "observed": 0.9, "null_q95": 0.65}
    )
    assert value(ladder, modes.persistence_margin) == pytest.approx(0.25)


def test_the_mean_is_defeated_only_where_every_mode_passes(ladder):
    whole = value(ladder, modes.mean_defeated_share)
    evidence.edit_table(ladder, SITUATIONS, cells("modes_admissible", 1))
    assert value(ladder, modes.mean_defeated_share) == 0.0 < whole
    evidence.edit_table(ladder, SITUATIONS, cells("mean_admissible", None, share=1.0))
    with pytest.raises(MissingEvidenceError, match="the mean was not checked"):
        value(ladder, modes.mean_defeated_share)


def test_what_disturbed_demonstrations_did_is_shown_and_never_judged(ladder):
    before = asked(ladder, modes.mode_success_lower, gate="A")
    assert "(shown, not judged): left 95 % (38 of 40), right 20 % (8 of 40)" in before.caveat
    evidence.edit_table(ladder, "audit/recovery.parquet", lambda f: f.assign(successes=0))
    assert asked(ladder, modes.mode_success_lower, gate="A").value == before.value
    (ladder / "artifacts/audit/recovery.parquet").unlink()
    found = asked(ladder, modes.mode_success_lower, gate="A")
    assert found.value == before.value and "no disturbed demonstration" in found.caveat


def test_the_median_is_shown_beside_the_mean_and_not_judged(ladder):
    def said():
        return asked(ladder, modes.mean_defeated_share, gate="A")

    before = said()
    evidence.edit_table(ladder, SITUATIONS, cells("median_admissible", True, share=1.0))
    count = len(evidence.read_table(ladder / "artifacts" / SITUATIONS).to_pandas())
    assert said().value == before.value and judge(ladder, "A").verdict == "PASS"
    assert "the median of the neighbours passes in" in before.caveat
    found = re.search(r"passes in 100 % \((\d+) of (\d+)\) ", said().caveat)
    assert found and found[1] == found[2] and 0 < int(found[1]) <= count
    evidence.edit_table(ladder, SITUATIONS, cells("median_admissible", None, share=1.0))
    with pytest.raises(MissingEvidenceError, match="the median was not checked"):
        said()
