"""A single number that trembles is seen in every form; what only trembles commands nothing."""

from dataclasses import replace

import numpy as np
import pytest
from planar import SETTINGS, planar

from genpolicy.audit.data import canonical
from genpolicy.audit.forms import Forms
from genpolicy.audit.neighbourhoods import Neighbourhood
from genpolicy.audit.tremor import LEAST_MOTION, tremors
from genpolicy.seeds import stream

STEPS = 40


class Item:
    """A situation of which only the members are asked."""

    def __init__(self, rows):
        self.neighbourhood = Neighbourhood(int(rows[0]), rows[1:], np.zeros(len(rows) - 1))


@pytest.fixture(scope="module")
def data():
    """Three numbers that go smoothly, each episode by a little more than the last."""
    base, _ = planar(episodes=30, seed=4)
    base = canonical(base)
    count = len(base.episodes)
    episode, index = np.repeat(np.arange(count), STEPS), np.tile(np.arange(STEPS), count)
    rows = np.arange(STEPS * count)
    own = 0.1 * stream(1, "own").normal(size=(count, 3))[episode]
    action = (1.0 + own) * np.sin(index / STEPS * np.pi)[:, None]
    kept = {
        name: getattr(base, name)[rows % len(base.phase)]
        for name in ("observation", "phase", "event_time_s")
    }
    return replace(
        base, **kept, action=action, episode=episode, index=index, delay_s={}, stream_time_s={},
        action_position=slice(0, 2), action_rotation=None, action_gripper=None,
        action_names=("a", "b", "c"),
    )  # fmt: skip


def seen(data):
    starts = np.unique(data.first_row)
    items = [Item(starts + k) for k in (2, 8, 14)]
    return {item.column: item for item in tremors(data, SETTINGS, items)}


def shaken(data, column, size):
    action = data.action.copy()
    action[:, column] += size * stream(2, "shake").normal(size=len(action))
    return replace(data, action=action)


def test_smooth_numbers_do_not_tremble(data):
    assert all(item.ratio < 0.2 and item.white_share < 0.1 for item in seen(data).values())


@pytest.mark.parametrize("column", [0, 2])
def test_only_the_number_that_trembles_does(data, column):
    found = seen(shaken(data, column, 0.3))
    name = data.action_names[column]
    assert found[name].ratio > 0.8 and found[name].white_share > 0.4
    assert all(item.white_share < 0.1 for other, item in found.items() if other != name)


def test_a_rate_is_looked_at_before_it_is_added_up(data):
    rates = Forms(np.ones(3, bool), np.full(3, -0.5), np.zeros(3), np.full(3, -1))
    place, rate = seen(shaken(data, 0, 0.3)), seen(replace(shaken(data, 0, 0.3), forms=rates))
    assert rate["a"].ratio == place["a"].ratio and rate["a"].white_share == place["a"].white_share
    assert rate["a"].spread == pytest.approx(0.5 * place["a"].spread)


def test_what_is_noise_alone_or_constant_is_left_out(data):
    action = data.action.copy()
    action[:, 0] = 1e-3 * stream(3, "noise").normal(size=len(action))
    action[:, 1] = 0.25
    assert set(seen(replace(data, action=action))) == {"c"}
    assert 0.0 < LEAST_MOTION < 1.0


def test_spread_is_a_share_of_what_sets_modes_apart(data):
    apart = SETTINGS.model_copy(update={"minimum_separation_m": 0.06})
    items = [Item(np.unique(data.first_row) + 5)]
    near, far = (tremors(shaken(data, 0, 0.3), s, items)[0] for s in (SETTINGS, apart))
    ratio = apart.minimum_separation_m / SETTINGS.minimum_separation_m
    assert near.spread == pytest.approx(ratio * far.spread)


def test_without_situations_nothing_is_said(data):
    assert tremors(data, SETTINGS, []) == ()
