"""Links between pages and out of them: each leads to what lies there, in each state of a ladder."""

import html
import re
import shutil
import sys
from pathlib import Path

import evidence

sys.path.insert(0, str(Path(__file__).parents[1] / "card"))
from team import PEOPLE, Team

from gates.writing import write_gate, write_index

LINK = re.compile(r'\b(?:href|src)="([^"]*)"')
ELSEWHERE = ("https://", "data:")


def dead(root):
    """Links of all pages below `root` whose file, or whose place in a page, is not there."""
    pages = {page.resolve(): page.read_text() for page in root.rglob("*.html")}
    places = {page: set(re.findall(r'\bid="([^"]*)"', text)) for page, text in pages.items()}
    assert pages
    found = []
    for page, text in pages.items():
        for link in map(html.unescape, LINK.findall(text)):
            path, _, place = link.partition("#")
            target = (page.parent / path).resolve() if path else page
            known = target.exists() and (not place or place in places.get(target, {place}))
            if not link.startswith(ELSEWHERE) and not known:
                found.append(f"{page.name}: {link}")
    return found


def test_of_nothing_that_was_judged_no_link_is_dead(tmp_path):
    write_index(tmp_path)
    assert dead(tmp_path) == []


def test_of_a_ladder_that_waits_for_people_no_link_is_dead(_written):
    assert dead(_written / "reports") == []
    page = (_written / "reports/gate_e.html").read_text()
    row = re.search(r'<span title="cards/trial.dsse.json">.*?</code>', page)
    assert row and ">missing</code>" in row[0], "of what is not there it says so"
    assert '<a href="../reviewers.yaml"' in page


def test_of_a_card_that_is_signed_no_link_is_dead(_written, tmp_path):
    root = tmp_path / "repo"
    shutil.copytree(_written, root)
    team = Team(root)
    team.sign(team.complete(), list(PEOPLE))
    evidence.record(root)
    write_gate(root, "E")
    assert dead(root / "reports") == []
    assert '<a href="../cards/trial.dsse.json"' in (root / "reports/gate_e.html").read_text()


def test_of_a_ladder_that_stops_no_link_is_dead(repo):
    evidence.replace(repo, "audit/strata.parquet", None)
    evidence.edit_table(repo, "audit/clocks.parquet", evidence.lags_apart)
    write_gate(repo, "A")
    assert dead(repo / "reports") == []


def test_a_link_that_leads_nowhere_is_told(tmp_path):
    (tmp_path / "there.html").write_text('<p id="b"><a href="#b">a</a>')
    (tmp_path / "page.html").write_text(
        '<a href="there.html#b">a</a><a href="there.html#c">a</a><a href="gone.csv">a</a>'
        '<a href="#d">a</a><img src="data:x"><a href="https://example.org/#e">a</a>'
    )
    assert dead(tmp_path) == [f"page.html: {one}" for one in ("there.html#c", "gone.csv", "#d")]
