"""When nothing was commanded: every count once, by event, reason, method, phase and condition."""

import re

import evidence
import pytest

from gates.evidence import Evidence
from gates.pages.figures import draw_all
from gates.pages.page import gate_page
from gates.pages.tables_holds import FILE, LISTINGS, MOST_NAMED
from gates.proof import judge

TABLE = FILE.removeprefix("artifacts/")


def drawn(root, report):
    (found,) = draw_all(LISTINGS, Evidence(root), report)
    return found


@pytest.fixture
def shown(whole, judged):
    found = drawn(whole, judged("C"))
    assert found.skipped == ""
    return found


def test_each_event_stands_with_reason_method_phases_and_conditions(shown):
    heads, *lines = shown.listed
    assert heads == ("what: why", "method", "how often", "by phase", "by condition")
    told = {line[:2]: line[2:] for line in lines}
    assert len(told) == len(lines)
    assert told["doubt: clock backwards", "flow"] == (
        "18", "insert 18", "clock backwards on the way 18",
    )  # fmt: skip
    assert told["doubt: clock backwards", "diffusion"][0] == "9"
    played = len(evidence.PLAYED)
    often, phases, conditions = told["hold: empty", "diffusion"]
    assert often == f"{80 * played}"
    assert phases == f"approach {40 * played}, insert {40 * played}"
    assert conditions.endswith(f", and {played - MOST_NAMED} more")
    assert conditions.count(" 80") == MOST_NAMED


def test_what_is_most_usual_stands_first_and_what_never_happened_is_said(shown):
    events = [line[0].partition(":")[0] for line in shown.listed[1:]]
    assert list(dict.fromkeys(events)) == ["hold", "doubt", "watchdog", "stop"]
    assert shown.listed[-1] == ("stop", "all", "0", "", "")
    reasons = [line[0] for line in shown.listed[1:] if line[0].startswith("hold")]
    assert list(dict.fromkeys(reasons)) == ["hold: empty", "hold: stopped"]
    reasons = [line[0] for line in shown.listed[1:] if line[0].startswith("watchdog")]
    assert list(dict.fromkeys(reasons)) == ["watchdog: silence", "watchdog: clock ahead"]


def test_an_event_that_nobody_knows_is_shown(copied):
    def strange(frame):
        return frame.assign(event=frame["event"].replace("doubt", "nap"))

    evidence.edit_table(copied, TABLE, strange)
    lines = [line[:2] for line in drawn(copied, judge(copied, "C")).listed]
    assert ("nap: clock backwards", "flow") in lines and ("doubt", "all") in lines


@pytest.mark.parametrize(("place", "head", "values"), [
    (0, "condition", {*(row[0] for row in evidence.STILL)}),
    (1, "phase", {"approach", "insert"}),
])  # fmt: skip
def test_the_folded_tables_count_every_one_once(whole, shown, place, head, values):
    title, (heads, *lines) = shown.folded[place]
    assert title == f"Every {head}" and heads == ("what", "why", "method", head, "how often")
    rows = Evidence(whole).records(FILE, evidence.ShadowHoldRow)
    assert sum(int(line[-1]) for line in lines) == sum(row.count for row in rows)
    assert {line[3] for line in lines} == {value.replace("_", " ") for value in values}
    assert len({line[:-1] for line in lines}) == len(lines)


def test_held_out_observations_stand_first(shown):
    _, (_, *lines) = shown.folded[0]
    assert lines[0][:4] == ("hold", "empty", lines[0][2], "held out")


def test_the_page_shows_it_and_no_verdict_hangs_on_it(copied, judged):
    before = judged("C")
    text = gate_page(copied, before)
    section = text[text.index("When nothing was commanded") :]
    assert re.search(r"doubt: clock backwards</t[dh]>\s*<t[dh][^>]*>flow", section)
    evidence.edit_table(copied, TABLE, lambda frame: frame.assign(count=frame["count"] * 1000))
    again = judge(copied, "C")
    assert again.verdict == before.verdict
    assert [c.verdict for c in again.criteria] == [c.verdict for c in before.criteria]
    (copied / FILE).unlink()
    evidence.record(copied)
    gone = judge(copied, "C")
    assert [c.verdict for c in gone.criteria] == [c.verdict for c in before.criteria]
    assert "holds.parquet is missing" in drawn(copied, gone).skipped


def test_another_table_than_the_report_names_is_not_shown(copied, judged):
    evidence.edit_table(copied, TABLE, lambda frame: frame.assign(count=frame["count"] + 1))
    assert "not the file that the report names" in drawn(copied, judged("C")).skipped


def test_a_count_that_is_none_is_not_shown(copied):
    evidence.edit_table(copied, TABLE, lambda frame: frame.assign(count=-1))
    assert drawn(copied, judge(copied, "C")).skipped
