"""What the card's box allows and no rollout visited is named by side, and stays on the card."""

import evidence
import pytest

from gates.card.card import caveats_of
from gates.doubts import of_a_ladder
from gates.proof import judge
from gates.stress.visited import BEYOND

FILE = "stress/envelope.json"


def _said(root, candidate="flow"):
    found = [text for text in judge(root, "D").caveats if BEYOND.match(text)]
    return next((text for text in found if text.startswith(f"{candidate}: ")), "")


def _reached(root, **changes):
    evidence.edit_document(root, FILE, lambda d: d["reached"]["flow"].update(changes))


def test_each_side_that_nobody_visited_is_named_in_millimetres_and_stays_on_the_card(ladder):
    """350 to 700, -200 to 200, 30 to 250 mm against what the synthetic commands reached."""
    said = _said(ladder)
    assert said.startswith(
        "flow: the card's box reaches up to 20 mm beyond what was visited "
        "(-x 10 mm, -y 20 mm, +x 10 mm)"
    )
    report = judge(ladder, "D")
    assert f"artifacts/{FILE}" in report.materials
    assert said in caveats_of({"D": report})
    doubts = [one.text for one in of_a_ladder([report])[0] if one.kind == "not visited"]
    names, of_both = ", ".join(sorted(report.candidates)), said.removeprefix("flow: ")
    assert names == "diffusion, flow"
    assert doubts == [f"diffusion and flow, each: {of_both}"], "it is the same of both, said once"
    assert not any(BEYOND.match(one.text) for one in of_a_ladder([report])[1])


@pytest.mark.parametrize(("short_m", "said"), [(0.0, ""), (0.0004, ""), (0.0006, "+z 1 mm")])
def test_a_box_that_was_visited_up_to_its_sides_is_no_caveat(ladder, short_m, said):
    _reached(ladder, lowest_m=[0.35, -0.2, 0.03], highest_m=[0.7, 0.2, 0.25 - short_m])
    found = _said(ladder)
    assert (f"({said})" in found) if said else not found


def test_a_box_that_is_the_whole_workspace_is_said_to_be(ladder):
    assert "whole workspace" not in _said(ladder)
    workspace = [[0.35, -0.2, 0.03], [0.7, 0.2, 0.25]]
    evidence.edit_document(ladder, "task/identity.json", lambda d: d.update(workspace_m=workspace))
    assert "it is the whole workspace of the task" in _said(ladder)


@pytest.mark.parametrize("nowhere", [{"lowest_m": None, "highest_m": None, "commands": 0}, None])
def test_of_who_did_not_run_there_nothing_is_said(ladder, nowhere):
    """No card is drafted for them; Gate E says why."""
    if nowhere is None:
        evidence.replace(ladder, FILE, None)
    else:
        _reached(ladder, **nowhere)
    assert _said(ladder) == ""


def test_who_does_not_pass_gets_no_card_and_no_caveat_of_its_box(ladder):
    assert _said(ladder, "diffusion")
    evidence.write_params(ladder, evidence.set_limit("gate_d", "hold_share_upper", 0.0))
    report = judge(ladder, "D")
    assert set(report.candidates.values()) == {"FAIL"}
    assert not any(BEYOND.match(text) for text in report.caveats)
