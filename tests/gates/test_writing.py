"""Reports for people: the same numbers as the JSON (P23), escaped, offline, the same bytes."""

import html
import json
import re
import shutil

import evidence
import pytest

from gates.pages import desk_gates, rows
from gates.pages.numbers import judged_at
from gates.pages.page import gate_page, index_page
from gates.pages.summary import markdown
from gates.proof import judge
from gates.readable import human
from gates.report import Answer, report_bytes, report_path
from gates.writing import changed_page, write_gate
from genpolicy.errors import BadInputError, GenpolicyError

NUMBER = re.compile(r'<data value="([^"]*)" title="([^"]*)">([^<]*)</data>')


ROW = re.compile(r'<tr id="([^"]*)"[^>]*>\s*<th scope="row" class="question">.*?</tr>', re.DOTALL)
CELL = re.compile(r'<td id="([^"]*)".*?</td>', re.DOTALL)


@pytest.fixture(scope="module")
def pages(_written):
    return _written


def _page(root, gate):
    return (root / f"reports/gate_{gate.lower()}.html").read_text()


@pytest.mark.parametrize("gate", "ABCDE")
def test_numbers_in_the_page_are_those_of_the_report(pages, gate):
    report = json.loads((pages / report_path(gate)).read_bytes())
    page = _page(pages, gate)
    rows = {m.group(1): m.group(0) for m in ROW.finditer(page)}
    cells = {m.group(1): m.group(0) for m in CELL.finditer(page)}
    assert sorted(rows) == sorted({c["id"] for c in report["criteria"]})
    assert len(cells) == sum(bool(c["candidate"]) for c in report["criteria"])
    for c in report["criteria"]:
        row = rows[c["id"]]
        cell = cells[f"{c['id']}-{c['candidate']}"] if c["candidate"] else row
        assert cell in row and c["verdict"].replace("_", " ") in cell
        numbers = NUMBER.findall(cell)
        limit, own = NUMBER.findall(row)[:1], numbers if c["candidate"] else numbers[1:]
        if c["threshold"] is None:
            limit, own = [], numbers
        stated = ([c["threshold"]], [c["measured"], *(c["interval"] or ())])
        for found, expected in zip((limit, own), stated, strict=True):
            read = [json.loads(value) for value, _, _ in found]
            assert read == [value for value in expected if value is not None]
        answer = Answer.model_validate_json(json.dumps(c))
        assert all(text == html.escape(human(answer, json.loads(value)))
                   for value, _, text in numbers)  # fmt: skip
        assert (f"judged at {judged_at(answer)}" in cell) == (c["measured"] is not None)
        for path in c["evidence"]:
            known = report["materials"].get(path, "missing")
            assert f'title="{path}"' in row and known[:12] in row
            assert path in report["materials"] or not (pages / path).exists()


@pytest.mark.parametrize("gate", "ABCDE")
def test_no_link_leads_to_what_a_clone_does_not_bring(pages, gate):
    """Its path and its hash stand there as text, and one sentence says where it comes from."""
    page, report = _page(pages, gate), json.loads((pages / report_path(gate)).read_bytes())
    assert 'href="../artifacts' not in page and page.count("no clone brings") == 1
    for path, digest in report["materials"].items():
        assert digest in page and f'title="{path}"' in page
        assert (f'href="../{path}"' in page) == (not path.startswith("artifacts/"))


def test_what_holds_is_folded_and_what_does_not_stands_open(pages, tmp_path):
    root = tmp_path / "repo"
    shutil.copytree(pages, root)
    report = judge(root, "D")
    first = next(c for c in report.criteria if c.candidate == "diffusion")
    fell = tuple(
        c.model_copy(update={"verdict": "FAIL"}) if c is first else c for c in report.criteria
    )
    page = gate_page(root, report.model_copy(update={"criteria": fell}))
    shown, folded = page[page.index("<h2>Criteria</h2>") :].split("of which every answer holds")
    assert f'<tr id="{first.id}">' in shown and f'<tr id="{first.id}">' not in folded
    kept = {c.id for c in report.criteria} - {first.id}
    assert all(f'<tr id="{name}">' in folded and name not in shown for name in kept)
    assert f"{len(kept)} questions" in shown and '<details class="kept"><summary>' in shown


