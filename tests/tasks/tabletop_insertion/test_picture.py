"""The picture of the cell."""

import numpy as np

from genpolicy.seeds import stream
from genpolicy.tasks.api import WorldSettings
from genpolicy.tasks.tabletop_insertion.picture import draw
from genpolicy.tasks.tabletop_insertion.start import sample_start
from genpolicy.tasks.tabletop_insertion.world import TabletopWorld


def test_the_picture_shows_the_scene_and_is_the_same_twice():
    world = TabletopWorld(sample_start(stream(1, "picture")), settings=WorldSettings("epoch_1"))
    first = draw(world.model, world.data, width=120, height=90)
    assert first.shape == (90, 120, 3) and first.dtype == np.uint8
    np.testing.assert_array_equal(first, draw(world.model, world.data, width=120, height=90))
    red, _, blue = first.astype(int).reshape(-1, 3).T
    assert ((blue > red + 40) & (blue > 60)).sum() > 50  # the post
    assert ((red > 2 * blue) & (red > 80)).sum() > 10  # the peg
