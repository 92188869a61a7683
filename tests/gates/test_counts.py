"""A count below zero is corrupt evidence: it is refused by name, and takes nothing away."""

import evidence
import pytest
from asked import asked

from gates.evidence import MissingEvidenceError
from gates.proof import SPECS, judge

METHOD = "flow"
COUNTED = [
    ("C", "stub_stale", "shadow/stub.parquet", "stale"),
    ("C", "stub_invalid", "shadow/stub.parquet", "invalid"),
    ("C", "stub_violation_upper", "shadow/stub.parquet", "delivered"),
    ("C", "conservation_error", "shadow/counts.parquet", "count"),
    ("C", "incidents_miscounted", "shadow/counts.parquet", "executed"),
    ("D", "stub_violations", "stress/stub.parquet", "stale"),
    ("D", "stub_violations", "stress/stub.parquet", "arrivals"),
    ("D", "conservation_error", "stress/conservation.parquet", "discarded"),
    ("D", "conservation_error", "stress/counts.parquet", "count"),
    ("D", "intervention_upper", "stress/rollouts.parquet", "interventions"),
    ("A", "baseline_mode_coverage", "measure_baselines/modes.parquet", "modes_valid"),
    ("B", "outside_modes_upper", "reload/modes.parquet", "far_from_modes"),
]
DOCUMENTED = [
    ("C", "checker_violations", "shadow/checker.json", "reproved_actions"),
    ("D", "checker_violations", "stress/checker.json", "checked_actions"),
    ("A", "refused_recordings_accounted", "ingest/refusals.json", "accepted"),
]


def _measure(root, gate, name):
    (item,) = [item for item in SPECS[gate].criteria if item.id == name]
    return asked(root, item, *([METHOD] if item.per_candidate else []), gate=gate)


def _one_below_zero(column):
    """One row of the method is below zero; of any, in a table of baselines."""

    def change(frame):
        own = frame.index[frame["method"] == METHOD]
        frame.loc[own[0] if len(own) else frame.index[0], column] = -3
        return frame

    return change


@pytest.mark.parametrize(("gate", "name", "table", "column"), COUNTED)
def test_a_column_that_counts_below_zero_is_not_measured(repo, gate, name, table, column):
    _measure(repo, gate, name)
    evidence.edit_table(repo, table, _one_below_zero(column))
    with pytest.raises(MissingEvidenceError, match=f"{column} counts -3"):
        _measure(repo, gate, name)


@pytest.mark.parametrize(("gate", "name", "path", "key"), DOCUMENTED)
def test_a_number_that_counts_below_zero_is_not_measured(repo, gate, name, path, key):
    _measure(repo, gate, name)
    evidence.edit_document(repo, path, lambda document: {**document, key: -1})
    with pytest.raises(MissingEvidenceError, match=rf"{key} = -1 \(.*greater than or equal to 0"):
        _measure(repo, gate, name)


def test_stale_actions_that_cancel_do_not_pass(ladder):
    def cancel(frame):
        rows = frame.index[frame["method"] == METHOD]
        frame.loc[rows[0], "stale"], frame.loc[rows[1], "stale"] = 3, -3
        return frame

    evidence.edit_table(ladder, "stress/stub.parquet", cancel)
    report = judge(ladder, "D")
    assert report.candidates[METHOD] != "PASS"
    (found,) = [c for c in report.criteria if (c.id, c.candidate) == ("stub_violations", METHOD)]
    assert found.verdict == "INCONCLUSIVE" and "stale counts -3" in found.caveat
