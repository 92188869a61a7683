"""The trial: fewer starts than planned give no verdict, no gain returns to the baseline."""

import evidence
import pandas as pd
import pytest
from asked import asked, found_in, settings_of
from editing import cells

from gates.evidence import MissingEvidenceError
from gates.proof import judge
from gates.stress.trial import unmatched_starts, verdict_reachable
from genpolicy.evidence.stress.power import POWER_TRIALS


def _of(method):
    return lambda frame: frame["method"] == method


def test_no_gain_returns_to_the_best_baseline(ladder):
    evidence.edit_table(
        ladder, "stress/rollouts.parquet", cells("success", True, where=_of("chunked_bc"))
    )
    report = judge(ladder, "D")
    assert (report.verdict, report.decision) == ("FAIL", "return to chunked_bc")
    assert report.promoted is None
    assert "promotion_e_value" in report.diagnosis


def test_fewer_starts_than_planned_gives_no_verdict(ladder):
    evidence.edit_table(ladder, "stress/rollouts.parquet", lambda f: f[f["start"] < 60])
    report = judge(ladder, "D")
    assert report.verdict == "INCONCLUSIVE"
    assert report.decision.startswith("No decision")


def test_how_many_trainings_a_candidate_had_is_said(ladder):
    said = asked(ladder, unmatched_starts, "flow", gate="D").caveat
    conditions = len(settings_of(ladder, "D").perturbations)
    # A start that is met in each condition is one start.
    begins = f"{evidence.STARTS} starts in {conditions} conditions by state hash, of 1 training"
    assert said.startswith(f"{begins} seed; ")

    def second(frame):
        return pd.concat([frame, frame[frame["method"] == "flow"].assign(seed=9)])

    evidence.edit_table(ladder, "stress/rollouts.parquet", second)
    assert ", of 2 training seeds; " in asked(ladder, unmatched_starts, "flow", gate="D").caveat


def test_a_reset_that_ignores_its_start_is_one_start(ladder):
    """All methods share every state, and all states are one: nothing was repeated."""
    evidence.edit_table(ladder, "stress/rollouts.parquet", cells("start_sha256", "ab" * 32))
    with pytest.raises(MissingEvidenceError, match=f"1 states for {evidence.STARTS} starts"):
        asked(ladder, unmatched_starts, "flow", gate="D")
    assert judge(ladder, "D").verdict == "INCONCLUSIVE"


OTHER = "cd" * 32


@pytest.mark.parametrize("method", ["flow", "chunked_bc"])
def test_one_start_from_another_state_is_two_states_that_are_not_shared(ladder, method):
    """The state that the candidate began from, and that of the baseline."""

    def one(frame):
        at = frame["method"] == method
        return at & (frame["start"] == 3) & (frame["perturbation"] == "nominal")

    others = len(settings_of(ladder, "D").baselines) if method == "flow" else 1
    evidence.edit_table(ladder, "stress/rollouts.parquet", cells("start_sha256", OTHER, where=one))
    found = asked(ladder, unmatched_starts, "flow", gate="D")
    assert found.value == 2.0 * others and "chunked_bc 2" in found.caveat


@pytest.mark.parametrize("method", ["flow", "chunked_bc"])
def test_a_second_training_seed_begins_where_the_first_began(ladder, method):
    """Only one of the two lacks a state then: either of them."""
    evidence.edit_table(
        ladder,
        "stress/rollouts.parquet",
        lambda f: pd.concat([f, f[f["method"] == method].assign(seed=1)]),
    )
    assert asked(ladder, unmatched_starts, "flow", gate="D").value == 0.0

    def one(frame):
        at = (frame["method"] == method) & (frame["seed"] == 1)
        return at & (frame["start"] == 3) & (frame["perturbation"] == "nominal")

    others = len(settings_of(ladder, "D").baselines) if method == "flow" else 1
    evidence.edit_table(ladder, "stress/rollouts.parquet", cells("start_sha256", OTHER, where=one))
    assert asked(ladder, unmatched_starts, "flow", gate="D").value == others
    assert judge(ladder, "D").candidates["flow"] == "FAIL"


def test_starts_that_nobody_planned_are_no_trial(ladder):
    """As many as planned, but of other numbers: a choice after the fact."""
    evidence.edit_table(ladder, "stress/rollouts.parquet", lambda f: f.assign(start=f["start"] + 1))
    with pytest.raises(MissingEvidenceError, match="2 starts lack or nobody planned them"):
        asked(ladder, unmatched_starts, "flow", gate="D")


POWER = "stress/power.json"


