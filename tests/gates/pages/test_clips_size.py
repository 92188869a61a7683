"""How large a clip is: six of them stand in a page that is sent by mail and opened at once."""

from pathlib import Path

import pytest

from benchmarks.clips import clip_of, longest_rollout, planned
from genpolicy.replay.bodies import DrawnCell
from genpolicy.replay.film import film_of
from genpolicy.tasks.api import load_task

MOST_BYTES = 150_000
ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def clip_after():
    name, limit_s = planned(ROOT)
    task = load_task(name)
    cell = DrawnCell.of(task)
    return lambda part: clip_of(task, cell, longest_rollout(part * limit_s))


def test_the_longest_rollout_of_the_plan_is_a_clip_of_150_kb_at_most(clip_after):
    clip = clip_after(1.0)
    assert len(clip.encode()) <= MOST_BYTES
    assert clip == clip_after(1.0), "the same journal gives the same bytes"


def test_what_is_measured_is_a_rollout_that_moves_holds_and_touches(clip_after):
    name, limit_s = planned(ROOT)
    film = film_of(DrawnCell.of(load_task(name)), longest_rollout(limit_s))
    assert film.duration_s == limit_s and all(frame.held is not None for frame in film.frames)
    assert len({frame.hand[0].tobytes() for frame in film.frames}) == len(film.frames)
    assert len(film.forces) == len(film.ages) == 20 * limit_s
    half, whole = (len(clip_after(part).encode()) for part in (0.5, 1.0))
    assert 1.6 < whole / half < 2.1, "a clip grows with its time: a longer limit is seen here"
