"""The independent checker and its mutants: checks that were never left out are undetected."""

import json

import evidence
import pytest
from asked import found_in

from gates.evidence import Evidence, MissingEvidenceError
from gates.feasibility.proof import checked_violations, mutants_undetected
from gates.feasibility.settings import SHADOW, FeasibilitySettings
from gates.proof import judge

ROWS = [evidence.mutant(layer, name) for layer, name in evidence.CHECKS]
EXCUSED = {**ROWS[0], "detected": False, "tried": 0, "not_applicable": "no gripper"}


def _undetected(root, rows):
    """What the criterion says of these rows of `mutants.json`."""
    (root / SHADOW).mkdir(parents=True)
    (root / SHADOW / "mutants.json").write_text(json.dumps(rows))
    return mutants_undetected.measure(Evidence(root), FeasibilitySettings.model_construct())


def test_a_check_that_was_never_disabled_is_undetected(ladder):
    evidence.edit_document(ladder, "shadow/mutants.json", lambda rows: rows[1:])
    report = judge(ladder, "C")
    assert report.verdict == "FAIL"
    assert "representation.shape (not tried)" in found_in(report, "mutants_undetected")[0].caveat


@pytest.mark.parametrize("row", range(len(ROWS)))
def test_every_row_counts_under_its_own_layer(row, tmp_path):
    """`expired` of the layers does not stand for `expired` of the executor."""
    found = _undetected(tmp_path, ROWS[:row] + ROWS[row + 1 :])
    assert found.value == 1 and ".".join(evidence.CHECKS[row]) in found.caveat


def test_all_of_them_are_enough(tmp_path):
    assert _undetected(tmp_path, ROWS).value == 0


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