def test_only_the_planned_effect_counts_as_found(ladder):
    """A huge gain that would surely be found says nothing of the gain that is planned."""

    def change(document):
        planned, none = document["rows"]
        huge = {**planned, "baseline_success": 0.1, "candidate_success": 0.9, "promote_share": 1.0}
        document["rows"] = [huge, {**planned, "promote_share": 0.47, "return_share": 0.53}, none]

    evidence.edit_document(ladder, POWER, change)
    with pytest.raises(MissingEvidenceError, match="95 % against 50 % is promoted in 47 %"):
        asked(ladder, verdict_reachable, gate="D")


@pytest.mark.parametrize(("share", "verdict"), [(0.79975, "INCONCLUSIVE"), (0.8, "PASS")])
def test_too_little_power_decides_nothing_and_enough_does(ladder, share, verdict):
    """Of a candidate that passes otherwise, and of one that gains nothing: that is a FAIL."""
    evidence.edit_document(ladder, POWER, lambda d: d["rows"][0].update(promote_share=share))
    report = judge(ladder, "D")
    (found,) = found_in(report, "verdict_reachable")
    assert (found.verdict, report.verdict) == (verdict, verdict)
    if verdict == "INCONCLUSIVE":
        assert "too few starts to find the planned effect" in found.caveat
        assert report.promoted is None and report.decision.startswith("No decision")
    assert set(report.candidates.values()) == {"PASS"}


def test_a_test_that_promotes_at_the_margin_is_no_test(ladder):
    evidence.edit_document(ladder, POWER, lambda d: d["rows"][1].update(return_share=0.6))
    assert asked(ladder, verdict_reachable, gate="D").value == 0.6
    assert judge(ladder, "D").verdict == "FAIL"


@pytest.mark.parametrize(
    ("promote", "back", "verdict"),
    [(0.5, 0.6, "FAIL"), (0.5, 0.79975, "FAIL"), (0.5, 0.8, "INCONCLUSIVE")],
)
def test_a_test_that_is_wrong_is_not_called_too_small(ladder, promote, back, verdict):
    """More starts mend a test that finds too little, and none that promotes without a gain."""

    def change(document):
        planned, none = document["rows"]
        planned["promote_share"], none["return_share"] = promote, back

    evidence.edit_document(ladder, POWER, change)
    report = judge(ladder, "D")
    (found,) = found_in(report, "verdict_reachable")
    assert (found.verdict, report.verdict) == (verdict, verdict)
    assert ("too few starts" in found.caveat) == (verdict == "INCONCLUSIVE")


@pytest.mark.parametrize("row", [0, 1])
def test_a_power_table_without_its_worlds_is_missing_evidence(ladder, row):
    evidence.edit_document(ladder, POWER, lambda d: d["rows"].pop(row) and None)
    with pytest.raises(MissingEvidenceError, match="lacks the planned effect or a world without"):
        asked(ladder, verdict_reachable, gate="D")


def test_the_power_is_that_of_this_plan(ladder):
    assert settings_of(ladder, "D").planned_effect == (0.5, 0.95)
    evidence.edit_document(ladder, POWER, lambda d: d.update(pairs=evidence.STARTS + 1))
    with pytest.raises(MissingEvidenceError, match="for another pairs"):
        asked(ladder, verdict_reachable, gate="D")


def test_a_gain_of_just_the_margin_is_none(ladder):
    """0.3 - 0.2 is a little less than 0.1 in floating point, 0.6 - 0.5 a little more or less."""
    assert settings_of(ladder, "D").margin == 0.1
    for baseline, candidate in ((0.5, 0.6), (0.2, 0.3), (0.8, 0.9), (0.3, 0.4), (0.6, 0.7)):
        changes = {"baseline_success": baseline, "candidate_success": candidate}
        evidence.edit_document(
            ladder, POWER, lambda d, c=changes: d["rows"][1].update(**c, return_share=0.6)
        )
        assert asked(ladder, verdict_reachable, gate="D").value == 0.6
    evidence.edit_document(
        ladder, POWER, lambda d: d["rows"][1].update(baseline_success=0.5, candidate_success=0.65)
    )
    with pytest.raises(MissingEvidenceError, match="a world without"):
        asked(ladder, verdict_reachable, gate="D")


@pytest.mark.parametrize(
    ("rows", "said"), [([], "no rows"), ({}, "rows = {}"), (None, "rows = None")]
)
def test_a_power_table_without_rows_is_missing_evidence(ladder, rows, said):
    evidence.edit_document(ladder, POWER, lambda d: d.update(rows=rows))
    with pytest.raises(MissingEvidenceError, match=said):
        asked(ladder, verdict_reachable, gate="D")


def test_the_power_table_rests_on_as_many_trials_as_its_stage_draws(ladder):
    (reached,) = [c for c in judge(ladder, "D").criteria if c.id == "verdict_reachable"]
    assert reached.counted == f"{POWER_TRIALS} simulated trials"
