"""Rows under a number: those of the evidence, none of other bytes, bounded, and never run."""

import csv
import io
import json

import evidence
import numpy as np
import pandas as pd
import pytest

from gates.evidence import Evidence
from gates.pages import rows as module
from gates.pages import rows_files
from gates.pages.numbers import recounted
from gates.pages.page import gate_page
from gates.pages.rows import CRITERIA, printed_rows, rows_folder, rows_of
from gates.pages.rows_files import LARGEST_BYTES
from gates.proof import judge
from genpolicy.integrity.hashing import sha256_file

ROLLOUTS = "artifacts/stress/rollouts.parquet"


def read(data):
    return list(csv.DictReader(io.StringIO(data.decode())))


@pytest.fixture(scope="module")
def rows(whole, judged):
    return {gate: rows_of(whole, judged(gate)) for gate in "ABCD"}


@pytest.mark.parametrize("gate", "ABCD")
def test_every_number_that_read_a_table_or_document_has_rows(rows, judged, gate):
    for answer in judged(gate).criteria:
        own = rows[gate].under(answer)
        assert own and all(file.kept > 0 or file.of == 0 for file in own), answer.id
        assert {file.path for file in own} <= set(answer.evidence)


def test_rows_are_those_of_the_table_of_one_method_with_their_numbers(rows, whole):
    """Held against the table as pandas reads it, and a share counted from the file alone."""
    frame = pd.read_parquet(whole / ROLLOUTS)
    own = frame[frame["method"] == "flow"].reset_index(drop=True)
    file = rows["D"].by_method(ROLLOUTS)["flow"]
    found = read(file.data)
    assert (file.kept, file.of, file.name) == (len(own), len(own), "stress.rollouts.flow.csv")
    assert [row["row"] for row in found] == [str(n) for n in range(1, len(own) + 1)]
    assert [row["outcome"] for row in found] == list(own["outcome"])
    assert [row["success"] == "true" for row in found] == list(own["success"])
    ages = [float(row["action_age_p95_s"]) for row in found]
    np.testing.assert_allclose(ages, own["action_age_p95_s"], rtol=1e-8)
    assert found[0]["start_sha256"] == own["start_sha256"][0][:12]
    assert set(rows["D"].by_method(ROLLOUTS)) == set(frame["method"]), "what it is compared with"


def test_a_candidate_leads_to_its_own_rows_only(rows, judged):
    answers = [a for a in judged("D").criteria if a.candidate == "flow" and ROLLOUTS in a.evidence]
    assert answers
    for answer in answers:
        methods = {file.method for file in rows["D"].under(answer) if file.path == ROLLOUTS}
        assert methods == {"flow"}


def test_a_table_that_only_candidates_are_asked_of_has_no_rows_of_others(rows):
    methods = {file.method for file in rows["D"].of("artifacts/stress/invocations.parquet")}
    assert methods == {"diffusion", "flow"}


def test_a_document_is_its_values_by_place(rows, whole):
    (file,) = rows["D"].of("artifacts/stress/checker.json")
    found = {row["place"]: row["value"] for row in read(file.data)}
    stated = json.loads((whole / "artifacts/stress/checker.json").read_text())
    assert int(found["checked_actions"]) == stated["checked_actions"] and len(found) == file.of
    assert {place.split(".")[0].split("[")[0] for place in found} == set(stated)


SHARES = {
    "A": "label_disagreement mode_success_lower mode_feasible_share mean_defeated_share "
         "chunking_valid_share factor_valid_share",
    "B": "mode_coverage_lower outside_modes_upper",
    "C": "admissible_share corrupted_refused_share stub_stale stub_invalid",
    "D": "nominal_success_lower stress_success_lower deadline_miss_upper hold_share_upper "
         "rejection_share_upper fallback_share_upper intervention_upper reset_upper "
         "recovery_success_lower stub_violations",
}  # fmt: skip
"""Criteria whose number is a share of rows, or of a column of them."""


def holds(row, said):
    """Whether what a report says of a row holds of its cells, read from the words alone."""
    if said.startswith("not ("):
        return not all(holds(row, part) for part in said[5:-1].split(" and "))
    column, sign, than = said.split(" ", 2)
    if sign == ">=":
        factor, times, other = than.rpartition(" * ")
        bound = float(row[other]) if other in row else float(other)
        return float(row[column]) >= (float(factor) if times else 1.0) * bound
    values = ["" if value == "(empty)" else row.get(value, value) for value in than.split(" or ")]
    return (row[column] in values) == (sign == "=")


def counted_again(file, recount):
    """Whole and part of a number, from the cells of a file and the words of its report."""
    found = [row for row in read(file.data) if all(holds(row, said) for said in recount.where)]
    many = [int(row[rows_files.EQUAL_ROWS]) if file.folded else 1 for row in found]

    def total(column):
        return sum(float(row[column]) * n for row, n in zip(found, many, strict=True))

    whole = total(recount.of) if recount.of else sum(many)
    if recount.summed:
        return whole, sum(total(column) for column in recount.summed)
    hit = [all(holds(row, said) for said in recount.hits) for row in found]
    return whole, sum(n for n, one in zip(many, hit, strict=True) if one)


