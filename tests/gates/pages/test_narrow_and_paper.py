"""What of narrow screens, paper and the dark can be told from a page's text, without a browser."""

import re

import pytest

from gates.pages.clips_drawn import WIDTH
from genpolicy.pages.figures.drawing import LEAST_TEXT_PX
from genpolicy.pages.style import page_style

PX_PER_REM = 16.0
NARROW_PX = 420.0
STYLE = str(page_style())
SCREEN, PAPER = STYLE.split("@media print{")
PLOT = re.compile(r'<div class="plot" style="--least:(\d+)px"([^>]*)>(<svg.*?</svg>)</div>', re.S)
LEFT_OUT = {
    "nav": "the links between pages",
    "table.criteria .evidence": "the files and rows behind each criterion",
    "table.duties tr.PASS": "of each part below what holds",
}
"""What the paper does not show, and how the page says so."""
ON_SCREEN = {
    r'<(?:h2|ol) class="(?:reading )?on-screen">(?:Read|<li>)': "how to read the page",
    r'<small class="on-screen">|<p class="lead on-screen">': "the files and rows behind each",
    r'<span class="on-screen"> What was measured': "links between pages and to rows",
    r'<span class="on-screen">Play|<p class="on-screen"><code>': "the command that opens it",
    r'<(?:h2|pre) class="on-screen">(?:Reproduce|dvc)': "the commands that derive it again",
    r'<(?:h2|details) class="on-screen">(?:9 |<summary>)|<dl class="words on-screen">':
        "part 9 (commands, hashes, settings, words)",
}  # fmt: skip
"""The same of what is marked so: how each such element begins."""
CONTROLS = {".clip fieldset", ".moments input", ".skip", "td.measured summary"}
"""What there is nothing to do with on paper."""


@pytest.fixture(scope="module")
def pages(_written):
    names = {**{g: f"gate_{g.lower()}" for g in "ABCDE"}, "index": "index"}
    return {name: (_written / f"reports/{file}.html").read_text() for name, file in names.items()}


def smallest(svg):
    sizes = [float(size) for size in re.findall(r"font(?:-size)?:[^;\"]*?([\d.]+)px", svg)]
    assert svg.count("<text") == 0 or sizes
    return min(sizes, default=LEAST_TEXT_PX)


def test_each_plot_scrolls_before_its_text_is_too_small(pages):
    found = [plot for text in pages.values() for plot in PLOT.findall(text)]
    assert len(found) >= 20
    for least, attributes, svg in found:
        wide = float(re.search(r'viewBox="0 0 ([\d.]+)', svg).group(1))
        scale = float(least) / wide
        assert scale * smallest(svg) >= LEAST_TEXT_PX > (float(least) - 1) / wide * smallest(svg)
        assert 'tabindex="0"' in attributes and "scrolls sideways" in attributes
        assert "scale(" not in svg or "<text" not in svg.split("scale(")[1].split("</g>")[0]


def test_no_text_is_drawn_outside_of_a_plot(pages):
    for text in pages.values():
        rest = PLOT.sub("", text)
        assert "<text" not in rest


def test_the_style_sheet_keeps_that_width_on_every_screen():
    assert ".plot svg{display:block;width:100%;height:auto;min-width:var(--least)}" in SCREEN
    assert ".plot{overflow-x:auto" in SCREEN
    assert "scroll it sideways" in SCREEN and SCREEN.count("min-width:var(--least)") == 1
    assert not re.search(r"\.plot[^{}]*\{[^}]*(max-width|zoom|transform)", SCREEN)


def test_texts_of_clips_can_be_read_in_the_narrowest_column():
    (least, size) = re.search(
        r"\.clip svg\{[^}]*min-width:min\(([\d.]+)rem,100%\)[^}]*font-size:([\d.]+)px", SCREEN
    ).groups()
    assert float(least) * PX_PER_REM / WIDTH * float(size) >= LEAST_TEXT_PX
    assert float(least) * PX_PER_REM < NARROW_PX - 5 * PX_PER_REM


def test_paper_leaves_out_what_the_page_names_and_nothing_else(pages):
    hidden = {
        head.strip()
        for heads, body in re.findall(r"([^{}]+)\{([^{}]*)\}", PAPER)
        if "display:none" in body
        for head in heads.split(",")
    }
    assert hidden == {*LEFT_OUT, *CONTROLS, ".on-screen"}
    assert ".on-screen{display:none!important}" in PAPER and "small:not(.on-screen)" in PAPER
    for name, text in pages.items():
        (note,) = re.findall(r'<p class="on-paper">(.*?)</p>', text)
        used = {
            "nav": "<nav" in text,
            "table.criteria .evidence": 'class="evidence"' in text,
            "table.duties tr.PASS": '<table class="duties"' in text,
        }
        for what, said in LEFT_OUT.items():
            assert (said in note) == used[what], (name, what)
        body = text.split("</style>")[1]
        found = {said: len(re.findall(begins, body)) for begins, said in ON_SCREEN.items()}
        assert sum(found.values()) == body.count("on-screen"), "each is of a kind that has words"
        assert all((said in note) == (count > 0) for said, count in found.items()), (name, found)
        assert "what is folded" in note and ".html</code>" in note
        assert 'summary::after{content:" \\2013 folded, not printed"}' in PAPER
        assert len(re.findall("<details", text)) == len(
            re.findall("<summary>[^<]|<summary><b>", text)
        )


def test_paper_has_no_fixed_widths_and_rows_stay_whole(pages):
    assert "table,.plot svg,.clip svg{min-width:0!important}" in PAPER
    assert re.search(r",tr,[^{}]*\{break-inside:avoid\}", PAPER)
    assert ".scroll,.plot{overflow:visible}" in PAPER
    assert not re.search(
        r"(?<!-)\bwidth:[\d.]+(px|rem)", PAPER.replace("table.card th{width:9rem}", "")
    )
    for text in pages.values():
        assert not re.search(r"<(table|th|td|div|p|figure)\b[^>]*\bwidth[=:]", text)


def luminance(colour):
    parts = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    red, green, blue = (p / 12.92 if p <= 0.04045 else ((p + 0.055) / 1.055) ** 2.4 for p in parts)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def contrast(one, other):
    """Of two colours by WCAG 2."""
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


def test_the_contrast_of_black_on_white_is_what_the_standard_says():
    assert contrast("#000000", "#ffffff") == pytest.approx(21.0)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_every_tone_can_be_read_on_both_grounds(scheme):
    part = SCREEN if scheme == "light" else SCREEN.split("(prefers-color-scheme:dark){")[1]
    root = re.search(r":root\{([^}]*)\}", part).group(1)
    told = dict(re.findall(r"--(\w+):(#[0-9a-f]+)", root))
    told = {key: "#" + value[1:] * 2 if len(value) == 4 else value for key, value in told.items()}
    for tone in ("ink", "soft", "pass", "fail", "open", "wait"):
        for ground in ("paper", "wash"):
            assert contrast(told[tone], told[ground]) >= 4.5, (tone, ground)


def test_a_figure_stays_on_light_ground_in_the_dark_as_its_colours_were_chosen_for():
    dark = SCREEN.split("(prefers-color-scheme:dark){")[1]
    light = re.search(r":root\{([^}]*)\}", SCREEN).group(1)
    figure = re.search(r"figure\{color-scheme:light;([^}]*?);color:", dark).group(1)
    assert figure == light
