"""Reading tables by their row class: unknown columns refuse, missing ones cannot be measured."""

import evidence
import pandas as pd
import pytest

from gates.evidence import Evidence, MissingEvidenceError, counts, flags, numbers
from gates.pipeline import Basis
from genpolicy.audit.rows import TABLES, ModeOutcome, SituationRow
from genpolicy.data.rows import FrameRow
from genpolicy.errors import IntegrityError
from genpolicy.evidence.documents.given import REFUSALS
from genpolicy.evidence.rows.reproducibility import NfeRow
from genpolicy.evidence.rows.shadow import CandidateRow
from genpolicy.evidence.rows.stress import RolloutRow
from genpolicy.integrity.rows import columns_of

NFE = "artifacts/reload/nfe.parquet"


def test_rows_come_whole_but_for_lists(repo):
    rows = Evidence(repo).rows(NFE, NfeRow)
    assert list(rows.columns) == [
        "method",
        "seed",
        "recorded",
        "counted",
        "expected",
        "least",
        "most",
    ]
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


def test_lists_come_where_they_are_asked_for(repo):
    found = Evidence(repo)
    path = "artifacts/audit/neighbourhoods.parquet"
    assert "mode_paths" not in found.rows(path, SituationRow).columns
    assert len(found.rows(path, SituationRow, lists=True)["mode_paths"][0]) == 2


def test_records_are_rows_of_their_class_and_may_be_none(repo):
    found = Evidence(repo)
    first = found.records("artifacts/audit/modes.parquet", ModeOutcome)[0]
    assert isinstance(first, ModeOutcome) and first.mode == "left"
    assert found.records("artifacts/audit/findings.parquet", TABLES["findings"]) == []


@pytest.mark.parametrize("name", sorted(set(TABLES) - {"findings", "support", "demonstrated"}))
def test_a_misspelt_column_of_an_audit_table_refuses_by_both_names(repo, name):
    column = columns_of(TABLES[name])[0]
    evidence.edit_table(repo, f"audit/{name}.parquet", lambda f: f.rename(columns={column: "odd"}))
    for read in (Evidence(repo).rows, Evidence(repo).records):
        with pytest.raises(
            IntegrityError, match=rf"{name}.*unknown column odd.*missing .*{column}"
        ):
            read(f"artifacts/audit/{name}.parquet", TABLES[name])


def test_columns_of_a_stream_are_known_by_their_beginning(repo):
    frames = "ingest/frames.parquet"
    evidence.edit_table(repo, frames, lambda f: f.assign(**{"event_time_s.robot": 0.0}))
    assert len(Evidence(repo).rows(f"artifacts/{frames}", FrameRow))
    evidence.edit_table(repo, frames, lambda f: f.assign(**{"even_time_s.robot": 0.0}))
    with pytest.raises(IntegrityError, match=r"unknown column even_time_s\.robot"):
        Evidence(repo).rows(f"artifacts/{frames}", FrameRow)


def test_a_count_below_zero_is_no_count():
    frame = pd.DataFrame({"stale": [3, -3], "bad": [0, 1]})
    assert counts(frame, "bad").tolist() == [0.0, 1.0]
    with pytest.raises(MissingEvidenceError, match="column stale counts -3"):
        counts(frame, "stale")
    with pytest.raises(MissingEvidenceError, match="counts -1"):
        counts(pd.DataFrame({"stale": [-1]}), "stale")


def _empty(column, row=0):
    def change(frame):
        frame[column] = frame[column].astype(object)
        frame.at[row, column] = None
        return frame

    return change


@pytest.mark.parametrize(
    ("path", "row", "column"),
    [("audit/clocks", TABLES["clocks"], "stream"), ("audit/asked", TABLES["asked"], "check"),
     ("audit/components", TABLES["components"], "two_mode_episodes"),
     ("audit/neighbourhoods", SituationRow, "two_mode"),
     ("shadow/candidates", CandidateRow, "mode"), ("stress/rollouts", RolloutRow, "perturbation"),
     ("stress/rollouts", RolloutRow, "recovery_attempted")],
)  # fmt: skip
def test_an_empty_cell_is_no_value_and_drops_no_row(repo, path, row, column):
    """What groups, counts or chooses rows would leave that row out, and judge the others."""
    evidence.edit_table(repo, f"{path}.parquet", _empty(column))
    for read in (Evidence(repo).rows, Evidence(repo).records):
        with pytest.raises(MissingEvidenceError, match=rf"{path}\.parquet.* empty .*{column}"):
            read(f"artifacts/{path}.parquet", row)


