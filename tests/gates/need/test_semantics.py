"""Questions to the data themselves."""

import evidence
import pytest
from asked import asked

from gates.evidence import MissingEvidenceError
from gates.need import semantics
from gates.proof import judge
from genpolicy.errors import ConfigError


def _found(report, name):
    return [c for c in report.criteria if c.id == name]


def test_golden_exact_bound_of_label_disagreement(repo):
    """0 of 40: upper end 1 - 0.025^(1/40) = 0.0881, Clopper and Pearson 1934."""
    found = _found(judge(repo, "A"), "label_disagreement")[0]
    assert found.measured == pytest.approx(1 - 0.025 ** (1 / 40), abs=1e-12)


def _unasked(frame):
    frame.loc[frame["check"] == "operator", ["asked", "reason"]] = [False, "not recorded"]
    return frame


def _waive(check, reason, owner="perception"):
    def change(params):
        params["gate_a"]["waived_checks"] = {owner: {check: reason}}

    return change


def _declare(ladder):
    """The phases of the task and the streams of its contract."""
    evidence.edit_document(
        ladder, "task/identity.json", lambda d: d | {"phases": {"all": ["approach", "insert"]}}
    )
    times = {"event_time_s.camera": 0.0, "event_time_s.robot": 0.0}
    evidence.edit_table(ladder, "ingest/frames.parquet", lambda f: f.assign(**times))


def test_what_was_not_asked_is_inconclusive_until_somebody_answers_for_it(ladder):
    evidence.edit_table(ladder, "audit/asked.parquet", _unasked)
    report = judge(ladder, "A")
    found = _found(report, "unasked_checks")[0]
    assert (report.verdict, found.verdict, found.measured) == ("INCONCLUSIVE",) * 2 + (None,)
    assert "operator (not recorded)" in found.caveat and "unasked_checks" in report.diagnosis

    evidence.write_params(ladder, _waive("operator", "one person demonstrated"))
    report = judge(ladder, "A")
    assert report.verdict == "PASS"
    said = [text for text in report.caveats if text.startswith("operator")]
    assert said and "perception owner" in said[0] and "one person" in said[0]


def test_a_waiver_waives_only_what_it_names(ladder):
    evidence.edit_table(ladder, "audit/asked.parquet", _unasked)
    evidence.write_params(ladder, _waive("labels", "x"))
    assert judge(ladder, "A").verdict == "INCONCLUSIVE"


@pytest.mark.parametrize(
    "name",
    ["past.approach", "clock.camera", "frozen.camera", "column.height", "calibration_at_rest"],
)
@pytest.mark.parametrize("silent", [False, True])
def test_a_waiver_that_these_data_do_not_need_is_remarked(ladder, name, silent):
    """Other data of the same task ask it: the plan that waived it beforehand stays a plan."""
    _declare(ladder)
    if silent:
        evidence.edit_table(ladder, "audit/asked.parquet", _unasked)
    evidence.write_params(ladder, _waive(name, "too few episodes"))
    report = judge(ladder, "A")
    found = _found(report, "unasked_checks")[0]
    assert report.verdict == ("INCONCLUSIVE" if silent else "PASS")
    assert f"waived without need here: {name}" in found.caveat
    assert any(text.startswith(name) and "too few" in text for text in report.caveats)


def test_a_waiver_of_what_was_asked_after_all_is_remarked(ladder):
    evidence.write_params(ladder, _waive("labels", "x"))
    found = _found(judge(ladder, "A"), "unasked_checks")[0]
    assert (found.verdict, found.measured) == ("PASS", 0.0)
    assert "waived without need here: labels" in found.caveat


def test_a_waiver_that_is_needed_is_no_remark(ladder):
    evidence.edit_table(ladder, "audit/asked.parquet", _unasked)
    evidence.write_params(ladder, _waive("operator", "one person demonstrated"))
    found = _found(judge(ladder, "A"), "unasked_checks")[0]
    assert found.verdict == "PASS" and "1 of them waived" in found.caveat
    assert "without need" not in found.caveat


@pytest.mark.parametrize(
    ("name", "file"),
    [("past.approach", "task/identity.json"), ("clock.camera", "ingest/frames.parquet")],
)
def test_what_can_be_asked_is_not_known_without_task_or_frames(ladder, name, file):
    _declare(ladder)
    (ladder / "artifacts" / file).unlink()
    evidence.write_params(ladder, _waive(name, "x"))
    report = judge(ladder, "A")
    found = _found(report, "unasked_checks")[0]
    assert (report.verdict, found.measured) == ("INCONCLUSIVE", None)
    assert file in found.caveat


@pytest.mark.parametrize(
    ("change", "match"),
    [(_waive("operater", "x"), "a waiver of no question"), (_waive("operator", " "), "waived"),
     (_waive("past.aproach", "x"), "a waiver of no question.*past.approach"),
     (_waive("clock.kamera", "x"), "a waiver of no question.*clock.camera"),
     (_waive("past.", "x"), "a waiver of no question"),
     (_waive("column.", "x"), "a waiver of no question"),
     (_waive("operator", "x", owner="nobody"), "waived")],
)  # fmt: skip
def test_a_waiver_without_name_or_reason_is_refused(ladder, change, match):
    _declare(ladder)
    evidence.write_params(ladder, change)
    with pytest.raises(ConfigError, match=match):
        judge(ladder, "A")


@pytest.mark.parametrize(("found", "measured"), [(50, 0.0), (49, 1.0), (52, 2.0)])
def test_a_recording_that_vanished_counts_as_one_that_appeared(ladder, found, measured):
    """49 accepted and 1 refused."""
    evidence.edit_document(ladder, "ingest/refusals.json", lambda d: d | {"found": found})
    assert asked(ladder, semantics.refused_recordings_accounted, gate="A").value == measured


def test_one_recording_is_some_and_none_is_no_evidence(ladder):
    path = "ingest/refusals.json"
    one = {"found": 1, "accepted": 1, "refused": []}
    evidence.edit_document(ladder, path, lambda _: one)
    assert asked(ladder, semantics.refused_recordings_accounted, gate="A").value == 0.0
    evidence.edit_document(ladder, path, lambda _: one | {"found": 0, "accepted": 0})
    with pytest.raises(MissingEvidenceError, match="no recordings were found"):
        asked(ladder, semantics.refused_recordings_accounted, gate="A")


def test_a_lag_is_held_against_the_other_epochs_of_its_stream_alone(ladder):
    """Streams may lag differently; of one the epochs may not."""

    def lags(frame, **of):
        return frame.assign(lag_rows=[of[s] for s in frame["stream"] + frame["epoch"]])

    path = "audit/clocks.parquet"
    apart = {"robote1": 2.0, "robote2": 2.0, "camerae1": 6.0, "camerae2": 6.0}
    evidence.edit_table(ladder, path, lambda f: lags(f, **apart))
    assert asked(ladder, semantics.lag_spread_rows, gate="A").value == 0.0
    evidence.edit_table(ladder, path, lambda f: lags(f, **apart | {"camerae2": 4.0}))
    assert asked(ladder, semantics.lag_spread_rows, gate="A").value == 2.0
