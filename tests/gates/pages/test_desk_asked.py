"""What nobody is asked for: practice, chains that moved below, damaged reports, dead drafts."""

import json

import pytest

from gates.card.card import DRAFT_PATH
from gates.evidence import Evidence
from gates.pages.desk import desk_of, other_below
from gates.pages.desk_card import papers_of, signing_of
from gates.pages.desk_line import line_of
from gates.pages.page import index_page
from gates.protection import REHEARSED
from gates.report import GATES, NAMES, read_report, report_bytes
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.hashing import sha256_file


def desk(ladder):
    found = {}
    for gate in GATES:
        if (ladder / f"reports/gate_{gate.lower()}.json").is_file():
            found[gate] = read_report(ladder, gate)[0]
    at = Evidence(ladder)
    return desk_of(found, signing_of(found, at, papers_of(found, at)).pending)


@pytest.fixture
def waits(ladder, judged):
    """That ladder with the report of a gate E that waits, and what its first page says then."""

    def waits(**changes):
        bound = {DRAFT_PATH: sha256_file(ladder / DRAFT_PATH)}
        report = judged("E")
        changes = {"materials": {**report.materials, **bound}, **changes}
        (ladder / "reports/gate_e.json").write_bytes(
            report_bytes(report.model_copy(update=changes))
        )
        return index_page(ladder)

    return waits


def test_a_rehearsal_asks_for_no_signature_and_says_why(ladder, judged, waits):
    """Its limits may be looser, and each signature would be refused."""
    text = waits(caveats=(*judged("E").caveats, f"{REHEARSED} Looser: one_limit."))
    found = desk(ladder)
    assert found.asked.title == "Nothing is asked of you: no card of a rehearsal can be signed"
    assert "not say `rehearsal: true`" in found.asked.text and found.asked.pending == ""
    assert (found.boxes[-1].number, found.boxes[-1].of) == (
        "", "no card of a rehearsal can be signed",
    )  # fmt: skip
    for asks in ("Asked of you", "Still to sign", "Still to fill", "genpolicy card", "to fill<"):
        assert asks not in text
    assert "<b>Nothing of this can be signed.</b> A rehearsal: limits that protect" in text


def test_a_chain_that_is_judged_again_below_asks_nothing_and_says_nothing_signed(ladder, judged):
    """The verdicts above are of another report than lies there, whatever they say."""
    reports = {gate: read_report(ladder, gate)[0] for gate in "ABCD"}
    reports["E"] = judged("E").model_copy(update={"verdict": "PASS"})
    promoted, at = reports["D"].promoted, Evidence(ladder)
    assert desk_of(reports).asked.title.startswith(f"Signed: {promoted} may move a robot")
    assert line_of(reports, at, None).signed and other_below(reports, "E") is None
    reports["A"] = reports["A"].model_copy(update={"caveats": ("Judged again.",)})
    found = desk_of(reports)
    assert found.asked.title == (
        "Nothing is asked of you: gate B was judged over another report of gate A"
    )
    assert "make ladder" in found.asked.text and not found.asked.pending
    assert [box.of.endswith("over another report of gate A") for box in found.boxes] == [
        False, True, True, True, True,
    ]  # fmt: skip
    assert not line_of(reports, at, None).signed
    stopped = {**reports, "A": reports["A"].model_copy(update={"verdict": "FAIL"})}
    title = desk_of(stopped).asked.title
    assert title.startswith("Nothing is asked of you yet: the ladder stops at gate A")


def test_a_damaged_report_is_told_apart_from_one_that_is_missing(ladder):
    path = ladder / "reports/gate_d.json"
    path.write_text(path.read_text()[:-40])
    text = index_page(ladder)
    assert f"Nothing is asked of you: the report of gate D ({NAMES['D']}) cannot be read" in text
    asked = text[text.index('<div class="asked">') :].partition("</div>")[0]
    assert "not judged" not in asked and "dvc repro -f gate_d" in asked
    box = text[text.index('id="gate-d"') :].partition("</div>")[0]
    assert "✕ UNREADABLE" in box and "href" not in box
    path.unlink()
    missing = desk(ladder)
    assert missing.asked.text == "It was not judged: `make ladder`."
    assert missing.boxes[3].verdict == "NOT JUDGED"


def test_a_draft_without_authors_is_nobodys_to_fill(ladder, waits):
    """As `params.yaml` ships: what the draft fixes is named apart, with what to do."""
    path = ladder / DRAFT_PATH
    path.write_bytes(canonical_json({**json.loads(path.read_bytes()), "authors": []}))
    text = waits()
    assert desk(ladder).asked.pending == "a draft with authors, 5 signatures, 7 fields"
    assert "Nobody can fill authors:" in text and "card.authors" in text
    assert "genpolicy card fill" not in text
    fields = text[text.index("Still to fill: ") :].partition("</p>")[0]
    assert "authors" not in fields and "spotter" in fields