@pytest.mark.parametrize("gate", "ABCD")
def test_a_share_is_counted_again_from_its_rows_by_the_filter_that_is_stated(rows, judged, gate):
    """From the printed bytes and the printed words: nothing of the judge is asked."""
    seen = set()
    for answer in judged(gate).criteria:
        if answer.recount is None:
            continue
        file = rows[gate].recounted(answer)
        assert file is not None and file.path in answer.evidence, answer.id
        whole, part = counted_again(file, answer.recount)
        assert whole == answer.recount.whole > 0, (answer.id, answer.recount)
        if answer.recount.part is not None:
            assert part == answer.recount.part, (answer.id, answer.recount)
            seen.add(answer.id)
        assert all(said in recounted(answer.recount) for said in answer.recount.where)
    assert seen == set(SHARES[gate].split())


def test_another_row_is_another_count(copied, judged):
    """The same filter on altered rows does not give the number of the report."""
    first = lambda f: (f["method"] == "flow") & (f["perturbation"] == "nominal")  # noqa: E731
    evidence.edit_table(
        copied, "stress/rollouts.parquet",
        lambda f: f.assign(success=f["success"] & ~first(f), outcome=f["outcome"].mask(
            first(f), "timeout")),
    )  # fmt: skip
    after = judge(copied, "D")
    (before,) = [a for a in judged("D").criteria
                 if (a.id, a.candidate) == ("nominal_success_lower", "flow")]  # fmt: skip
    file = rows_of(copied, after).recounted(before)
    assert counted_again(file, before.recount) == (before.recount.whole, 0)
    assert before.recount.part > 0


def test_of_a_sampled_table_all_rows_are_counted_equal_ones_in_one_line(rows, judged, whole):
    (answer,) = [a for a in judged("D").criteria
                 if (a.id, a.candidate) == ("latency_p95_s", "flow")]  # fmt: skip
    file = rows["D"].recounted(answer)
    frame = pd.read_parquet(whole / "artifacts/stress/invocations.parquet")
    own = frame[frame["method"] == "flow"]
    assert file.folded and file.name == "stress.invocations.flow.counts.csv"
    assert file not in rows["D"].of(file.path) and len(file.data) <= LARGEST_BYTES
    found = read(file.data)
    assert set(found[0]) == {*answer.recount.columns, rows_files.EQUAL_ROWS}
    assert sum(int(row[rows_files.EQUAL_ROWS]) for row in found) == file.of == len(own)
    assert file.title == "counts of invocations of flow"


def test_rows_of_all_gates_are_written_out_once(whole, judged, copied):
    """The first page asks for those of every gate, one after the other, and is printed again."""
    module._split.cache_clear()
    first = [rows_of(whole, judged(gate)) for gate in "ABCD"]
    known = module._split.cache_info()
    assert known.currsize == known.misses  # none was dropped
    assert [rows_of(copied, judged(gate)) for gate in "ABCD"] == first
    assert module._split.cache_info().misses == known.misses


def test_counts_that_do_not_fit_are_left_out_and_not_sampled(whole, judged, monkeypatch):
    rows = rows_of(whole, judged("D"))
    assert any(file.folded for file in rows.files)
    module._split.cache_clear()
    monkeypatch.setattr(rows_files, "LARGEST_BYTES", 300)
    small = rows_of(whole, judged("D"))
    module._split.cache_clear()
    (answer,) = [a for a in judged("D").criteria
                 if (a.id, a.candidate) == ("latency_p95_s", "flow")]  # fmt: skip
    assert small.recounted(answer) is None
    assert all(len(file.data) <= 300 for file in small.files if file.folded)


def test_a_row_names_its_rollout_where_the_journal_is_evidence(whole, judged, monkeypatch):
    report = judged("D")
    names = {f"artifacts/stress/journals/flow__{name}.mcap": "0" * 64 for name in ("nominal",)}
    with_journal = report.model_copy(update={"materials": {**report.materials, **names}})
    file = rows_of(whole, with_journal).by_method(ROLLOUTS)["flow"]
    for row in read(file.data):
        name = f"flow/{row['perturbation']}/{row['start']}"
        assert row["rollout"] == (name if row["perturbation"] == "nominal" else "")


