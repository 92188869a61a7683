"""Pictures of the demonstrations: the cell, the sides of the paths, colours, bytes."""

import base64
import re

import evidence
import numpy as np
import pytest

from gates.evidence import Evidence, MissingEvidenceError
from gates.pages import plots_scene
from gates.pages.figures import LARGEST_PHOTO_BYTES, draw_all
from gates.pages.plots_scene import BETWEEN, LEFT, RIGHT, SCENE, paths, side
from gates.proof import judge
from gates.writing import write_gate

SHOWN = re.compile(r'<img src="data:image/png;base64,([A-Za-z0-9+/=]*)"')


def test_the_scene_is_shown_byte_for_byte_and_bound(ladder):
    report = write_gate(ladder, "A")
    page = (ladder / "reports/gate_a.html").read_text()
    assert SCENE in report.materials and report.materials[SCENE][:12] in page
    assert [base64.b64decode(text) for text in SHOWN.findall(page)] == [evidence.PNG]


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (b"<svg onload=alert(1)>", "no PNG"),
        (evidence.PNG + b"\0" * LARGEST_PHOTO_BYTES, "no PNG of at most"),
    ],
)
def test_what_is_no_small_png_is_not_shown(ladder, data, why):
    evidence.replace(ladder, "audit/scene.png", data)
    write_gate(ladder, "A")
    page = (ladder / "reports/gate_a.html").read_text()
    assert not SHOWN.search(page) and "onload" not in page
    assert f"Not drawn: {SCENE} is {why}" in page


def test_a_scene_that_changed_after_judging_is_not_shown(ladder):
    report = judge(ladder, "A")
    (ladder / SCENE).write_bytes(evidence.PNG + b"\0")
    (picture,) = draw_all(plots_scene.PLOTS[:1], Evidence(ladder), report)
    assert picture.photo == "" and "not the file that the report names" in picture.skipped


def test_without_a_scene_the_gate_is_judged_all_the_same(ladder):
    evidence.replace(ladder, "audit/scene.png", None)
    assert write_gate(ladder, "A").verdict == "PASS"
    page = (ladder / "reports/gate_a.html").read_text()
    assert f"Not drawn: {SCENE} is missing." in page and not SHOWN.search(page)


def test_every_episode_is_drawn_on_its_side(ladder):
    page = write_gate(ladder, "A") and (ladder / "reports/gate_a.html").read_text()
    assert "left: 2 episodes, 2 succeed" in page
    assert "right: 2 episodes, 1 succeed" in page
    assert "end of a failure (1)" in page
    assert "does not pass:" not in page


@pytest.mark.parametrize("flip", [1, -1])
def test_side_is_mirrored_with_the_path(flip):
    x_m = np.linspace(0.38, 0.65, 40)
    bow = 0.13 * np.sin(np.linspace(0, np.pi, 40))
    path = np.stack([x_m, flip * bow, np.full(40, 0.15)], axis=1)
    assert side(path, 0.5, 0.0) == (LEFT if flip > 0 else RIGHT)
    assert side(path[:10], 0.5, 0.0) == BETWEEN
    assert side(path[30:], 0.5, 0.0) == BETWEEN


def test_rows_of_a_path_are_put_in_order(ladder):
    before = paths(Evidence(ladder))
    evidence.edit_table(ladder, "ingest/frames.parquet", lambda f: f.iloc[::-1])
    after = paths(Evidence(ladder))
    for one, other in zip(before, after, strict=True):
        assert np.array_equal(one.points_m, other.points_m)
        assert np.all(np.diff(one.points_m[:, 0]) > 0)


def test_an_action_that_is_not_finite_is_named_and_not_drawn(ladder):
    evidence.edit_table(
        ladder, "ingest/frames.parquet", lambda f: f.assign(action=[[np.inf] * 9] * len(f))
    )
    with pytest.raises(MissingEvidenceError, match="finite position"):
        paths(Evidence(ladder))
