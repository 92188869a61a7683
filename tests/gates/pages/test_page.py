"""Pages: whole, offline, escaped."""

import html
import json
import re
import sys
from pathlib import Path

import evidence
import pytest
from markupsafe import escape

sys.path.insert(0, str(Path(__file__).parents[1] / "card"))
from markup import Markup
from team import PEOPLE, Team

from gates.card.signing import read_draft
from gates.doubt import texts_once
from gates.pages.page import coded, gate_page, index_page
from gates.pages.summary import markdown
from gates.report import read_report, report_path
from gates.writing import write_gate, write_index

EVIL = '<script>alert("x")</script>'


@pytest.fixture(scope="module")
def pages(_written):
    return _written


def _page(root, gate):
    return (root / f"reports/gate_{gate.lower()}.html").read_text()


@pytest.mark.parametrize("gate", "ABCDE")
def test_the_page_is_offline_small_and_whole(pages, gate):
    text = _page(pages, gate)
    assert "http:" not in text.replace("http-equiv", "") and "https:" not in text
    assert "<script" not in text and "xlink" not in text
    assert "default-src 'none'" in text
    assert len(text.encode()) < 2_000_000
    assert "Not drawn" not in text
    report = json.loads((pages / report_path(gate)).read_bytes())
    said = html.unescape(re.sub(r"</?code>", "", text))
    assert all(
        html.escape(c, quote=False) in said.replace("&", "&amp;") or c in said
        for c in (t.replace("`", "") for t in texts_once(report["caveats"], report["candidates"]))
    )
    assert text.index(report["verdict"].replace("_", " ")) < text.index("<h2>Criteria</h2>")


@pytest.mark.parametrize("page", ["index", *(f"gate_{gate}" for gate in "abcde")])
def test_no_sentence_of_a_page_has_a_bare_backtick(pages, page):
    assert "`" not in (pages / f"reports/{page}.html").read_text()


def test_what_a_sentence_marks_is_code_and_nothing_of_it_is_markup():
    """Golden by hand; injected fault: markup of somebody else inside and outside."""
    assert coded("Run `make <all>` & wait") == "Run <code>make &lt;all&gt;</code> &amp; wait"
    assert coded(f"one ` alone, {EVIL}") == f"one ` alone, {escape(EVIL)}"


@pytest.mark.parametrize("gate", "ABCDE")
def test_the_markup_of_a_page_is_what_a_checker_takes(pages, gate):
    assert Markup(_page(pages, gate)).wrong == []


def test_the_markup_of_the_front_page_is_what_a_checker_takes(pages):
    write_index(pages)
    assert Markup((pages / "reports/index.html").read_text()).wrong == []


@pytest.mark.parametrize(
    ("text", "wrong"),
    [
        ("<figure><h3>a</h3><figcaption>b</figcaption><p>c</p></figure>", "caption"),
        ("<h1>a</h1><h3>b</h3>", "h3 follows h1"),
        ('<p id="a">b</p><p id="a">c</p>', "id a stands 2 times"),
        ("<div><p>a</div>", "div ends where p is open"),
        ("<div>", "stay open"),
        ("<p><ul><li>a</li></ul></p>", "ul stands in p"),
        ("<span><div>a</div></span>", "div stands in span"),
        ('<img src="a">', "a picture has no text"),
        ('<b class="a" class="b">c</b>', "b has an attribute twice"),
        ('<div aria-label="a">b</div>', "div has a name and no role"),
        ("<table><tr><td>a</td></tr><tr><td>a</td><td>b</td></tr></table>", "rows of [1, 2] cells"),
        ('<table><tr><td colspan="2">a</td></tr><tr><td>a</td></tr></table>', "rows of [1, 2]"),
    ],
)
def test_the_checker_of_markup_sees_what_is_wrong(text, wrong):
    assert any(wrong in found for found in Markup(text).wrong)


