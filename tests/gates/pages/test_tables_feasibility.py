"""What was rejected: every candidate once, by layer, reason, method, phase and mode."""

import re

import evidence
import pytest

from gates.evidence import Evidence
from gates.feasibility.settings import CANDIDATES, REASONS
from gates.pages.figures import draw_all
from gates.pages.page import gate_page
from gates.pages.tables_feasibility import LISTINGS

TABLE = CANDIDATES.removeprefix("artifacts/")


def rejected(frame):
    """Of 80 held-out candidates of the flow: 4 on the left jerk, 6 collide, one of them unknown."""
    flow = (frame["method"] == "flow") & (frame["fixture"] == "held_out")
    jerk = flow & (frame["observation"] < 2) & (frame["mode"] == "left")
    hit = flow & (frame["observation"].between(2, 4)) & (frame["candidate"] < 2)
    first = hit & (frame["observation"] == 2) & (frame["candidate"] == 0)
    return frame.assign(
        dynamic=frame["dynamic"].mask(jerk, False),
        geometric=frame["geometric"].mask(hit, False),
        phase=frame["phase"].mask(hit & (frame["observation"] == 4), "insert"),
        outcome=frame["outcome"].mask(jerk | hit, "failed").mask(first, "unknown"),
        first_reason=frame["first_reason"].mask(jerk, "joint_jerk").mask(hit, "scene_collision"),
    )


@pytest.fixture
def shown(copied, judged):
    evidence.edit_table(copied, TABLE, rejected)
    (found,) = draw_all(LISTINGS, Evidence(copied), judged("C"))
    assert found.skipped == ""
    return found


def test_each_reason_stands_with_its_layer_method_phases_and_modes(shown):
    heads, *lines = shown.listed
    assert heads[:5] == ("layer: reason", "method", "rejected", "by phase", "by mode")
    assert [line[:5] for line in lines] == [
        ("geometric: scene collision", "flow",
         "6 of 320: 1.88 % (0.304 to 8.74), 1 of them unknown",
         "approach 4 of 318, insert 2 of 2", "left 3 of 160, right 3 of 160"),
        ("dynamic: joint jerk", "flow", "4 of 320: 1.25 % (0.0316 to 6.77)", "approach 4 of 318",
         "left 4 of 160"),
    ]  # fmt: skip
    assert all(len(line) == len(heads) and line[-1] for line in lines)


def test_each_phase_with_each_mode_counts_every_rejection_once(shown):
    (_, each), (_, quiet), (_, corrupted) = shown.folded
    lines = [dict(zip(each[0], line, strict=True)) for line in each[1:]]
    assert sum(int(line["rejected"]) for line in lines) == 10
    assert sum(int(line["of them unknown"]) for line in lines) == 1
    at = [line for line in lines if (line["phase"], line["mode"]) == ("insert", "right")]
    assert [(line["reason"], line["rejected"], line["of"]) for line in at] == [
        ("scene collision", "1", "1")
    ]
    assert len(quiet) - 1 == len(REASONS) - 2
    assert [line[0] for line in corrupted[1:]] == sorted(
        name.replace("_", " ") for name in evidence.FIXTURES[2:]
    )
    told = {line[0]: line[1:] for line in corrupted[1:]}
    assert told["collision"] == ("scene collision", "8", "joint jerk 24", "32 of 32")
    assert {line[1:] for line in told.values()} == {("8", "joint jerk 24", "32 of 32")}


def test_without_a_rejection_it_says_so(whole, judged):
    (found,) = draw_all(LISTINGS, Evidence(whole), judged("C"))
    assert found.listed[1:] == (("nothing", "all", "0 of 640", "", "", ""),)
    assert len(found.folded[0][1]) == 1 and len(found.folded[1][1]) == len(REASONS) + 1


def test_a_reason_that_no_layer_knows_is_listed_last(copied, judged):
    def unheard(frame):
        frame = rejected(frame)
        return frame.assign(first_reason=frame["first_reason"].replace("joint_jerk", "because"))

    evidence.edit_table(copied, TABLE, unheard)
    (found,) = draw_all(LISTINGS, Evidence(copied), judged("C"))
    assert [line[0] for line in found.listed[1:]] == [
        "geometric: scene collision", "no layer: because",
    ]  # fmt: skip


def test_the_page_shows_the_table_and_folds_the_rest(copied, judged):
    evidence.edit_table(copied, TABLE, rejected)
    html = gate_page(copied, judged("C"))
    assert "geometric: scene collision" in html and "left 3 of 160, right 3 of 160" in html
    found = re.findall(r"<details><summary>([^<]*\(\d+\))</summary>", html)
    assert found == [
        "Every phase with every mode (5)", "Reasons that rejected nothing (40)",
        "What corrupted fixtures were to be refused for, and were (5)",
        "Every check that was the closest (10)",
        "Every condition (30)", "Every phase (12)",
    ]  # fmt: skip


def test_a_fixture_that_is_refused_for_its_own_reason_says_so(copied, judged):
    def own(frame):
        hit = (frame["fixture"] == "collision") & (frame["candidate"] == 0)
        return frame.assign(first_reason=frame["first_reason"].mask(hit, "scene_collision"))

    evidence.edit_table(copied, TABLE, own)
    (found,) = draw_all(LISTINGS, Evidence(copied), judged("C"))
    (line,) = (line for line in found.folded[2][1][1:] if line[0] == "collision")
    hits, others = int(line[2]), line[3]
    assert hits > 0 and (hits == 32 or others == f"joint jerk {32 - hits}")
