"""Gate C in particular: checks that were never left out are undetected."""

import json

import evidence
import numpy as np
import pytest
from asked import asked
from editing import cells

from gates.evidence import Evidence, MissingEvidenceError
from gates.feasibility.arrivals import stub_violation_upper
from gates.feasibility.candidates import boundary_jerk_p95_m_s3, projection_p95_m
from gates.feasibility.proof import checked_violations, mutants_undetected
from gates.feasibility.settings import SHADOW, FeasibilitySettings
from gates.proof import judge
from genpolicy.errors import ConfigError
from genpolicy.statistics.intervals import clopper_pearson


def _found(report, name):
    return [c for c in report.criteria if c.id == name]


ROWS = [evidence.mutant(layer, name) for layer, name in evidence.CHECKS]


def _undetected(root, rows):
    """What the criterion says of these rows of `mutants.json`."""
    (root / SHADOW).mkdir(parents=True)
    (root / SHADOW / "mutants.json").write_text(json.dumps(rows))
    return mutants_undetected.measure(Evidence(root), FeasibilitySettings.model_construct())


def test_a_check_that_was_never_disabled_is_undetected(ladder):
    evidence.edit_document(ladder, "shadow/mutants.json", lambda rows: rows[1:])
    report = judge(ladder, "C")
    assert report.verdict == "FAIL"
    assert "representation.shape (not tried)" in _found(report, "mutants_undetected")[0].caveat


@pytest.mark.parametrize("row", range(len(ROWS)))
def test_every_row_counts_under_its_own_layer(row, tmp_path):
    """`expired` of the layers does not stand for `expired` of the executor."""
    found = _undetected(tmp_path, ROWS[:row] + ROWS[row + 1 :])
    assert found.value == 1 and ".".join(evidence.CHECKS[row]) in found.caveat


def test_no_setting_says_which_checks_are_asked_for(ladder):
    evidence.write_params(ladder, lambda p: p["gate_c"].update(required_checks=["fresh.reset"]))
    with pytest.raises(ConfigError, match="required_checks"):
        judge(ladder, "C")


def test_all_of_them_are_enough(tmp_path):
    assert _undetected(tmp_path, ROWS).value == 0


EXCUSED = {**ROWS[0], "detected": False, "tried": 0, "not_applicable": "no gripper"}


def test_a_check_that_a_task_has_no_chunk_for_is_named_with_its_reason(tmp_path):
    found = _undetected(tmp_path, [EXCUSED, *ROWS[1:]])
    assert found.value == 0 and "representation.shape (no gripper)" in found.caveat


@pytest.mark.parametrize("changes", [{"not_applicable": ""}, {"tried": 3}])
def test_no_reason_or_a_tried_fixture_excuses_nothing(changes, tmp_path):
    assert _undetected(tmp_path, [EXCUSED | changes, *ROWS[1:]]).value == 1


@pytest.mark.parametrize("place", [0, 1])
def test_an_excuse_does_not_undo_a_failure_of_the_same_check(place, tmp_path):
    missed = {**ROWS[0], "detected": False}
    rows = [missed, EXCUSED] if place else [EXCUSED, missed]
    found = _undetected(tmp_path, [*rows, *ROWS[1:]])
    assert found.value == 1 and "not detected: representation.shape" in found.caveat


def test_a_check_that_one_of_its_rows_missed_is_missed(tmp_path):
    found = _undetected(tmp_path, [{**ROWS[0], "detected": False}, *ROWS])
    assert found.value == 1


@pytest.mark.parametrize("folder", ["shadow", "stress"])
@pytest.mark.parametrize(("proved", "counts"), [(7, True), (6, False), (0, False), (None, False)])
def test_an_action_whose_motion_was_not_proved_is_not_proved(folder, proved, counts, tmp_path):
    document = {**evidence.checked("a.mcap", 7), "reproved_actions": proved}
    evidence.document(tmp_path, f"{folder}/checker.json", document)
    if counts:
        assert checked_violations(Evidence(tmp_path), f"artifacts/{folder}").value == 0
    else:
        with pytest.raises(MissingEvidenceError):
            checked_violations(Evidence(tmp_path), f"artifacts/{folder}")


STUB, SAMPLED = "shadow/stub.parquet", "shadow/candidates.parquet"


def of(frame):
    return frame["method"] == "flow"


def bound(root):
    return asked(root, stub_violation_upper, "flow", gate="C")


def test_a_bad_arrival_is_one_of_the_observations_and_not_of_the_rows(ladder):
    """Eight actions of one chunk arrive together: 400 observations are 400 trials, not 5400."""
    assert bound(ladder).value == clopper_pearson(0, 400, 0.95)[1]
    evidence.edit_table(ladder, STUB, cells("stale", 1, where=of, share=0.01))
    assert bound(ladder).value == clopper_pearson(1, 400, 0.95)[1]
    assert "1 of 400 observations" in bound(ladder).caveat


