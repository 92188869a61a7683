"""Reading tables by their row class: unknown columns refuse, missing ones cannot be measured."""

import evidence
import pytest

from gates.evidence import Evidence, MissingEvidenceError
from genpolicy.errors import IntegrityError
from genpolicy.evidence.rows.reproducibility import NfeRow
from genpolicy.evidence.rows.shadow import CandidateRow

NFE = "artifacts/reload/nfe.parquet"


def test_rows_come_whole_but_for_lists(repo):
    rows = Evidence(repo).rows(NFE, NfeRow)
    assert list(rows.columns) == ["method", "seed", "recorded", "counted", "expected"]
    shadow = Evidence(repo).of("artifacts/shadow/candidates.parquet", CandidateRow, "flow")
    assert "raw" not in shadow.columns and set(shadow["method"]) == {"flow"}


def test_an_unknown_column_refuses_by_name(repo):
    evidence.edit_table(repo, "reload/nfe.parquet", lambda f: f.assign(recordet=1))
    with pytest.raises(IntegrityError, match=r"nfe\.parquet.*unknown column recordet"):
        Evidence(repo).rows(NFE, NfeRow)


def test_a_missing_column_cannot_be_measured_and_is_named(repo):
    evidence.edit_table(repo, "reload/nfe.parquet", lambda f: f.drop(columns="counted"))
    with pytest.raises(MissingEvidenceError, match=r"nfe\.parquet has no column counted"):
        Evidence(repo).rows(NFE, NfeRow)


def test_no_file_no_row_and_no_method_cannot_be_measured(repo):
    with pytest.raises(MissingEvidenceError, match="no rows of other"):
        Evidence(repo).of(NFE, NfeRow, "other")
    evidence.edit_table(repo, "reload/nfe.parquet", lambda f: f.head(0))
    with pytest.raises(MissingEvidenceError, match="has no rows"):
        Evidence(repo).rows(NFE, NfeRow)
    (repo / NFE).unlink()
    with pytest.raises(MissingEvidenceError, match="is missing"):
        Evidence(repo).rows(NFE, NfeRow)


def test_what_is_bound_is_material_and_not_read(repo):
    found = Evidence(repo)
    with found.recorded() as touched:
        assert found.bind("artifacts/reload/*.parquet")
        assert found.digest("artifacts/none") == ""
    assert touched == ["artifacts/none"] and NFE in found.materials
