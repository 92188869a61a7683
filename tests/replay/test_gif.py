"""A rollout as a GIF: a picture for each frame, in the film's time, with the hand in its place."""

import io
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from genpolicy.replay.film import PERIOD_S, Film, Frame
from genpolicy.replay.gif import GAP, HAND, LAST_MS, LINE, RED, WIDTH, film_gif
from genpolicy.replay.views import views_of
from genpolicy.tasks.api import Workspace

SPACE = Workspace(lower_m=(0.3, -0.2, 0.0), upper_m=(0.7, 0.2, 0.2))


def square(x, y, half=0.03):
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
    return corners + np.array([x, y]), corners + np.array([x, 0.1])


@pytest.fixture
def film():
    scene = (("obstacle", square(0.5, -0.15)), ("scene", square(0.35, 0.15)))
    hands = [None, square(0.4, 0.1), square(0.6, 0.1)]
    return Film(
        frames=tuple(Frame(hand, None, scene) for hand in hands),
        path_m=np.array([[0.4, 0.1, 0.1], [0.6, 0.1, 0.1]]),
        duration_s=0.2,
        forces=((0.05, 5.0), (0.1, 20.0)),
        ages=(),
        phases=((0.0, "approach"), (0.1, "insert")),
        modes=((0.1, "fallback"),),
    )


def pictures(data):
    image, found = Image.open(io.BytesIO(data)), []
    for number in range(image.n_frames):
        image.seek(number)
        found.append((image.info["duration"], np.array(image.convert("RGB"))))
    return found


def near(pixel, colour):
    return np.abs(pixel.astype(int) - colour).max() <= 2


def test_a_picture_for_each_frame_and_the_last_one_stands(film):
    found = pictures(film_gif(film, SPACE, said="flow/push/0: success"))
    assert [duration for duration, _ in found] == [1000 * PERIOD_S, 1000 * PERIOD_S, LAST_MS]
    assert {picture.shape[1] for _, picture in found} == {WIDTH}


def test_the_hand_is_where_it_was_and_nowhere_before_the_first_command(film):
    found = pictures(film_gif(film, SPACE, said=""))
    above, aside = views_of(SPACE, width=WIDTH, gap=GAP)
    for (_, picture), (place, there) in zip(found, [(0.4, 0), (0.4, 1), (0.6, 1)], strict=True):
        for view, second in ((above, 0.1), (aside, 0.1)):
            x, y = view.places(np.array([[place, second + 0.015]]))[0]
            assert near(picture[int(y) + LINE, int(x)], HAND) == bool(there)


def test_the_line_of_time_moves_and_keeps_its_colour(film):
    columns = []
    for _, picture in pictures(film_gif(film, SPACE, said="")):
        red = np.abs(picture.astype(int) - RED).max(axis=2) <= 40
        columns.append(int(np.median(np.argwhere(red)[:, 1])))
    assert columns[0] < 5 < columns[1] < columns[2] and columns[2] > WIDTH - 5


def test_the_same_film_gives_the_same_bytes_and_another_other_ones(film):
    one = film_gif(film, SPACE, said="x")
    assert one == film_gif(film, SPACE, said="x")
    assert one != film_gif(film, SPACE, said="y")
    assert one != film_gif(replace(film, forces=()), SPACE, said="x")


def test_what_lies_outside_stays_within_its_view(film):
    """Injected fault: a hand far outside must not be drawn over the other view."""
    inside = pictures(film_gif(replace(film, frames=(Frame(None, None, ()),) * 2), SPACE, said=""))
    far = (Frame(square(0.74, 0.1), None, ()),) * 2  # across the border, into the gap
    outside = pictures(film_gif(replace(film, frames=far), SPACE, said=""))
    _, aside = views_of(SPACE, width=WIDTH, gap=GAP)
    left = int(aside.left) - GAP + 2
    np.testing.assert_array_equal(
        inside[0][1][LINE:, left : left + GAP - 6], outside[0][1][LINE:, left : left + GAP - 6]
    )
