"""Pages as a browser shows them on a narrow screen and prints them; skipped where there is none."""

import browser
import pytest
from test_clips_drawn import SPACE, film

from gates.pages import page
from gates.pages.clips import Clips
from gates.pages.clips_drawn import drawn_clip
from gates.pages.figures import Small
from genpolicy.pages.figures.drawing import LEAST_TEXT_PX
from genpolicy.pages.style import page_style

pytestmark = pytest.mark.skipif(
    browser.chromium() is None,
    reason="no Chromium on this machine: it alone counts sheets and measures what is shown",
)
NARROW_PX, WIDE_PX = 420, 1200
LEAST_ON_PAPER_PX = 7.0
"""Of a text, where 1 px is 1/96 inch: 5.25 points."""
NAMES = ("gate_a", "gate_b", "gate_c", "gate_d", "gate_e", "index")
DRAWN = {"gate_a", "gate_b", "gate_c", "gate_d", "index"}
SHEETS = dict.fromkeys(NAMES, 6) | {"gate_e": 2}


WHY = ("Median success of left", "Median success of right", "Slowest success", "Largest force",
       "Collision: median", "Intervention: median")  # fmt: skip
LINES = (
    "camera_delay, start 3: success after 6.2 s; force at most 12.9 N, oldest action 240 ms.",
    "genpolicy replay artifacts/stress/journals/flow__camera_delay.mcap "
    "--session flow/camera_delay/3 --out watch.mcap",
)


def six_clips(*_):
    shown = [Small(why, LINES, drawn_clip(film(), SPACE, k, said=why)) for k, why in enumerate(WHY)]
    return Clips(method="flow", promoted=True, shown=tuple(shown))


@pytest.fixture(scope="module")
def pages(_written):
    """As they are written; the desk with the six clips of a real ladder."""
    found = {name: (_written / f"reports/{name}.html").read_text() for name in NAMES}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(page, "clips_of", six_clips)
        return found | {"index": page.index_page(_written)}


def page_of(inner):
    return f"<!DOCTYPE html><title>a</title><style>{page_style()}</style><main>{inner}</main>"


def on_paper(text, folder):
    return browser.measured(text, folder, width_px=browser.PAPER_PX, paper=True)


@pytest.mark.parametrize("name", NAMES)
def test_it_prints_on_few_sheets_with_nothing_cut(pages, name, tmp_path):
    shown = tmp_path / f"{name}.html"
    for paper in ("letter", "A4"):
        shown.write_text(pages[name].replace("@page{", f"@page{{size:{paper};"))
        assert 1 <= browser.sheets(shown, tmp_path) <= SHEETS[name], paper
    told = on_paper(pages[name], tmp_path)
    assert told["outside"] == [] and told["sideways"] == [] and told["wide"] == 0


@pytest.mark.parametrize("name", NAMES)
def test_every_text_of_a_drawing_can_be_read_on_a_narrow_screen(pages, name, tmp_path):
    told = browser.measured(pages[name], tmp_path, width_px=NARROW_PX)
    assert min([size for size, _ in told["texts"]], default=LEAST_TEXT_PX) >= LEAST_TEXT_PX
    assert told["wide"] == 0 and told["unannounced"] == []
    assert bool(told["texts"]) == (name in DRAWN)


def test_the_figures_of_the_desk_are_whole_on_a_wide_screen_and_on_paper(pages, tmp_path):
    wide = browser.measured(pages["index"], tmp_path, width_px=WIDE_PX)
    assert min(size for size, _ in wide["texts"]) >= LEAST_TEXT_PX and wide["plots"] == []
    paper = on_paper(pages["index"], tmp_path)
    assert min(size for size, _ in paper["texts"]) >= LEAST_ON_PAPER_PX


def test_a_clip_can_be_read_and_shows_one_moment(tmp_path):
    clip = drawn_clip(film(), SPACE, 1, said="slowest success")
    text = page_of(f'<div class="series clips"><div class="small">{clip}</div></div>')
    told = browser.measured(text, tmp_path, width_px=NARROW_PX)
    assert min(size for size, _ in told["texts"]) >= LEAST_TEXT_PX and told["wide"] == 0
    assert told["moments"] == ["--k:2"] and told["buttons"] == 4
    assert on_paper(text, tmp_path)["moments"] == ["--k:2"]
    step = text.replace(" checked", "", 1).replace('class="step"', 'class="step" checked')
    told = browser.measured(step, tmp_path, width_px=NARROW_PX)
    assert told["moments"] == ["--k:0"] and told["buttons"] == 4 + 3
    assert on_paper(step, tmp_path)["moments"] == ["--k:2"]
    assert on_paper(step, tmp_path)["buttons"] == 0


def test_a_picture_inside_a_page_is_shown_under_its_own_policy(pages, tmp_path):
    """The Nu checker says that the policy forbids it; what a browser shows is what counts."""
    gate_a = pages["gate_a"]
    assert browser.pictures(gate_a, tmp_path) == [True] == ["data:image/png" in gate_a]
    closed = gate_a.replace("img-src data:", "img-src 'none'")
    assert closed != gate_a and browser.pictures(closed, tmp_path) == [False]


def test_what_is_wrong_is_seen(tmp_path):
    small = '<svg viewBox="0 0 800 9"><text y="9" style="font-size:9px">a</text></svg>'
    plot = f'<div class="plot" style="--least:10px">{small}</div>'
    told = browser.measured(page_of(plot), tmp_path, width_px=NARROW_PX)
    assert told["texts"][0][0] < LEAST_TEXT_PX
    silent = f"<style>.plot::before{{content:none!important}}</style>{plot}".replace(
        "10px", "800px"
    )
    assert browser.measured(page_of(silent), tmp_path, width_px=NARROW_PX)["unannounced"]
    wide = '<table><tr><td style="white-space:nowrap">' + "word " * 300 + "</td></tr></table>"
    assert on_paper(page_of(wide), tmp_path)["outside"]
    assert on_paper(page_of(f'<div style="overflow:hidden">{wide}</div>'), tmp_path)["sideways"]


def test_sheets_are_counted(tmp_path):
    three = tmp_path / "three.html"
    three.write_text(page_of('<p style="break-after:page">a</p>' * 2 + "<p>b</p>"))
    assert browser.sheets(three, tmp_path) == 3
