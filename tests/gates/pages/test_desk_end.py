"""The end of the desk: hashes that can be made again, settings, and the one glossary."""

import hashlib
import json
from pathlib import Path

import pytest

from gates.pages.desk_end import end_of, glossary
from gates.report import report_bytes

PAGES = Path(__file__).parents[3] / "gates" / "pages"


@pytest.fixture(scope="module")
def end(judged):
    return end_of({gate: judged(gate) for gate in "AD"})


def test_hashes_are_those_that_a_reader_makes_of_the_report(end, judged):
    heads, *lines = end.hashes
    assert [line[0] for line in lines] == ["A", "D"] and len(heads) == len(lines[0])
    for gate, report, evidence, code, parameters, runs, settings in lines:
        document = json.loads(report_bytes(judged(gate)))
        assert report == hashlib.sha256(report_bytes(judged(gate))).hexdigest()
        of = {key: _digest(document[key]) for key in document if isinstance(document[key], dict)}
        assert evidence == f"{len(document['materials']):,} files: {of['materials']}"
        assert (code, parameters) == (of["code"], of["parameters"])
        assert (runs, settings) == (of["pipeline"], of["settings"])


def _digest(content):
    """Sorted keys, two spaces, a last newline: as the page says."""
    text = json.dumps(content, sort_keys=True, indent=2, ensure_ascii=False) + "\n"
    return hashlib.sha256(text.encode()).hexdigest()


def test_settings_are_those_of_the_report_that_fit_a_line(end, judged):
    found = {(gate, name): value for gate, name, value in end.settings[1:]}
    assert found["D", "planned starts"] == str(judged("D").settings["planned_starts"])
    assert found["D", "perturbations"] == ", ".join(judged("D").settings["perturbations"])
    assert found["D", "maximum age, s"] == "0.45"
    assert ("A", "cause") not in found, "nested ones stand on the gate's page"


def test_words_are_all_rows_of_the_glossary_and_stand_nowhere_else():
    text = (PAGES / "glossary.md").read_text()
    words = dict(glossary())
    rows = [row for row in text.splitlines() if row.startswith("| ")][1:]
    assert len(words) == len(rows) > 20 and "word" not in words
    assert words["NFE"].startswith("evaluations of the network") and "`" not in str(words)
    assert not (PAGES.parents[1] / "docs" / "glossary.md").exists()