def test_the_front_page_names_every_gate(pages):
    text = (pages / "reports/index.html").read_text()
    for gate in "ABCDE":
        assert f"gate_{gate.lower()}.html" in text
    assert "PENDING REVIEW" in text and "http:" not in text.replace("http-equiv", "")


def test_the_links_between_pages_lead_to_what_is_there(pages, tmp_path):
    """A gate's page to the boxes of the desk, which leads to pages of judged gates alone."""
    boxes = set(re.findall('id="(gate-[a-e])"', index_page(tmp_path)))
    assert boxes == {f"gate-{gate}" for gate in "abcde"}
    assert 'href="gate_' not in index_page(tmp_path)
    for gate in "abcde":
        (nav,) = re.findall("<nav.*?</nav>", _page(pages, gate))
        assert set(re.findall('index.html#(gate-.)"', nav)) == boxes - {f"gate-{gate}"}
        assert "gate_" not in nav


def test_names_cannot_break_out_of_page_figure_or_table(ladder):
    for name in ("audit/modes.parquet", "audit/recovery.parquet"):
        evidence.edit_table(ladder, name, lambda f: f.assign(mode=EVIL + f["mode"] + "|@all"))
    report = write_gate(ladder, "A")
    text = _page(ladder, "A")
    assert "<script" not in text and "&lt;script&gt;" in text
    lines = markdown(report).splitlines()
    assert not any("<script" in line or "@all" in line for line in lines)
    widths = {len(re.findall(r"(?<!\\)\|", line)) for line in lines if line.startswith("| ")}
    assert widths == {9}


def test_markup_in_the_fields_of_a_signed_card_stays_text(ladder):
    """Whoever signs writes words; a page that ran them would be another card than was signed."""
    team = Team(ladder)
    team.sign(team.complete(stop_path=EVIL, force_limit_reason=f"<img src=x>{EVIL}"), PEOPLE)
    evidence.record(ladder)
    write_gate(ladder, "E")
    write_index(ladder)
    for page in (_page(ladder, "E"), (ladder / "reports/index.html").read_text()):
        assert "<script" not in page and "<img src=x" not in page
        assert "&lt;script&gt;" in page
    assert "<script" not in (ladder / "reports/gate_e.md").read_text()


def test_a_missing_table_is_said_in_place_of_its_figure(ladder):
    evidence.replace(ladder, "audit/strata.parquet", None)
    report = write_gate(ladder, "A")
    assert report.verdict == "INCONCLUSIVE"
    assert "Not drawn: artifacts/audit/strata.parquet is missing." in _page(ladder, "A")


def test_what_holds_of_two_candidates_alike_is_said_once_and_the_card_keeps_each(ladder):
    """On the gate's page and in its summary; what is signed stays word for word."""
    alike = "the card&#39;s box reaches up to 20 mm beyond what was visited"
    report = read_report(ladder, "D")[0]
    single = [f"{name}: {html.unescape(alike)}" for name in ("diffusion", "flow")]
    assert all(any(c.startswith(text) for c in report.caveats) for text in single)
    page = gate_page(ladder, report)
    assert page.count(alike) == 1 and f"diffusion and flow, each: {alike}" in page
    # The desk is about the one that is promoted; of the other it is said behind, folded.
    desk, folded = index_page(ladder).split("about other candidates than", 1)
    assert report.promoted == "flow" and f"flow: {alike}" in desk and desk.count(alike) == 1
    assert f"diffusion: {alike}" in folded and folded.count(alike) == 1
    assert markdown(report).count("beyond what was visited") == 1
    caveats = read_draft(ladder).caveats
    assert all(any(c.startswith(text) for c in caveats) for text in single)
    seed = re.search(
        "<li><b>one training seed</b>((?:(?!<li>).)*?)flow: trained", index_page(ladder)
    )
    assert re.findall(r'<a href="gate_(.)\.html', seed[1]) == ["b", "d"]
