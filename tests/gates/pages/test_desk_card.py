"""What you sign: what was seen stands beside what is proposed, and where it reaches beyond."""

import dataclasses
import re
import sys
from pathlib import Path

import evidence
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "card"))
from team import PEOPLE, Team

from gates.card.signing import read_draft
from gates.evidence import Evidence
from gates.pages import page
from gates.pages.desk_card import ABORTS, MISSING, NOT_PROPOSED, card_of, papers_of, signing_of
from gates.pages.page import index_page
from gates.pages.rows import rows_of
from gates.report import report_bytes
from gates.stress.visited import BEYOND


@pytest.fixture(scope="module")
def waits(judged):
    """Reports of a ladder whose card waits for people."""
    return {gate: judged(gate) for gate in "ABCDE"}


def of(root, reports):
    found = Evidence(root)
    papers = papers_of(reports, found)
    return signing_of(reports, found, papers), card_of(papers)


def by_field(signing):
    return {item.field: item for item in signing.items}


def test_what_was_not_seen_is_not_proposed_and_left_to_people(whole, waits):
    signing, card = of(whole, waits)
    assert card == read_draft(whole)
    unseen = {
        "Ends it: contact force above", "Stop path", "Who stands at it", "Days of validity",
    }  # fmt: skip
    assert {i.field for i in signing.items if i.proposed == NOT_PROPOSED} == unseen
    assert all(item.yours == "" for item in signing.items if item.field in unseen)
    assert signing.signed == () and signing.lacking == (
        "reviewer", "model", "perception", "controller", "safety",
    )  # fmt: skip
    assert signing.caveats == len(read_draft(whole).caveats) > 0
    assert signing.fields == (
        "expires", "force_limit_n", "force_limit_reason", "not_before", "reviewer", "spotter",
        "stop_path",
    )  # fmt: skip
    assert signing.pending == "5 signatures, 7 fields"


@pytest.mark.parametrize("visited", [False, True])
def test_of_a_box_that_reaches_beyond_what_was_visited_the_page_says_so(
    copied, waits, visited, monkeypatch
):
    """It proposes the box that rollouts were held to, whether or not they went to its sides."""
    papers = papers_of(waits, Evidence(copied))
    caveats = tuple(c for c in papers.draft.caveats if not (visited and BEYOND.match(c)))
    drafted = papers.draft.model_copy(update={"caveats": caveats})
    papers = dataclasses.replace(papers, draft=drafted)
    assert signing_of(waits, Evidence(copied), papers).beyond == (not visited)
    monkeypatch.setattr(page, "papers_of", lambda reports, found: papers)
    (copied / "reports/gate_e.json").write_bytes(report_bytes(waits["E"]))
    text = page.index_page(copied)
    part = text[text.index("6 · What you sign") : text.index("7 · Your part")]
    assert "Only what rollouts were held to is proposed" in part
    assert "not seen in simulation is not proposed" not in part
    assert ("held to, and it reaches beyond where they went: see 1." in part) == (not visited)
    weighed = text[text.index('<ol class="doubts">') : text.index("2 · How close")]
    assert "<b>not visited</b>" in weighed.partition("<details")[0]


def test_the_box_and_the_speed_stand_beside_how_far_the_commands_went(whole, waits):
    items = by_field(of(whole, waits)[0])
    assert items["Workspace, mm"].seen == "x 360 to 690, y -180 to 200, z 30 to 250"
    assert items["Workspace, mm"].proposed == "x 350 to 700, y -200 to 200, z 30 to 250"
    assert items["Speed of the tool"].seen == "at most 0.25 m/s"


def test_every_threshold_is_named_with_what_was_seen_and_its_owner(whole, waits):
    signing, card = of(whole, waits)
    ends = [i for i in signing.items if i.field.removeprefix("Ends it: ") in ABORTS.values()]
    assert len(ends) == len(card.abort_thresholds) == len(ABORTS)
    late = by_field(signing)[f"Ends it: {ABORTS['latency_s']}"]
    [answer] = [
        c for c in waits["D"].criteria if (c.id, c.candidate) == ("latency_p95_s", card.candidate)
    ]
    seen = f"at most {1000 * answer.measured:.3g} ms in the worst condition"
    assert late.seen == f"{seen}; {card.abort_windows['latency_s'].tried}"
    assert late.proposed == f"{1000 * answer.threshold:.3g} ms, over the last 20 answers"
    assert late.owner == answer.owner


def test_the_rollback_says_its_own_success(whole, waits):
    back = by_field(of(whole, waits)[0])["What runs instead"]
    assert back.seen == "succeeds in 50 %, 280 of 560 rollouts"
    assert back.proposed.startswith("stop, then bc (checkpoint ")


