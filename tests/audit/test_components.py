"""Components of an action: each alone has its modes, its scale, and says where nobody looked."""

from dataclasses import replace

import numpy as np
import pytest
from planar import SETTINGS

from benchmarks.audit.plan import Plan
from benchmarks.audit.recorder import record
from genpolicy.audit.components import (
    GRIPPER,
    NAMES,
    OTHER,
    ROTATION,
    STROKE_SHARE,
    TIMING,
    Component,
    components_of,
    joined,
    series,
    stricter,
    vectors,
)
from genpolicy.audit.data import canonical
from genpolicy.audit.modes import cluster
from genpolicy.audit.neighbourhoods import Neighbourhood
from genpolicy.audit.persistence import kept_between, roughness
from genpolicy.contract.rotation import rotation_to_6d
from genpolicy.seeds import stream

MEMBERS = 21


@pytest.fixture(scope="module")
def tooled():
    """Rows with a tool; what it does is replaced by the tests."""
    return canonical(record("planar", Plan(3, episodes=40, differ="gripper")).data)


def starts(data):
    """First rows of as many episodes as a situation has members."""
    return np.unique(data.first_row)[:MEMBERS]


def with_yaw(data, angles):
    """The first chunk of each of those episodes commanded at an angle."""
    action = data.action.copy()
    for row, angle in zip(starts(data), angles, strict=True):
        c, s = np.cos(angle), np.sin(angle)
        matrix = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        action[row : row + SETTINGS.chunk_rows, data.action_rotation] = rotation_to_6d(matrix)
    return replace(data, action=action)


def with_grip(data, ticks):
    """The first chunk of each of those episodes closes at a tick."""
    action = data.action.copy()
    for row, tick in zip(starts(data), ticks, strict=True):
        closed = np.arange(SETTINGS.chunk_rows) >= tick
        action[row : row + SETTINGS.chunk_rows, data.action_gripper] = np.where(closed, 0.01, 0.04)[
            :, None
        ]
    return replace(data, action=action)


def component(data, name, situations=()):
    return components_of(data, SETTINGS, list(situations))[NAMES.index(name)]


def modes(data, name):
    rows = starts(data)
    item = component(data, name, [rows])
    return cluster(vectors(data, SETTINGS, item, rows), stricter(SETTINGS), item.separation)


def test_two_yaws_are_two_modes_and_every_yaw_between_them_none(tooled):
    rng = stream(1, "yaw")
    half = np.where(np.arange(MEMBERS) % 2 == 0, 0.6, -0.6) + 0.05 * rng.normal(size=MEMBERS)
    split = modes(with_yaw(tooled, half), ROTATION)
    assert split.count == 2 and len(set(split.labels[half > 0])) == 1
    assert split.separation == pytest.approx(2 * np.sin(0.6), abs=0.1)
    false = [
        modes(with_yaw(tooled, rng.uniform(-1.05, 1.05, MEMBERS)), ROTATION).count > 1
        for _ in range(150)
    ]
    assert np.mean(false) <= 0.05


def test_rotations_half_a_turn_away_are_one_mode_whatever_their_sign(tooled):
    rng = stream(2, "half turn")
    around = np.pi + 0.3 * rng.normal(size=MEMBERS)  # some beyond, some before half a turn
    assert modes(with_yaw(tooled, around), ROTATION).count == 1


def test_the_hand_closes_early_or_late_or_at_any_time(tooled):
    rng = stream(3, "grip")
    early = np.where(np.arange(MEMBERS) % 2 == 0, 2, 10) + rng.integers(0, 2, MEMBERS)
    split = modes(with_grip(tooled, early), GRIPPER)
    assert split.count == 2 and len(set(split.labels[early < 5])) == 1
    false = [
        modes(with_grip(tooled, rng.integers(1, 13, MEMBERS)), GRIPPER).count > 1
        for _ in range(150)
    ]
    assert np.mean(false) <= 0.05
    # Two steps of sixteen are the hand's own jitter, however cleanly they fall apart.
    jitter = np.where(np.arange(MEMBERS) % 2 == 0, 4, 6)
    assert modes(with_grip(tooled, jitter), GRIPPER).count == 1


def test_the_scale_is_what_the_data_scatter_and_modes_lie_three_apart(tooled):
    rng = stream(4, "scale")
    narrow = with_yaw(tooled, 0.01 * rng.normal(size=MEMBERS))
    wide = with_yaw(tooled, 1.5 * rng.normal(size=MEMBERS))
    rows = starts(tooled)
    still, free = (component(data, ROTATION, [rows]) for data in (narrow, wide))
    assert still.scale < free.scale and still.spread < free.spread
    assert still.separation == pytest.approx(3 * SETTINGS.scale_rad)
    assert free.separation == pytest.approx(max(3 * SETTINGS.scale_rad, 3 * free.scale))


def test_what_the_action_lacks_or_nobody_can_read_is_said(tooled):
    plain = replace(tooled, action_rotation=None, action_gripper=None)
    states = {item.name: item.state for item in components_of(plain, SETTINGS, [])}
    # Nothing is lost: columns that no name holds are looked at as what is left over.
    assert (states[ROTATION], states[GRIPPER], states[OTHER]) == ("absent", "absent", "varies")
    action = tooled.action.copy()
    action[5, tooled.action_rotation] = 0.0
    assert component(replace(tooled, action=action), ROTATION).state == "unreadable"
    timed = SETTINGS.model_copy(update={"representation": "time"})
    assert components_of(tooled, timed, [])[NAMES.index(TIMING)].state == "in_position"


def test_a_column_that_only_trembles_hardly_varies(tooled):
    action = tooled.action.copy()
    action[:, tooled.action_gripper] = 0.02 + 1e-4 * stream(5, "tremor").normal(
        size=(len(action), 1)
    )
    assert component(replace(tooled, action=action), GRIPPER).state == "hardly_varies"


def test_an_event_is_where_it_happens():
    step = (np.arange(16)[None, :] >= np.array([4, 8, 12])[:, None]).astype(float)[..., None]
    part = joined(Component(GRIPPER, "varies", "strokes", STROKE_SHARE), step)
    near, far = np.linalg.norm(part[0] - part[1]), np.linalg.norm(part[0] - part[2])
    # By hand: added up over 16 steps, 4 later is a quarter less from then on.
    ramp = np.concatenate([np.zeros(4), np.arange(1, 5) / 16, np.full(8, 0.25)])
    assert near == pytest.approx(np.sqrt(np.mean(ramp**2)))
    assert far > 1.5 * near


def test_modes_of_a_grip_are_found_again_in_actions_that_were_not_clustered(tooled):
    rng = stream(6, "between")
    early = np.where(np.arange(MEMBERS) % 2 == 0, 2, 10) + rng.integers(0, 2, MEMBERS)
    data = with_grip(tooled, early)
    rows = starts(data)
    place = Neighbourhood(int(rows[-1]), rows[:-1], np.zeros(MEMBERS - 1))
    item = component(data, GRIPPER, [rows])
    share, null = kept_between(data, SETTINGS, item, place, rng=rng)
    assert share == 1.0 and np.quantile(null, 0.95) < 0.9
    assert roughness(series(data, SETTINGS, item, rows)) < 0.3
    white = replace(item, signal=rng.normal(size=(len(data.action), 1)), separation=0.0)
    shares = [kept_between(data, SETTINGS, white, place, rng=rng)[0] for _ in range(3)]
    assert max(shares) < 1.0
    assert roughness(series(data, SETTINGS, white, rows)) == pytest.approx(1.0, abs=0.2)
