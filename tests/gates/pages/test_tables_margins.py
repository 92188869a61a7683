"""How close admitted candidates come to each limit: in its own unit, n is episodes."""

import evidence
import numpy as np
import pytest

from gates.evidence import Evidence
from gates.feasibility.settings import CANDIDATES, LAYERS
from gates.pages.figures import draw_all
from gates.pages.page import gate_page
from gates.pages.tables_margins import LISTINGS
from genpolicy.feasibility.reasons import Unit

TABLE = CANDIDATES.removeprefix("artifacts/")


def is_flow(frame):
    return (frame["method"] == "flow") & (frame["fixture"] == "held_out")


def measured(frame):
    """320 held-out candidates of the flow: jerk is the closest to 20, speed to 300 of .1 to 3.09.

    Jerks, and the 30 speeds nearest to the limit, are tightest of all; 40 are in contact.
    """
    own = is_flow(frame)
    place = own.cumsum() - 1
    jerk = own & (place < 20)
    contact = own & (place >= 280)
    speed = np.where(jerk, 75.0, 0.1 + 0.01 * (place - 20))
    share = np.where(jerk, 75.0 / 3750, speed / 2)
    tight = own & (share < 0.2)
    return frame.assign(
        check_dynamic=frame["check_dynamic"].mask(jerk, "joint_jerk"),
        unit_dynamic=frame["unit_dynamic"].mask(jerk, "rad/s^3"),
        margin_dynamic=frame["margin_dynamic"].mask(own, speed),
        share_dynamic=frame["share_dynamic"].mask(own, share),
        check_contact=frame["check_contact"].mask(contact, "contact_force"),
        unit_contact=frame["unit_contact"].mask(contact, "N"),
        margin_contact=frame["margin_contact"].mask(contact, 30.0),
        share_contact=frame["share_contact"].mask(contact, 0.75),
        margin_layer=frame["margin_layer"].mask(tight, "dynamic"),
        margin_check=frame["margin_check"].mask(tight, "joint_velocity").mask(jerk, "joint_jerk"),
        layer_margin=frame["layer_margin"].mask(tight, speed),
        margin_unit=frame["margin_unit"].mask(tight, "rad/s").mask(jerk, "rad/s^3"),
    )


def shown_of(root, judged, change=None):
    if change:
        evidence.edit_table(root, TABLE, change)
    (found,) = draw_all(LISTINGS, Evidence(root), judged("C"))
    return found


def test_a_line_a_layer_and_one_of_the_tightest_for_each_method(copied, judged):
    found = shown_of(copied, judged, measured)
    assert found.skipped == ""
    heads, *lines = found.listed
    assert [line[:2] for line in lines] == [
        (method, layer) for method in ("diffusion", "flow") for layer in (*LAYERS,
         "the tightest of all")
    ]  # fmt: skip
    told = {line[:2]: dict(zip(heads[2:], line[2:], strict=True)) for line in lines}
    assert told["flow", "kinematic"] == {
        "closest check": "joint position", "of them": "320 of 320",
        "left: p5, median": "22.9°, 22.9°", "layer, share left: p5, median": "40 %, 40 %",
        "episodes": "80",
    }  # fmt: skip


def test_units_are_kept_apart_and_the_share_is_over_all_of_the_layer(copied, judged):
    """Of 300 speeds .1 to 3.09 rad/s the 15th and the 150th; the layer has 20 jerks of 2 % too."""
    _heads, *lines = shown_of(copied, judged, measured).listed
    told = {line[:2]: line[2:] for line in lines}
    assert told["flow", "dynamic"] == (
        "joint velocity", "300 of 320", "13.8°/s, 91.1°/s", "2 %, 74.5 %", "75",
    )  # fmt: skip
    assert told["diffusion", "dynamic"][:3] == ("joint velocity", "320 of 320", "34.4°/s, 34.4°/s")


def test_what_a_layer_measured_nothing_of_says_so(copied, judged):
    _, *lines = shown_of(copied, judged, measured).listed
    told = {line[:2]: line[2:] for line in lines}
    assert told["diffusion", "contact"] == ("nothing was measured", "0 of 320", "", "", "")
    assert told["flow", "contact"] == (
        "contact force", "40 of 320", "30 N, 30 N", "75 %, 75 %",
        "10, fewer than the 72 that bound a p5",
    )  # fmt: skip


def test_the_tightest_of_all_is_named_with_its_layer(copied, judged):
    """20 jerks and 30 speeds are tighter than the 20 % of the way between rows."""
    _, *lines = shown_of(copied, judged, measured).listed
    told = {line[:2]: line[2:] for line in lines}
    assert told["flow", "the tightest of all"] == (
        "geometric: swept collision", "270 of 320", "20 mm, 20 mm", "2 %, 20 %",
        "68, fewer than the 72 that bound a p5",
    )  # fmt: skip


def test_every_check_that_was_the_closest_is_folded_behind(copied, judged):
    ((title, (heads, *lines)),) = shown_of(copied, judged, measured).folded
    assert title == "Every check that was the closest"
    own = [line[2:] for line in lines if line[:2] == ("flow", "dynamic")]
    assert own == [
        ("joint velocity", "300 of 320", "13.8°/s, 91.1°/s", "12 %, 79.5 %", "75"),
        ("joint jerk", "20 of 320", "4,300°/s³, 4,300°/s³", "2 %, 2 %",
         "5, fewer than the 72 that bound a p5"),
    ]  # fmt: skip
    assert not [line for line in lines if line[:2] == ("diffusion", "contact")]
    assert all(len(line) == len(heads) for line in lines)


def test_what_was_not_admitted_or_not_held_out_is_not_counted(copied, judged):
    def refused(frame):
        own = is_flow(frame) & (frame["observation"] < 20)
        return frame.assign(dynamic=frame["dynamic"].mask(own, False))

    _, *lines = shown_of(copied, judged, refused).listed
    assert {line[3] for line in lines if line[:2] == ("flow", "kinematic")} == {"240 of 240"}


def test_without_an_admitted_candidate_nothing_is_shown(copied, judged):
    found = shown_of(copied, judged, lambda f: f.assign(geometric=False))
    assert found.skipped == "no admissible held-out candidate"


def test_rows_that_contradict_themselves_are_not_shown(copied, judged):
    def below(frame):
        return frame.assign(margin_kinematic=frame["margin_kinematic"].mask(is_flow(frame), -1.0))

    assert "kinematic passed with a margin below 0" in shown_of(copied, judged, below).skipped


@pytest.mark.parametrize(("unit", "said"), [
    ("m", "margins of joint_position are in m and rad"),
    ("furlong", "margins of joint_position are in furlong and rad"),
])  # fmt: skip
def test_margins_of_one_check_in_several_units_are_not_shown(copied, judged, unit, said):
    def other(frame):
        first = is_flow(frame) & (frame["observation"] == 3)
        return frame.assign(unit_kinematic=frame["unit_kinematic"].mask(first, unit))

    assert said in shown_of(copied, judged, other).skipped


def test_a_unit_that_nobody_knows_is_not_shown(copied, judged):
    def other(frame):
        return frame.assign(unit_kinematic=frame["unit_kinematic"].replace("rad", "furlong"))

    assert "joint_position are in furlong" in shown_of(copied, judged, other).skipped
    assert "furlong" not in set(Unit)


def test_the_page_shows_the_table_and_folds_the_rest(copied, judged):
    evidence.edit_table(copied, TABLE, measured)
    html = gate_page(copied, judged("C"))
    assert "How close what is admitted comes to the limits" in html
    assert "Every check that was the closest (12)" in html
