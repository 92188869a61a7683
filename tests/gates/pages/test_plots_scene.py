"""Pictures of the demonstrations: the cell, the modes of the paths, colours, bytes."""

import base64
import re

import evidence
import numpy as np
import pytest

from gates.evidence import Evidence, MissingEvidenceError
from gates.pages import plots_scene
from gates.pages.figures import LARGEST_PHOTO_BYTES, draw_all
from gates.pages.plots_scene import DEMONSTRATED, SCENE, UNTOLD, colours, paths
from gates.proof import judge
from gates.writing import write_gate
from genpolicy.pages.figures.drawing import GREY

MODES = "audit/demonstrated.parquet"
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


def test_a_scene_that_changed_after_judging_is_not_shown(ladder, judged):
    report = judged("A")
    (ladder / SCENE).write_bytes(evidence.PNG + b"\0")
    (picture,) = draw_all(plots_scene.PLOTS[:1], Evidence(ladder), report)
    assert picture.photo == "" and "not the file that the report names" in picture.skipped


def test_without_a_scene_the_gate_is_judged_all_the_same(ladder):
    evidence.replace(ladder, "audit/scene.png", None)
    assert write_gate(ladder, "A").verdict == "PASS"
    page = (ladder / "reports/gate_a.html").read_text()
    assert f"Not drawn: {SCENE} is missing." in page and not SHOWN.search(page)


def test_every_episode_is_drawn_by_the_mode_that_it_followed(ladder):
    report = write_gate(ladder, "A")
    page = (ladder / "reports/gate_a.html").read_text()
    assert "m0: 2 episodes, 2 succeed" in page
    assert "m1: 2 episodes, 1 succeed" in page
    assert "end of a failure (1)" in page
    assert f"{UNTOLD}:" not in page
    assert report.materials[DEMONSTRATED][:12] in page  # what is drawn is bound


def _drawn(ladder):
    (picture,) = draw_all(plots_scene.PLOTS[1:], Evidence(ladder), judge(ladder, "A"))
    return picture


def test_modes_are_told_and_never_seen_by_where_a_path_runs(ladder):
    """Modes of another task, one of both bundles: no obstacle, no side and no axis tells them."""
    names = ["over", "under", "over", "around"]
    evidence.edit_table(ladder, MODES, lambda f: f.assign(mode=names).iloc[:3])
    evidence.edit_document(ladder, "audit/summary.json", lambda d: {**d, "obstacles": []})
    picture = _drawn(ladder)
    told = re.findall(r">([\w ]+): (\d) episodes, (\d) succeed<", picture.svg)
    assert told == [("over", "2", "2"), ("under", "1", "1"), (UNTOLD, "1", "0")]


def test_without_modes_all_are_grey_and_without_the_table_it_is_said(ladder):
    evidence.edit_table(ladder, MODES, lambda f: f.iloc[:0])
    picture = _drawn(ladder)
    assert f"{UNTOLD}: 4 episodes, 3 succeed" in picture.svg and "m0:" not in picture.svg
    evidence.replace(ladder, MODES, None)
    assert _drawn(ladder).skipped == f"{DEMONSTRATED} is missing"


def test_a_mode_has_a_colour_of_its_own_and_none_is_grey():
    found = colours(["m1", UNTOLD, "m0", "m1"])
    assert list(found) == ["m0", "m1", UNTOLD] and len(set(found.values())) == 3
    assert found == colours(["m0", "m1", UNTOLD])  # whatever the order of the episodes
    assert GREY == found[UNTOLD] not in colours(f"m{i}" for i in range(9)).values()


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


@pytest.mark.parametrize(("episodes", "points"), [(1, 32), (360, 32), (720, 16), (100_000, 8)])
def test_of_many_episodes_fewer_points_of_each_are_drawn(ladder, monkeypatch, episodes, points):
    path = plots_scene.Path(np.linspace([0.0, 0.0, 0.0], [1.0, 1.0, 1.0], 50), True, "left")
    monkeypatch.setattr(plots_scene, "paths", lambda _: [path] * episodes)
    drawn = []
    monkeypatch.setattr(plots_scene, "_draw_paths", lambda *_, points: drawn.append(points))
    plots_scene.PLOTS[1].draw(Evidence(ladder), judge(ladder, "A"))
    assert drawn == [points, points]
