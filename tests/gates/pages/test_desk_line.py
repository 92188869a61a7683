"""The first line of the desk: of this task, robot and candidate, or that it is not built here."""

import evidence
import pytest
import yaml

from gates.evidence import Evidence, MissingEvidenceError
from gates.pages.bound import require_bound
from gates.pages.desk_line import line_of
from gates.pages.page import index_page
from gates.writing import changed_page, write_gate, write_index

FILE = "artifacts/task/identity.json"


@pytest.fixture
def line(judged):
    """The line of some gates' reports."""

    def of(root, gates, card=None):
        return line_of({gate: judged(gate) for gate in gates}, Evidence(root), card)

    return of


def test_task_robot_and_who_is_promoted(whole, judged, line):
    found = line(whole, "ABCD")
    assert (found.task, found.robot) == ("tabletop_insertion", "panda")
    assert found.candidate == judged("D").promoted
    assert (line(whole, "ABC").candidate, found.signed) == ("", False)


def test_who_made_it_is_said_before_a_card_is_drafted(copied, line):
    """By the settings that a card will be drafted from; and that nobody is named, where so."""
    assert line(copied, "ABC").authors == "ada"
    params = copied / "params.yaml"
    params.write_text(yaml.safe_dump({**yaml.safe_load(params.read_text()), "card": {}}))
    assert line(copied, "A").authors == "an author who is not named"
    params.unlink()
    assert line(copied, "A").authors == ""


def test_of_another_task_than_the_reports_name_nothing_is_said(copied, line):
    evidence.edit_document(copied, "task/identity.json", lambda d: d.update(robot="other"))
    assert line(copied, "ABCD").robot == "robot not built here"
    (copied / FILE).unlink()
    assert line(copied, "A").task == "task not built here"


def test_evidence_that_no_report_names_is_not_bound(copied, judged):
    with pytest.raises(MissingEvidenceError, match="is not the file that the report names"):
        require_bound(Evidence(copied), judged("B"), "artifacts/stress/rollouts.parquet")


def test_the_first_page_is_the_same_each_time_and_holds_no_clock(ladder):
    write_gate(ladder, "D")
    text = index_page(ladder)
    assert text == index_page(ladder)
    assert "tabletop_insertion · panda · <code>flow</code>, promoted by gate D" in text
    assert "genpolicy report status" in text and " UTC" not in text


def test_where_evidence_is_not_built_the_first_page_shows_less_and_is_no_other_page(ladder):
    """What lacks is told by the proof; a page that cannot be printed again proves nothing."""
    path = write_index(ladder)
    (ladder / FILE).unlink()
    assert path.read_text() != index_page(ladder)
    assert changed_page(ladder) == ""
