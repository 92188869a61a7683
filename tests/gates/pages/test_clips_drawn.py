"""The moving drawing: numbers of a film by hand, in the places where a reader looks for them."""

import re

import numpy as np
import pytest

from gates.pages.clips_drawn import GAP, SHOW, STRIP, WIDTH, drawn_clip
from genpolicy.pages.style import page_style
from genpolicy.replay.film import PERIOD_S, Film, Frame
from genpolicy.replay.views import MARGIN_M
from genpolicy.tasks.api import Workspace

SPACE = Workspace(lower_m=(0.3, -0.2, 0.0), upper_m=(0.7, 0.2, 0.2))
SCALE = (WIDTH - GAP) / 2 / (0.4 + 2 * MARGIN_M)


def square(x, y, half=0.01):
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
    return corners + np.array([x, y]), corners + np.array([x, 0.1])


def film(**changes):
    scene = (("obstacle", square(0.5, 0.0)),)
    hands = [None, square(0.4, 0.1), square(0.6, 0.1)]
    values = {
        "frames": tuple(Frame(hand, None, scene) for hand in hands),
        "path_m": np.array([[0.4, 0.1, 0.1], [0.6, 0.1, 0.1]]),
        "duration_s": 2.0,
        "forces": ((0.5, 5.0), (1.0, 20.0)),
        "ages": (),
        "phases": ((0.0, "approach"), (1.9, "in<sert"), (1.95, "end")),
        "modes": ((1.0, "fallback"), (1.5, "intervention"), (1.75, "ended")),
    }
    return Film(**{**values, **changes})


def points(text):
    return [tuple(map(float, pair.split(","))) for pair in text.split()]


def of_class(svg, name):
    return re.findall(rf'<(?:polygon|polyline) class="{name}" points="([^"]*)"', str(svg))


def moments(svg):
    """The drawing of each moment, by its number."""
    found = re.findall(r'<svg class="moment" style="--k:(\d+)"[^>]*>(.*?)</svg>', str(svg))
    assert [int(number) for number, _ in found] == list(range(len(found)))
    return [inner for _, inner in found]


def test_places_are_to_scale_and_up_is_up():
    above, aside = of_class(moments(drawn_clip(film(), SPACE, 1, said="largest force"))[-1], "hand")
    middle = np.mean(points(above), axis=0)
    assert middle[0] == pytest.approx((0.6 - 0.3 + MARGIN_M) * SCALE, abs=0.1)
    height = (0.4 + 2 * MARGIN_M) * SCALE
    assert middle[1] == pytest.approx(height - (0.1 + 0.2 + MARGIN_M) * SCALE, abs=0.1)
    side = np.mean(points(aside), axis=0)
    assert side[0] - middle[0] == pytest.approx((WIDTH + GAP) / 2, abs=0.1)
    lower = (0.2 + 2 * MARGIN_M) * SCALE
    assert side[1] == pytest.approx(lower - (0.1 + MARGIN_M) * SCALE, abs=0.1)


def test_each_moment_shows_its_own_frame_and_time():
    svg = drawn_clip(film(), SPACE, 7, said="largest force")
    hands = [of_class(moment, "hand") for moment in moments(svg)]
    assert hands[0] == [] and len(hands) == 3 and hands[1] != hands[2]
    lines = [re.search(r'class="now" d="M([\d.]+) ', moment).group(1) for moment in moments(svg)]
    assert list(map(float, lines)) == [0.0, WIDTH * 0.1 / 2, WIDTH * 0.2 / 2]
    assert re.findall(r'name="clip7at" aria-label="([^"]*)"', svg) == ["0.0 s", "0.1 s", "0.2 s"]


def test_what_stands_still_is_drawn_once():
    svg = drawn_clip(film(), SPACE, 1, said="largest force")
    assert len(of_class(svg, "obstacle")) == 2 and of_class(svg, "held") == []
    assert not any(of_class(moment, "obstacle") for moment in moments(svg))
    moving = [Frame(None, None, (("obstacle", square(x, 0.0)),)) for x in (0.4, 0.5)]
    svg = drawn_clip(film(frames=tuple(moving)), SPACE, 1, said="largest force")
    assert [len(of_class(moment, "obstacle")) for moment in moments(svg)] == [2, 2]


