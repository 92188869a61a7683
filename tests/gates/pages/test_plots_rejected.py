"""The gallery: every example is drawn with its action marked, and said in units of a person."""

import re
from types import SimpleNamespace

import evidence
import numpy as np
import pytest

from gates.evidence import Evidence
from gates.feasibility.settings import REASONS
from gates.pages.figures import METHODS, draw_all
from gates.pages.page import gate_page
from gates.pages.plots_rejected import FILE, FORBIDDEN, GALLERIES, SIZE_IN, _figure
from gates.pages.reasons import LIMIT_WORDS
from gates.proof import judge
from genpolicy.evidence.documents.gallery import GALLERY
from genpolicy.feasibility.checks import CHECKS
from genpolicy.pages.figures.drawing import INK, RED, STYLE

DOCUMENT = FILE.removeprefix("artifacts/")
PIXELS = 420 - 2 * 24 - 2 * 21 - 2  # what page and figure leave of a narrow window
RAW_AT_ROW = (0.42, 0.03, 0.15)


def shown(root, **changes):
    """The pictures of a gallery with one example that differs by this."""

    def edit(gallery):
        gallery["examples"] = [evidence.rejected("flow", **changes)]

    evidence.edit_document(root, DOCUMENT, edit)
    report = judge(root, "C")
    return draw_all(GALLERIES, Evidence(root), report)[0]


def figure_of(**changes):
    content = evidence.gallery() | {"examples": [evidence.rejected("flow", **changes)]}
    gallery = GALLERY.parse(content, where="here")
    return _figure(gallery, gallery.examples[0], METHODS["flow"])


def marked(axes):
    """Where the cross stands in a view; None where there is none."""
    crosses = [line for line in axes.lines if line.get_marker() == "X"]
    return tuple(float(v[0]) for v in crosses[0].get_data()) if crosses else None


def test_the_gallery_is_drawn_the_same_twice(whole, judged):
    first, again = (draw_all(GALLERIES, Evidence(whole), judged("C")) for _ in range(2))
    assert first == again and first[0].skipped == ""
    assert [item.title for item in first[0].series] == [
        f"{method}: joint jerk" for method in evidence.CANDIDATES
    ]


def test_the_report_names_the_file_and_another_one_is_not_drawn(copied, judged):
    assert FILE in judged("C").materials
    (found,) = draw_all(GALLERIES, Evidence(copied), judged("C"))
    assert found.skipped == ""
    path = copied / FILE
    path.write_bytes(path.read_bytes() + b" ")
    (found,) = draw_all(GALLERIES, Evidence(copied), judged("C"))
    assert "is not the file that the report names" in found.skipped and not found.series
    path.unlink()
    assert "missing" in draw_all(GALLERIES, Evidence(copied), judged("C"))[0].skipped


def test_without_an_example_it_says_so(copied):
    evidence.edit_document(copied, DOCUMENT, lambda gallery: gallery.update(examples=[]))
    (found,) = draw_all(GALLERIES, Evidence(copied), judge(copied, "C"))
    assert "no held-out candidate that has a path was rejected" in found.skipped


def test_both_paths_and_the_offending_action_stand_in_both_views():
    above, aside = figure_of().axes
    for axes, second in ((above, 1), (aside, 2)):
        solid = next(line for line in axes.lines if line.get_color() == METHODS["flow"])
        assert solid.get_linestyle() == "-"
        # From the last command; row 0 is late and never executed.
        np.testing.assert_allclose(solid.get_xdata(), [0.39, 0.41, 0.42, 0.43])
        dashed = next(line for line in axes.lines if line.get_color() == INK and line.is_dashed())
        np.testing.assert_allclose(dashed.get_xdata(), [0.39, 0.41, 0.42, 0.43])
        assert marked(axes) == pytest.approx((0.42, (0.0, 0.15)[second - 1]))
        assert axes.get_aspect() == 1.0
    assert above.get_title() == "from above" and aside.get_title() == "cut at y = 0 mm"


def test_what_the_first_layer_judges_is_marked_where_it_was_sampled():
    above, aside = figure_of(layer="representation", reason="projection_too_large").axes
    assert marked(above) == RAW_AT_ROW[:2] and marked(aside) == (0.42, 0.15)
    way = [line for line in above.lines if line.get_color() == RED and line.get_linestyle() == "-"]
    np.testing.assert_allclose(way[0].get_xydata(), [[0.41, 0.0], [0.42, 0.03]])
    dotted = [line for line in above.lines if line.get_linestyle() == ":"]
    np.testing.assert_allclose(dotted[0].get_xydata(), [[0.42, 0.03], [0.42, 0.0]])


def test_the_first_action_is_led_to_by_the_last_command():
    above, _ = figure_of(row=1).axes
    way = [line for line in above.lines if line.get_color() == RED and line.get_linestyle() == "-"]
    np.testing.assert_allclose(way[0].get_xydata(), [[0.39, 0.0], [0.41, 0.0]])


@pytest.mark.parametrize("changes", [
    {"row": None}, {"raw_m": [None] * 4, "projected_m": [None] * 4},
    {"raw_m": [None] * 4, "projected_m": [None] * 4, "layer": "representation"},
])  # fmt: skip
def test_without_an_action_or_a_path_nothing_is_marked(changes):
    assert [marked(axes) for axes in figure_of(**changes).axes] == [None, None]