def test_evidence_of_other_bytes_has_no_rows(copied, judged):
    """Written anew the table is another one than was judged, and nothing of it is shown."""
    evidence.edit_table(copied, "stress/rollouts.parquet", lambda f: f.assign(force_peak_n=1.0))
    rows = rows_of(copied, judged("D"))
    assert rows.of(ROLLOUTS) == [] and rows.of("artifacts/stress/power.json")
    assert rows.lacking == {ROLLOUTS: module.ALTERED}
    (copied / "artifacts/stress/power.json").unlink()
    rows = rows_of(copied, judged("D"))
    assert rows.of("artifacts/stress/power.json") == []
    assert rows.lacking["artifacts/stress/power.json"] == module.MISSING
    page = gate_page(copied, judged("D"))
    assert f"no rows: {module.ALTERED}" in page and f"no rows: {module.MISSING}" in page


def test_a_table_of_other_methods_alone_says_so(copied, judged):
    """What is asked of candidates only, of a table in which none of them stands."""
    path = "artifacts/stress/invocations.parquet"
    evidence.edit_table(copied, "stress/invocations.parquet", lambda f: f.assign(method="another"))
    digest = sha256_file(copied / path)
    report = judged("D")
    bound = report.model_copy(update={"materials": {**report.materials, path: digest}})
    assert rows_of(copied, bound).lacking == {path: module.OTHERS}


def test_a_table_is_read_once_for_all_its_printings(whole, judged, monkeypatch):
    before = rows_of(whole, judged("C"))
    monkeypatch.setattr(module, "table_of", None)
    assert rows_of(whole, judged("C")) == before


@pytest.mark.parametrize("gate", "ABCD")
def test_files_are_bounded_and_have_names_of_their_own(rows, gate):
    names = [file.name for file in rows[gate].files]
    assert len(set(names)) == len(names) and CRITERIA not in names
    assert all(len(file.data) <= LARGEST_BYTES for file in rows[gate].files)


def test_of_a_larger_table_a_sample_is_kept_that_says_so(rows):
    (file,) = [f for f in rows["D"].of("artifacts/stress/invocations.parquet")
               if f.method == "flow"]  # fmt: skip
    found = [int(row["row"]) for row in read(file.data)]
    assert 0 < file.kept == len(found) < file.of
    assert file.said == f"a sample of {file.kept:,} of {file.of:,} rows"
    assert len(file.data) > LARGEST_BYTES - 200, "as many as fit"
    assert found == sorted(set(found)) and found[-1] <= file.of
    # Drawn, not every so manieth: no condition or repeat is favoured by the order of the table.
    assert len(set(np.diff(found))) > 3 and abs(np.mean(found) / file.of - 0.5) < 0.05


def test_a_text_that_a_spreadsheet_would_run_stays_text(whole, copied):
    bad = '=HYPERLINK("x","y"),\n'
    evidence.edit_table(
        copied, "stress/rollouts.parquet", lambda f: f.assign(rejected_by=bad, force_peak_n=-1.0)
    )
    report = judge(copied, "D")
    file = rows_of(copied, report).by_method(ROLLOUTS)["flow"]
    found = read(file.data)
    assert {row["rejected_by"] for row in found} == {f"'{bad}"}
    assert {row["force_peak_n"] for row in found} == {"-1"}, "a number is no text"


def test_names_that_are_no_names_of_files_meet_no_other(copied):
    names = {"flow": "a/../b", "diffusion": "a_.._b"}
    evidence.edit_table(
        copied, "stress/rollouts.parquet", lambda f: f.assign(method=f["method"].replace(names))
    )
    files = rows_of(copied, judge(copied, "D")).of(ROLLOUTS)
    assert len({file.name for file in files}) == len(files)
    assert all("/" not in file.name and ".." not in file.name.replace("...", "") for file in files)


@pytest.mark.parametrize("gate", "ABCD")
def test_the_criteria_stand_beside_them_with_all_digits(rows, judged, gate):
    printed = printed_rows(rows[gate], judged(gate))
    found = read(printed[CRITERIA])
    assert len(found) == len(judged(gate).criteria)
    for row, answer in zip(found, judged(gate).criteria, strict=True):
        assert (row["criterion"], row["candidate"]) == (answer.id, answer.candidate or "")
        assert (float(row["measured"]) if row["measured"] else None) == answer.measured
        assert (row["low"] == "") == (answer.interval is None)
        assert set(row["rows"].split()) <= set(printed) and row["rows"]
        if answer.recount is not None:
            assert row["recount"] in printed and row["where"] == "; ".join(answer.recount.where)
            assert float(row["whole_value"]) == answer.recount.whole


def test_without_evidence_the_criteria_still_stand_there(tmp_path, judged):
    rows = rows_of(tmp_path, judged("D"))
    assert rows.files == () and set(printed_rows(rows, judged("D"))) == {CRITERIA}
    assert rows_folder("D") == "reports/gate_d" and rows.folder == "gate_d"


def test_evidence_is_only_read(whole, judged):
    """What is shown is what `Evidence` hashes too."""
    report = judged("C")
    digests = {path: Evidence(whole).digest(path) for path in report.materials}
    rows_of(whole, report)
    assert digests == dict(report.materials)
