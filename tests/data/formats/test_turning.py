"""Added-up turns: a rotation as numbers that a commanded turn changes."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from genpolicy.data.formats.contract import ChannelSource
from genpolicy.data.formats.following import changes
from genpolicy.data.formats.sample import Sample
from genpolicy.data.formats.source import RawEpisode
from genpolicy.data.formats.turning import added_turns, turned

EPISODE = np.repeat(np.arange(6), 60)


def turns(axes):
    """Quaternions that turn by random steps about the base's or the tool's axes, and the steps."""
    rng = np.random.default_rng(2)
    steps = np.repeat(rng.normal(0, 0.02, (36, 3)), 10, axis=0)
    quaternions = []
    for e in range(6):
        now = Rotation.from_rotvec([np.pi, 0.0, 0.0]) * Rotation.from_rotvec(rng.normal(0, 0.3, 3))
        for step in steps[e == EPISODE]:
            quaternions.append(now.as_quat() * rng.choice([-1, 1]))
            turn = Rotation.from_rotvec(step)
            now = turn * now if axes == "base" else now * turn
    return np.array(quaternions), steps


@pytest.mark.parametrize("axes", ["base", "tool"])
def test_a_turn_is_found_about_its_own_axes_and_free_of_the_sign(axes):
    quaternions, steps = turns(axes)
    base, tool = added_turns(quaternions, EPISODE)
    own = base if axes == "base" else tool
    inside = np.flatnonzero(np.diff(EPISODE) == 0)
    np.testing.assert_allclose(np.diff(own, axis=0)[inside], steps[inside], atol=1e-9)
    np.testing.assert_array_equal(np.diff(own, axis=0)[np.diff(EPISODE) != 0], 0.0)
    found = changes(own, steps / 0.5, EPISODE)
    np.testing.assert_allclose(np.diag(found.gain), 0.5, rtol=1e-6)


@pytest.mark.parametrize("order", [(0, 1, 2, 3), (3, 0, 1, 2)])
def test_both_orders_of_the_scalar_part_are_read(order):
    quaternions, steps = turns("base")
    raw = [RawEpisode(str(e), "0", {"q": quaternions[e == EPISODE][:, order]}) for e in range(6)]
    channel = ChannelSource(
        name="quat", columns=["q[0:4]"], components=list("abcd"), unit="1", stream="robot"
    )
    seen = turned([channel], Sample(raw, EPISODE))
    assert seen.shape == (360, 12)
    assert np.max(changes(seen, steps, EPISODE).explained, axis=1).min() > 0.99
    assert turned([], Sample(raw, EPISODE)).shape == (360, 0)


def test_a_damaged_row_stops_nothing():
    quaternions, _ = turns("base")
    quaternions[17] = 0.0
    quaternions[18] = np.nan
    base, _ = added_turns(quaternions, EPISODE)
    assert np.isfinite(base).all()
