"""What a terminal shows; and that the worked answers of the docs are what the command prints."""

import os
import re
from dataclasses import replace
from pathlib import Path

import pytest
from causes_planted import CAUSES, FLOW
from test_walk import without

from gates.diagnosis.checkpoints import CHECKPOINTS
from gates.diagnosis.looking import Look
from gates.diagnosis.printed import WIDE, checkpoints_text, gates_text, symptoms_text, walk_text
from gates.diagnosis.reports import EVERYBODY
from gates.diagnosis.symptoms import SYMPTOMS
from gates.diagnosis.walk import walk

DOC = Path(__file__).parents[3] / "docs" / "diagnosis.md"
BLOCK = r"(<!-- held by a test: {name} -->\n```text\n)(.*?)(```\n)"


def cause(said):
    return next((edit, gates) for *_, edit, gates, text in CAUSES if text.startswith(said))


def held(name, found):
    """Compare with a block of the page; with GOLDEN=write, write it, and be red."""
    text, block = DOC.read_text(), re.compile(BLOCK.format(name=re.escape(name)), re.DOTALL)
    (written,) = block.findall(text)
    if os.environ.get("GOLDEN") == "write":
        DOC.write_text(block.sub(lambda match: f"{match[1]}{found}\n{match[3]}", text))
        pytest.fail(f"{name} was written: read the difference, then ask again")
    assert written[1] == f"{found}\n"


def test_the_walk_of_the_page_is_what_the_command_prints(planted):
    reports = planted(*cause("lag_spread_rows"))
    held("walk", f"{gates_text(reports)}\n\n{walk_text(walk(reports, FLOW))}")


def test_the_answer_of_the_page_is_what_the_command_prints(planted, capsys, monkeypatch):
    from gates.diagnosis.commands import diagnose

    reports = planted(*cause("flow samples soonest, and in motion"))
    monkeypatch.setattr("gates.diagnosis.reports.read_reports", lambda root: reports)
    assert diagnose(symptom="fast-microbenchmark", candidate=FLOW) == 3
    held("answer", capsys.readouterr().out.rstrip("\n"))


def test_the_page_lists_every_symptom_with_its_command():
    assert symptoms_text(SYMPTOMS) in DOC.read_text()


def test_the_page_has_every_checkpoint_row_with_owner_and_criteria():
    text = DOC.read_text()
    for row in CHECKPOINTS:
        carried = ", ".join(f"`{name}`" for name in row.criteria)
        assert f"| {row.area} | {row.owner} | {row.reject_when} | {carried} |" in text


def test_lines_fit_a_terminal_and_paths_stay_whole(honest):
    texts = [gates_text(honest), walk_text(walk(honest, FLOW)), symptoms_text(SYMPTOMS)]
    assert max(len(line) for text in texts for line in text.splitlines()) <= WIDE


def test_a_walk_of_nobody_in_particular_says_so(honest):
    early = without(honest, "B", "C", "D")
    text = walk_text(walk(early, EVERYBODY))
    assert text.startswith("every candidate, in the chapter's order")
    assert "the rest waits: no B; no C; no D." in " ".join(text.split())


def test_reports_that_cannot_be_used_are_said_once_each(honest):
    text = gates_text(replace(honest, missing={"C": "no C", "D": "no D", "E": "no D"}))
    assert text.splitlines()[1:] == ["No C.", "No D."]


def test_a_name_is_not_cut_however_long_it_is_or_where_it_has_a_hyphen(honest):
    long, joined = "reports/" + "x" * WIDE, "y" * 50 + "-" + "z" * 27
    text = gates_text(replace(honest, missing={"E": f"read {long} and {joined}"}))
    assert text.splitlines()[1:] == ["Read", long, "and", f"{joined}."]


def test_a_row_without_anything_unmet_is_two_lines_or_more(honest):
    from gates.diagnosis.checkpoints import ruled

    rows = ruled(honest)
    lines = checkpoints_text(rows).splitlines()
    assert lines[0].split() == ["area", "owner", "verdict", "promotion", "is", "rejected", "when"]
    assert [line.split()[0] for line in lines if re.match(r"\w", line)][1:] == [
        row.area for row in rows
    ]


def test_a_look_repeats_no_reason_why_nothing_is_known(honest):
    look = Look(without(honest, "D"), FLOW)
    look.criteria("D.hold_share_upper", "D.reset_upper")
    assert look.waits_for == ["no D"]
    assert look.unknown == look.numbers == look.causes == look.undecided == []


@pytest.mark.parametrize(("state", "not_asked"), [("in order", ("x",)), ("not asked", ())])
def test_a_walk_of_which_some_was_not_asked_is_not_said_to_hold_whole(honest, state, not_asked):
    whole = walk(honest, FLOW)
    for stop in whole.stops:
        assert stop.not_asked == () and stop.state == "in order"
    changed = replace(whole.stops[-1], state=state, not_asked=not_asked)
    partly = replace(whole, stops=(*whole.stops[:-1], changed), behind=())
    assert "Nothing is red: every place was asked" in walk_text(whole)
    assert "what was not asked stands at its place" in walk_text(partly)