def test_what_was_seen_leads_to_its_rows(copied, judged):
    """On the first page; each file that is named is one that is printed beside it."""
    (copied / "reports/gate_e.json").write_bytes(report_bytes(judged("E")))
    page = index_page(copied)
    printed = {
        f"gate_{gate.lower()}/{file.name}"
        for gate in "ABCDE"
        for file in rows_of(copied, judged(gate)).files
    }
    part = page[page.index("6 · What you sign") : page.index("7 · Your part")]
    leads = dict(re.findall(r'<tr><th scope="row">(.*?)</th><td><a href="(.*?)">', part))
    promoted, back = read_draft(copied).candidate, "bc"
    assert leads["Ends it: contact force above"].endswith(f"{promoted}.csv")
    assert leads["What runs instead"].endswith(f"{back}.csv")
    assert {f"Ends it: {text}" for text in ABORTS.values()} <= set(leads)
    boxes = page[page.index('<div class="boxes">') : page.index("1 · What could make this wrong")]
    leads["boxes"], *others = re.findall(r'<b><a href="([^"]*/[^"]*)"', boxes)
    assert len(others) >= 2
    for href in [*leads.values(), *others]:
        assert href in printed or href.endswith("/criteria.csv"), href
    assert "Stop path" not in leads and "Days of validity" not in leads


def test_without_contact_nothing_is_known_of_force(copied, waits):
    evidence.edit_table(copied, "stress/rollouts.parquet", lambda f: f.assign(force_peak_n=0.0))
    digest = Evidence(copied).digest("artifacts/stress/rollouts.parquet")
    d = waits["D"]
    told = {**d.materials, "artifacts/stress/rollouts.parquet": digest}
    found = by_field(of(copied, {**waits, "D": d.model_copy(update={"materials": told})})[0])
    assert (
        found["Ends it: contact force above"].seen
        == "no contact in 560 of 560 rollouts: nothing is known"
    )


def test_evidence_of_another_run_is_not_shown_beside_the_card(copied, waits):
    evidence.edit_table(copied, "stress/rollouts.parquet", lambda f: f.assign(force_peak_n=0.0))
    evidence.edit_document(copied, "stress/envelope.json", lambda d: d.update(condition="x"))
    items = by_field(of(copied, waits)[0])
    for field in ("Workspace, mm", "Speed of the tool", "Ends it: contact force above"):
        assert items[field].seen == "not built here"
    assert items["What runs instead"].seen == "not built here"


def test_before_a_card_is_judged_nothing_is_to_be_signed(whole, copied, waits):
    fewer = {gate: report for gate, report in waits.items() if gate != "E"}
    assert "no card is drafted" in of(whole, fewer)[0].missing
    (copied / "artifacts/card/card.json").unlink()
    assert of(copied, waits) == (of(whole, fewer)[0], None)


def test_what_people_set_and_who_they_are(copied, judged):
    team = Team(copied)
    team.sign(team.complete(), [*PEOPLE][:2])
    reports = {**{gate: judged(gate) for gate in "ABCD"}, "E": team.judge()}
    signing, card = of(copied, reports)
    items = by_field(signing)
    assert items["Ends it: contact force above"].yours == "30 N: measured at this cell"
    assert items["Days of validity"].yours == "2026-11-20 to 2026-11-30"
    assert signing.pending == "3 signatures" and reports["E"].verdict == "PENDING_REVIEW"
    assert signing.signed == ("rita (reviewer)", "mo (model)")
    assert signing.lacking == ("perception", "controller", "safety")
    assert card.spotter == items["Who stands at it"].yours == "sam"


def test_what_a_signed_card_lacks_is_said_to_be_missing(copied, judged):
    """Forged past every check of signing: gate E refuses it, and its page is there to say so."""
    team = Team(copied)
    team.sign(team.complete(), ["rita"])

    def without_limits(payload):
        payload["predicate"].update(force_limit_n=None, abort_thresholds={})
        return payload

    team.forge(without_limits)
    reports = {**{gate: judged(gate) for gate in "ABCD"}, "E": team.judge()}
    signing, card = of(copied, reports)
    assert reports["E"].verdict == "FAIL" and card.force_limit_n is None
    aborts = {f"Ends it: {words}" for words in ABORTS.values()}
    lacking = {field for field, item in by_field(signing).items() if item.yours == MISSING}
    assert lacking == {"Ends it: contact force above", *aborts}


def test_a_refused_card_is_said_to_be_refused(copied, judged):
    team = Team(copied)
    team.sign(team.complete(), ["rita"])
    team.allow({})
    reports = {**{gate: judged(gate) for gate in "ABCD"}, "E": team.judge()}
    signing, card = of(copied, reports)
    assert "unknown key" in signing.refusal and signing.signed == ()
    assert card == read_draft(copied)


def test_a_card_of_other_reports_is_not_shown_as_what_one_signs(copied, waits):
    """While Gate D is judged again, for other candidates too: the draft before lies there still."""
    path = copied / "reports/gate_d.json"
    path.write_bytes(path.read_bytes() + b" ")
    other = waits["D"].model_copy(update={"criteria": (), "promoted": "another"})
    signing, _ = of(copied, {**waits, "D": other})
    assert signing.items == () and "drafted from other reports" in signing.missing