def test_every_control_is_played_by_a_rule_of_the_style_sheet():
    """Without its rule a button would be there and do nothing; a browser shows what they do."""
    style = str(page_style())
    rules = dict(re.findall(r"([^{}]+)\{([^{}]*)\}", style))
    said = {kind: [body for heads, body in rules.items() if f".{kind}:checked" in heads]
            for kind, _ in SHOW}  # fmt: skip
    assert said["whole"] == ["visibility:visible"]
    assert "visibility:visible" in said["step"] and "display:none" in said["step"]
    length = f"{PERIOD_S:g}".removeprefix("0")
    played = f"animation:shown {length}s calc(var(--k)*{length}s)"
    assert said["run"] == [played, "animation-fill-mode:forwards"]
    assert said["hold"] == [played, "animation-fill-mode:forwards", "animation-play-state:paused"]
    assert {kind for kind, _ in SHOW} == set(re.findall(r' class="(\w+)"(?: checked)?> ', str(
        drawn_clip(film(), SPACE, 1, said="a"))))  # fmt: skip


def test_bars_are_as_high_as_what_was_measured():
    svg = str(drawn_clip(film(), SPACE, 1, said="largest force"))
    (bars,) = re.findall(r'class="measured" d="([^"]*)"', svg)
    found = [tuple(map(float, bar)) for bar in re.findall(r"M([\d.]+) [\d.]+v-([\d.]+)", bars)]
    assert found == [(WIDTH / 4, STRIP / 4), (WIDTH / 2, STRIP)]
    assert "force, at most 20 N" in svg and "age of action: none" in svg


def test_a_tremor_does_not_fill_its_strip():
    svg = str(drawn_clip(film(forces=((1.0, 0.1),)), SPACE, 1, said="largest force"))
    assert f"v-{STRIP / 100:.1f}" in svg


def test_phases_are_named_where_there_is_room_and_names_are_no_markup():
    svg = str(drawn_clip(film(), SPACE, 1, said="largest force"))
    assert ">approach<" in svg and "in<sert" not in svg and "sert" not in svg and ">end<" not in svg
    wide = str(drawn_clip(film(phases=((0.0, "in<sert"),)), SPACE, 1, said="largest force"))
    assert ">in&lt;sert<" in wide
    assert len(re.findall('class="phase"', svg)) == 3


def test_who_commands_is_marked_while_it_does():
    svg = str(drawn_clip(film(), SPACE, 1, said="largest force"))
    rows = re.findall(r'<rect class="(fallback|person)" x="([\d.]+)" y="[\d.]+" width="([\d.]+)"',
                      svg)  # fmt: skip
    assert rows == [("fallback", "160.0", "80.0"), ("person", "240.0", "40.0")]


def test_a_person_who_ends_a_rollout_is_seen_at_its_end():
    ended = film(modes=((2.0, "intervention"), (2.0, "ended")))
    (row,) = re.findall(r'<rect class="person" x="([\d.]+)" y="[\d.]+" width="([\d.]+)"',
                        str(drawn_clip(ended, SPACE, 1, said="largest force")))  # fmt: skip
    assert float(row[0]) + float(row[1]) == WIDTH and float(row[1]) > 3


def test_its_label_says_what_it_shows():
    assert 'aria-label="a &lt; b: a rollout' in drawn_clip(film(), SPACE, 1, said="a < b")


def test_a_film_of_nothing_is_drawn():
    empty = film(frames=(Frame(None, None, ()),), path_m=np.zeros((0, 3)), duration_s=0.0,
                 forces=(), ages=(), phases=(), modes=())  # fmt: skip
    assert "force: none" in drawn_clip(empty, SPACE, 1, said="largest force")