def test_files_are_bound_by_name_and_keep_the_hash_that_was_judged(tmp_path):
    (tmp_path / "a").write_text("1")
    found = Evidence(tmp_path, Basis(unrecorded=("stress",)))
    assert found.basis.unrecorded == ("stress",) and Evidence(tmp_path).basis == Basis()
    found.bind_files(["a"])
    first = found.materials
    assert set(first) == {"a"} and found.digest("a") == first["a"]
    (tmp_path / "a").write_text("2")
    found.bind_files(["a"])
    assert found.bind("*") == ["a"] and found.materials == first


def test_a_document_of_another_form_is_not_measured(tmp_path):
    (tmp_path / "refusals.json").write_text('{"found": 1}')
    for _ in range(2):
        with pytest.raises(MissingEvidenceError, match=r"\./refusals\.json is a document with"):
            Evidence(tmp_path).document(".", REFUSALS)
    (tmp_path / "refusals.json").write_text('{"found": 1, "accepted": 1, "refused": []}')
    assert Evidence(tmp_path).document(".", REFUSALS).accepted == 1


def test_a_list_has_no_empty_places(repo):
    path = "audit/resamples.parquet"
    evidence.edit_table(repo, path, lambda f: f.assign(told=[[None, 0.1]] * len(f)))
    with pytest.raises(MissingEvidenceError, match=r"empty .*told"):
        Evidence(repo).records(f"artifacts/{path}", TABLES["resamples"])


def test_what_may_be_unknown_may_be_empty(repo):
    evidence.edit_table(repo, "audit/clocks.parquet", _empty("offset_after_s"))
    path = "audit/resamples.parquet"
    evidence.edit_table(repo, path, lambda f: f.assign(effect=[[None] * 3] * len(f)))
    assert len(Evidence(repo).rows("artifacts/audit/clocks.parquet", TABLES["clocks"]))
    assert len(Evidence(repo).records(f"artifacts/{path}", TABLES["resamples"]))


def test_a_link_to_nothing_is_no_missing_file(repo):
    file = repo / NFE
    file.unlink()
    file.symlink_to(repo / "nowhere")
    with pytest.raises(IntegrityError):
        Evidence(repo).rows(NFE, NfeRow)


def test_what_is_read_inside_is_told_there_and_stays_told_outside(repo):
    found = Evidence(repo)
    with found.recorded() as outer:
        found.digest("artifacts/first")
        with found.recorded() as inner:
            found.digest("artifacts/second")
        found.digest("artifacts/third")
    assert inner == ["artifacts/second"]
    assert outer == [f"artifacts/{name}" for name in ("first", "second", "third")]


def test_what_is_made_once_counts_as_read_by_all_who_ask(repo):
    found, made = Evidence(repo), []

    def make():
        made.append(len(found.rows(NFE, NfeRow)))
        return made[-1]

    for key, times in (("a", 1), ("a", 1), ("b", 2)):
        with found.recorded() as read:
            assert found.once(key, make) == made[0]
        assert (read, len(made)) == ([NFE], times)
    with found.recorded() as outside, found.recorded():
        found.once("a", make)
    assert outside == [NFE] and list(found.materials) == [NFE]


def test_what_could_not_be_made_is_tried_and_refused_again(repo):
    found = Evidence(repo)
    for _ in range(2):
        with found.recorded() as read, pytest.raises(MissingEvidenceError, match="no rows of x"):
            found.once("a", lambda: found.of(NFE, NfeRow, "x"))
        assert read == [NFE]


def test_a_table_that_is_whole_for_one_row_is_looked_at_again_for_another(repo):
    found = Evidence(repo)
    for _ in range(2):
        found.rows(NFE, NfeRow)
        with found.recorded() as read, pytest.raises(IntegrityError, match="unknown column"):
            found.rows(NFE, ModeOutcome)
        assert read == [NFE]


def test_what_was_not_reached_is_false_and_what_is_no_answer_is_refused():
    frame = pd.DataFrame({"good": [True, None, False], "bad": [True, 1, None]}, dtype=object)
    assert flags(frame, "good").tolist() == [True, False, False]
    with pytest.raises(MissingEvidenceError, match="column bad holds other values"):
        flags(frame, "bad")


@pytest.mark.parametrize("value", [None, float("nan"), float("inf"), "x"])
def test_what_is_no_number_is_not_measured(value):
    with pytest.raises(MissingEvidenceError, match="column loss"):
        numbers(pd.DataFrame({"loss": [0.5, value]}, dtype=object), "loss")