def test_too_few_observations_are_no_proof_of_a_small_share_and_no_failure(ladder):
    evidence.edit_table(ladder, STUB, cells("delivered", 120, where=of))
    report = judge(ladder, "C")
    found = next(c for c in _found(report, "stub_violation_upper") if c.candidate == "flow")
    assert (found.verdict, found.measured) == ("INCONCLUSIVE", None)
    assert "none bad of 120 observations" in found.caveat and "0.03027" in found.caveat
    evidence.edit_table(ladder, STUB, cells("delivered", 0, where=of))
    assert judge(ladder, "C").candidates["flow"] == "INCONCLUSIVE"
    # One that is bad among 120 is no want of evidence.
    evidence.edit_table(ladder, STUB, cells("delivered", 120, where=of))
    evidence.edit_table(ladder, STUB, cells("invalid", 1, where=of, share=0.01))
    assert judge(ladder, "C").candidates["flow"] == "FAIL"


@pytest.mark.parametrize(
    ("criterion", "column"),
    [(projection_p95_m, "position_change_m"), (boundary_jerk_p95_m_s3, "boundary_jerk_m_s3")],
)
def test_a_p95_is_judged_at_the_upper_end_over_observations(ladder, criterion, column):
    """One observation of twenty is far off in all its candidates: p95 may lie there by luck."""

    def change(frame):
        far = of(frame) & (frame["fixture"] == "held_out") & (frame["observation"] == 3)
        near = of(frame) & (frame["fixture"] == "held_out") & ~far
        values = np.where(far, 900.0, np.where(near, 0.001, frame[column].astype(float)))
        return frame.assign(**{column: values})

    evidence.edit_table(ladder, SAMPLED, change)
    found = asked(ladder, criterion, "flow", gate="C")
    assert found.interval == (0.001, 900.0) and found.value == 900.0
    assert "p95 0.001, largest 900" in found.caveat or "p95 900" in found.caveat
    assert judge(ladder, "C").candidates["flow"] == "FAIL"


def test_a_p95_of_a_few_observations_is_not_measured(ladder):
    few = lambda f: f[~(of(f) & (f["fixture"] == "held_out") & (f["observation"] > 9))]  # noqa: E731
    evidence.edit_table(ladder, SAMPLED, few)
    with pytest.raises(MissingEvidenceError, match="10 independent draws"):
        asked(ladder, projection_p95_m, "flow", gate="C")


CANDIDATES = "shadow/candidates.parquet"


def _reject(mode, episodes):
    """Reject a mode in the first so many of the 60 situations with two modes."""

    def change(frame):
        bad = (frame["fixture"] == "two_modes") & (frame["mode"] == mode)
        frame.loc[bad & (frame["observation"] < episodes), "geometric"] = False
        return frame

    return change


def _gap(ladder):
    report = judge(ladder, "C")
    return report, _found(report, "mode_admissible_gap")[0]


def test_the_worse_end_of_the_gap_decides(ladder):
    """8 of 60 rejected on one side: the gap is .13, its upper end is not; .3 is the limit."""
    evidence.edit_table(ladder, CANDIDATES, _reject("right", 8))
    report, found = _gap(ladder)
    assert found.verdict == "PASS" and 8 / 60 < found.interval[1] == found.measured < 0.3
    evidence.edit_table(ladder, CANDIDATES, _reject("right", 16))
    report, found = _gap(ladder)
    assert report.verdict == found.verdict == "FAIL"
    assert found.interval[0] < 16 / 60 < 0.3 < found.measured
    assert "upper bound of left minus right" in found.caveat
    assert "left 1 of 60, right 0.7333 of 60 episodes" in found.caveat


def test_the_gap_counts_whichever_mode_is_removed(ladder):
    evidence.edit_table(ladder, CANDIDATES, _reject("left", 30))
    assert "right minus left" in _gap(ladder)[1].caveat


def _answered_on_the_right(episodes):
    """Only so many situations are answered on the right as well."""
    return lambda f: f.assign(
        mode=f["mode"].where((f["observation"] < episodes) | (f["mode"] != "right"), "none")
    )


@pytest.mark.parametrize(("episodes", "verdict"), [(30, "PASS"), (29, "INCONCLUSIVE")])
def test_a_handful_of_observations_compares_no_modes(ladder, episodes, verdict):
    """Six decided before, and one rejection more would have flipped them."""
    evidence.edit_table(ladder, CANDIDATES, _answered_on_the_right(episodes))
    report, found = _gap(ladder)
    assert report.verdict == found.verdict == verdict
    if verdict != "PASS":
        assert "left 29, right 29; at least 30 of each" in found.caveat


def test_without_situations_with_two_modes_nothing_is_compared(ladder):
    evidence.edit_table(ladder, CANDIDATES, lambda f: f[f["fixture"] != "two_modes"])
    report, found = _gap(ladder)
    assert report.verdict == "INCONCLUSIVE" and "no situation with several" in found.caveat


def test_situations_of_one_episode_are_one_observation(ladder):
    three_each = [f"e{number // 3}:{number}" for number in range(60)]
    evidence.edit_table(
        ladder,
        CANDIDATES,
        lambda f: f.assign(situation=[three_each[number] for number in f["observation"]]),
    )
    found = _gap(ladder)[1]
    assert found.verdict == "INCONCLUSIVE" and "left 20, right 20" in found.caveat


def test_situations_with_two_modes_are_no_corruption(ladder):
    """They are intact: what is admissible there was not let through."""
    found = _found(judge(ladder, "C"), "corrupted_refused_share")[0]
    assert found.verdict == "PASS" and "of 5 corrupted fixtures" in found.caveat