@pytest.mark.parametrize("gate", "AD")
def test_same_evidence_same_bytes(pages, gate):
    rows._split.cache_clear()
    report = judge(pages, gate)
    assert report_bytes(report) == (pages / report_path(gate)).read_bytes()
    assert gate_page(pages, report) == _page(pages, gate)
    assert markdown(report) == (pages / f"reports/gate_{gate.lower()}.md").read_text()


def test_same_reports_same_front_page_drawn_again(pages):
    desk_gates._drawn.cache_clear()
    rows._split.cache_clear()
    assert index_page(pages) == (pages / "reports/index.html").read_text()


def test_the_first_page_that_is_another_one_is_named(pages, tmp_path):
    root = tmp_path / "repo"
    shutil.copytree(pages, root)
    assert changed_page(root) == ""
    spoilt = ("index.html", "gate_a.md", "gate_a.html", "gate_e.md", "gate_e.html")
    for name in reversed(spoilt):
        page = root / "reports" / name
        page.write_bytes(page.read_bytes() + b"<!-- -->")
        assert changed_page(root) == f"reports/{name}"
    for name in spoilt:  # what was not printed is no other page
        (root / "reports" / name).unlink()
    assert changed_page(root) == ""


def test_a_page_that_the_lock_file_records_is_left_to_it(pages, tmp_path):
    root = tmp_path / "repo"
    shutil.copytree(pages, root)
    page = root / "reports/gate_b.md"
    page.write_text("other")
    lock = json.loads((root / "dvc.lock").read_text())
    lock["stages"]["gate_b"] = {"cmd": "gate", "outs": [{"path": "reports/gate_b.md"}]}
    (root / "dvc.lock").write_text(json.dumps(lock))
    assert changed_page(root) == ""
    (root / "reports/gate_b.html").write_text("other")
    assert changed_page(root) == "reports/gate_b.html"
    (root / report_path("B")).unlink()
    (root / "reports/index.html").write_bytes(index_page(root).encode())
    assert changed_page(root) == ""


def test_a_report_that_cannot_be_removed_is_bad_input(ladder):
    report = ladder / report_path("A")
    report.unlink()
    report.mkdir()
    with pytest.raises(BadInputError, match=r"not removable .*writable reports folder"):
        write_gate(ladder, "A")


def test_a_fail_is_written_like_any_verdict(ladder):
    evidence.edit_table(ladder, "audit/clocks.parquet", evidence.lags_apart)
    assert write_gate(ladder, "A").verdict == "FAIL"
    text = _page(ladder, "A")
    assert "lag_spread_rows" in text.split("<h2>Criteria</h2>")[0]
    assert "FAIL" in index_page(ladder)


def test_a_judge_that_cannot_finish_leaves_no_old_verdict(ladder):
    (ladder / "artifacts/audit/clocks.parquet").write_bytes(b"no table")
    with pytest.raises(GenpolicyError):
        write_gate(ladder, "A")
    assert not (ladder / report_path("A")).exists()


def test_a_gate_that_is_being_judged_has_no_verdict_on_the_front_page(ladder):
    """Nor afterwards, where the judge stopped: a verdict from before would be nobody's."""
    write_gate(ladder, "C")
    page = ladder / "reports/index.html"
    before = page.read_text().count("NOT JUDGED")
    (ladder / "params.yaml").write_text("gate_c: 1")
    with pytest.raises(GenpolicyError):
        write_gate(ladder, "C")
    assert page.read_text().count("NOT JUDGED") > before
    assert page.read_text() == index_page(ladder)