def test_the_views_show_scene_workspace_and_what_touches():
    box = [[0.40, -0.02], [0.44, -0.02], [0.44, 0.02], [0.40, 0.02]]
    low = [[0.40, 0.10], [0.44, 0.10], [0.44, 0.12], [0.40, 0.12]]
    body = {"name": "hand", "kind": "robot", "touches": True, "above_m": box, "aside_m": low}
    apart = [[x, y + 0.06] for x, y in box]
    near = {**body, "name": "post", "kind": "obstacle", "aside_m": low}
    wall = {**body, "name": "wall", "kind": "scene", "touches": False, "above_m": apart}
    floor = [[0.0, -1.0], [1.0, -1.0], [1.0, 1.0], [0.0, 1.0]]
    ground = {**wall, "name": "ground", "above_m": floor}
    above, aside = figure_of(bodies=[body, near, wall, ground]).axes
    workspace, hand, post, wall_above = above.patches
    assert len(aside.patches) == 5  # what lies under everything is seen from the side alone
    assert above.get_facecolor()[:3] == pytest.approx([int(FORBIDDEN[i : i + 2], 16) / 255
                                                       for i in (1, 3, 5)])  # fmt: skip
    np.testing.assert_allclose(workspace.get_xy(), (0.3, -0.2))
    red = tuple(int(RED[i : i + 2], 16) / 255 for i in (1, 3, 5))
    assert hand.get_edgecolor()[:3] == post.get_edgecolor()[:3] == pytest.approx(red)
    assert 0 < hand.get_facecolor()[3] < 0.5 and post.get_facecolor()[3] == 1.0
    assert wall_above.get_facecolor()[3] == 1.0
    _, _, post_aside, wall_aside, _ = aside.patches
    assert post_aside.get_facecolor()[3] == 1.0  # the plane through the action goes through it
    assert wall_aside.get_facecolor()[3] == 0.0 and wall_aside.get_linestyle() == ":"
    assert aside.get_ylim()[0] < 0.10  # what touches is within the view


@pytest.mark.parametrize(("changes", "said"), [
    ({}, "Action 2 (of 0 to 3, 100 ms after the first) is beyond the limit by 573°/s³; "
         "limit of a joint: 5,730 to 11,500°/s³."),
    ({"reason": "finite", "margin": None, "unit": "1", "limits": []}, "offends."),
    ({"reason": "session_epoch", "margin": -1.0, "unit": "1", "limits": []}, "offends."),
    ({"reason": "singular", "margin": -2.5, "unit": "1", "limits": [30.0]},
     "is beyond the limit by 2.5; largest condition number: 30."),
    ({"outcome": "unknown", "margin": None}, "cannot be evaluated, which is not passed."),
    ({"reason": "workspace", "margin": -0.0042, "unit": "m", "limits": []},
     "is beyond the limit by 4.2 mm."),
    ({"reason": "unreachable", "margin": -0.02, "unit": "m or rad", "limits": [1e-3, 1e-3]},
     "is beyond the limit by 20 mm or 1.15°; largest error: 1 mm or 0.0573°."),
    ({"reason": "expired", "margin": -0.25, "unit": "s", "limits": [0.0]},
     "is beyond the limit by 250 ms; after its validity: 0 ms."),
    ({"row": None}, "As a whole it is beyond the limit by 573°/s³; "),
])  # fmt: skip
def test_a_margin_is_said_with_its_limit(copied, changes, said):
    (item,) = shown(copied, **changes).series
    assert item.lines[1].endswith(said) or said in item.lines[1]


def test_what_touches_and_who_it_is_are_said(copied):
    (item,) = shown(copied, reason="scene_collision", touching=["finger_left", "post"]).series
    assert item.title == "flow: scene collision"
    assert item.lines[0].endswith("or touches it: finger left and post.")
    assert item.lines[2] == (
        "The dynamic layer rejects 7 of 320 held-out candidates of flow for it. This one: "
        "candidate 1 of observation 0, phase approach, mode left."
    )


def test_every_limit_has_a_name(cell_limits):
    assert set(LIMIT_WORDS) == cell_limits <= set(REASONS)


@pytest.fixture
def cell_limits(task, checker):
    """Reasons whose limit is a number."""
    somewhere = SimpleNamespace(phase=task.phases[0], maximum_age_s=0.3)
    return {str(c.name) for c in CHECKS if list(c.limit(checker.cell, somewhere))}


def test_a_person_reads_nine_pixels_on_a_narrow_page():
    points = 72 * SIZE_IN[0]
    smallest = min(STYLE["font.size"], STYLE["axes.titlesize"])
    assert smallest * PIXELS / points >= 9.0


def test_the_page_shows_each_example_with_its_text(whole, judged):
    html = gate_page(whole, judged("C"))
    found = re.findall(
        r'<div class="small"><h4>([^<]*)</h4><div class="plot"[^>]*><svg role="img"', html
    )
    assert found == [f"{method}: joint jerk" for method in evidence.CANDIDATES]
    assert "limit of a joint: 5,730 to 11,500°/s³." in html
