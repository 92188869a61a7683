"""Reports for people: the same numbers as the JSON (P23), escaped, offline, the same bytes."""

import html
import json
import re
import shutil

import evidence
import pytest

from gates.pages.page import gate_page, index_page
from gates.pages.summary import markdown, plain
from gates.proof import judge
from gates.report import report_bytes, report_path
from gates.writing import write_gate
from genpolicy.errors import GenpolicyError

EVIL = '<script>alert("x")</script>'
NUMBER = re.compile(r'<data value="([^"]*)" title="([^"]*)">([^<]*)</data>')
ROW = re.compile(r'<tr id="([^"]*)".*?</tr>', re.DOTALL)


@pytest.fixture(scope="module")
def pages(tmp_path_factory, _ladder):
    root = tmp_path_factory.mktemp("pages") / "repo"
    shutil.copytree(_ladder, root)
    for gate in "ABCDE":
        write_gate(root, gate)
    return root


def _page(root, gate):
    return (root / f"reports/gate_{gate.lower()}.html").read_text()


@pytest.mark.parametrize("gate", "ABCDE")
def test_numbers_in_the_page_are_those_of_the_report(pages, gate):
    report = json.loads((pages / report_path(gate)).read_bytes())
    rows = {m.group(1): m.group(0) for m in ROW.finditer(_page(pages, gate))}
    assert len(rows) == len(report["criteria"])
    for c in report["criteria"]:
        row = rows[c["id"] + (f"-{c['candidate']}" if c["candidate"] else "")]
        expected = [
            v for v in (c["measured"], *(c["interval"] or ()), c["threshold"]) if v is not None
        ]
        found = NUMBER.findall(row)
        assert [json.loads(value) for value, _, _ in found] == expected
        assert all(text == f"{json.loads(value):.6g}" for value, _, text in found)
        assert c["verdict"].replace("_", " ") in row
        for path in c["evidence"]:
            assert f'href="../{path}"' in row and report["materials"][path][:12] in row


@pytest.mark.parametrize("gate", "ABCDE")
def test_the_page_is_offline_small_and_whole(pages, gate):
    text = _page(pages, gate)
    assert "http:" not in text.replace("http-equiv", "") and "https:" not in text
    assert "<script" not in text and "xlink" not in text
    assert "default-src 'none'" in text
    assert len(text.encode()) < 2_000_000
    assert "Not drawn" not in text
    report = json.loads((pages / report_path(gate)).read_bytes())
    assert all(
        html.escape(c, quote=False) in html.unescape(text).replace("&", "&amp;")
        or c in html.unescape(text)
        for c in report["caveats"]
    )
    assert text.index(report["verdict"].replace("_", " ")) < text.index("<h2>Criteria</h2>")


def test_the_front_page_names_every_gate(pages):
    text = (pages / "reports/index.html").read_text()
    for gate in "ABCDE":
        assert f"gate_{gate.lower()}.html" in text
    assert "PENDING REVIEW" in text and "http:" not in text.replace("http-equiv", "")


@pytest.mark.parametrize("gate", "AD")
def test_same_evidence_same_bytes(pages, gate):
    report = judge(pages, gate)
    assert report_bytes(report) == (pages / report_path(gate)).read_bytes()
    assert gate_page(pages, report) == _page(pages, gate)
    assert markdown(report) == (pages / f"reports/gate_{gate.lower()}.md").read_text()


def test_names_cannot_break_out_of_page_figure_or_table(ladder):
    for name in ("audit/modes.parquet", "audit/recovery.parquet"):
        evidence.edit_table(ladder, name, lambda f: f.assign(mode=EVIL + f["mode"] + "|@all"))
    report = write_gate(ladder, "A")
    text = _page(ladder, "A")
    assert "<script" not in text and "&lt;script&gt;" in text
    lines = markdown(report).splitlines()
    assert not any("<script" in line or "@all" in line for line in lines)
    widths = {len(re.findall(r"(?<!\\)\|", line)) for line in lines if line.startswith("| ")}
    assert widths == {8}


@pytest.mark.parametrize("text", ["a|b", "<b>", "@team", "`x`", "[l](u)", "two\nlines", "# h"])
def test_markdown_text_is_plain(text):
    out = plain(text)
    assert "\n" not in out and "<" not in out and "@" not in out
    assert not re.search(r"(?<!\\)[`|\[\]()#]", out.replace("&#64;", "").replace("&lt;", ""))


def test_a_missing_table_is_said_in_place_of_its_figure(ladder):
    (ladder / "artifacts/audit/strata.parquet").unlink()
    report = write_gate(ladder, "A")
    assert report.verdict == "INCONCLUSIVE"
    assert "Not drawn: artifacts/audit/strata.parquet is missing." in _page(ladder, "A")


def test_a_fail_is_written_like_any_verdict(ladder):
    evidence.edit_table(ladder, "audit/clocks.parquet", lambda f: f.assign(offset_after_s=0.5))
    assert write_gate(ladder, "A").verdict == "FAIL"
    text = _page(ladder, "A")
    assert "clock_residual_s" in text.split("<h2>Criteria</h2>")[0]
    assert "FAIL" in index_page(ladder)


def test_a_judge_that_cannot_finish_leaves_no_old_verdict(ladder):
    (ladder / "artifacts/audit/clocks.parquet").write_bytes(b"no table")
    with pytest.raises(GenpolicyError):
        write_gate(ladder, "A")
    assert not (ladder / report_path("A")).exists()
