"""Modes of a cloud of chunks: none where there are none, features without time or order."""

import numpy as np
import pytest
from planar import SETTINGS

from genpolicy.audit.modes import cluster_chunks, features, progress, split_gain
from genpolicy.seeds import stream

TIMES = np.linspace(0.0, 1.0, 16)


def fan(lateral, rng, noise=0.002):
    """Chunks straight ahead that end at the given lateral positions."""
    n = len(lateral)
    ahead = 0.3 * TIMES[None] * np.ones((n, 1))
    side = np.asarray(lateral)[:, None] * TIMES[None]
    paths = np.stack([ahead, side, np.zeros_like(side)], axis=2)
    return paths + noise * rng.normal(size=paths.shape)


def test_false_modes_of_structureless_clouds_are_rare():
    rng = stream(20, "clouds")
    gauss = [
        cluster_chunks(fan(0.08 * rng.normal(size=21), rng), SETTINGS).count > 1 for _ in range(300)
    ]
    uniform = [
        cluster_chunks(fan(rng.uniform(-0.15, 0.15, 21), rng), SETTINGS).count > 1
        for _ in range(300)
    ]
    assert np.mean(gauss) <= 0.01
    assert np.mean(uniform) <= 0.05


@pytest.mark.parametrize("share", [0.25, 0.5])
def test_two_and_three_modes_are_counted(share):
    rng = stream(21, "modes")
    found = []
    for _ in range(50):
        left = rng.random(21) < share
        left[:4], left[-4:] = True, False
        lateral = np.where(left, 0.12, -0.12) + 0.015 * rng.normal(size=21)
        split = cluster_chunks(fan(lateral, rng), SETTINGS)
        found.append(split.count == 2 and len(set(split.labels[left].tolist())) == 1)
    assert np.mean(found) >= 0.95
    three = np.repeat([-0.15, 0.0, 0.15], 7) + 0.004 * rng.normal(size=21)
    assert cluster_chunks(fan(three, rng), SETTINGS).count == 3


def test_speed_is_no_mode_of_the_route_but_one_of_time():
    rng = stream(22, "speed")
    speed = np.where(np.arange(21) % 2 == 0, 1.0, 0.5)
    paths = fan(np.zeros(21), rng, noise=0.0005) * speed[:, None, None]
    assert cluster_chunks(paths, SETTINGS).count == 1
    timed = SETTINGS.model_copy(update={"representation": "time"})
    assert cluster_chunks(paths, timed).count == 2


def test_labels_do_not_depend_on_rotation_or_order():
    rng = stream(23, "rotation")
    lateral = np.where(np.arange(21) < 8, 0.1, -0.1) + 0.01 * rng.normal(size=21)
    paths = fan(lateral, rng)
    turn = np.array([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
    first = cluster_chunks(paths, SETTINGS)
    turned = cluster_chunks(paths @ turn.T, SETTINGS)
    order = rng.permutation(21)
    dealt = cluster_chunks(paths[order], SETTINGS)
    assert np.array_equal(first.labels, turned.labels)
    assert np.array_equal(first.labels[order], dealt.labels)
    assert first.separation == pytest.approx(turned.separation)


def test_split_gain_golden():
    # Two tight groups of 4: total scatter 8 (within 0 up to the floor), so the gain is large;
    # eight equal values have none.
    gain, sides = split_gain(np.array([0.0, 2, 0, 2, 0, 2, 0, 2]), 2)
    assert gain > 100 and sides.tolist() == [0, 1, 0, 1, 0, 1, 0, 1]
    assert split_gain(np.zeros(8), 2)[0] < 0
    # By hand, n = 4, values -3 -1 1 3: scatter 20 against 4; 4 ln 5 - 8 ln 2 - 2 ln 4.
    assert split_gain(np.array([-3.0, -1, 1, 3]), 2)[0] == pytest.approx(
        4 * np.log(5) - 8 * np.log(2) - 2 * np.log(4)
    )


def test_resampling_by_arc_length_agrees_with_interpolation():
    rng = stream(25, "arc")
    paths = np.cumsum(rng.normal(size=(7, 16, 3)), axis=1)
    paths[2] = paths[2, 0]  # one that stands still
    whole = np.concatenate([np.zeros((7, 1, 3)), paths], axis=1)  # from the origin on
    along = progress(whole, 4)
    common = max(np.quantile(along[:, -1], 0.25), 0.5 * np.median(along[:, -1]))
    at = np.linspace(0, common, 16)
    expected = [[np.interp(at, along[i], whole[i, :, j]) for j in range(3)] for i in range(7)]
    got = features(paths, SETTINGS).reshape(7, 16, 3) * 4.0
    assert got == pytest.approx(np.swapaxes(np.array(expected), 1, 2), abs=1e-12)


def test_progress_of_a_straight_line_is_its_length_and_tremor_adds_little():
    rng = stream(26, "progress")
    line = np.zeros((9, 32, 3))
    line[:, :, 0] = 0.012 * np.arange(32)
    assert progress(line, 1) == pytest.approx(line[:, :, 0], abs=1e-9)
    still = np.zeros((200, 32, 3)) + 0.006 * rng.normal(size=(200, 32, 3))
    raw = np.linalg.norm(np.diff(still, axis=1), axis=2).sum(axis=1)
    assert np.mean(progress(still, 4)[:, -1]) < 0.15 * np.mean(raw)


@pytest.mark.parametrize("tremor_m", [0.0, 0.003])
def test_to_rest_first_is_no_route_of_its_own(tremor_m):
    # Some go at once, others first rest for up to half a chunk; all go the same way.
    rng = stream(27, "rest")
    found = []
    for _ in range(40):
        waits = np.where(np.arange(21) < 14, 0, rng.integers(4, 9, 21))
        at = np.maximum(np.arange(32)[None] - waits[:, None], 0) * 0.012
        bend = 0.1 * np.sin(np.minimum(at / 0.2, 1.0) * np.pi / 2)
        paths = np.stack([at, bend + 0.004 * rng.normal(size=(21, 1)), np.zeros_like(at)], axis=2)
        paths = paths + tremor_m * rng.normal(size=paths.shape)
        found.append(cluster_chunks(paths - paths[:, :1], SETTINGS).count > 1)
    assert np.mean(found) <= 0.05


@pytest.mark.parametrize("rests", [0, 6, 10])
def test_two_ways_part_as_far_after_a_rest(rests):
    """To wait makes the common length no shorter: else nobody gets far enough to part."""
    rng = stream(24, "late")
    steps = SETTINGS.chunk_rows
    ahead = np.maximum(np.arange(1, 2 * steps + 1)[None] - rests * np.ones((24, 1)), 0.0) / steps
    side = np.where(np.arange(24) % 2, 1.0, -1.0)[:, None]
    # Ways that part little by little: halfway along they are not yet apart.
    across = 1.3 * SETTINGS.minimum_separation_m * side * ahead**2
    paths = np.stack([0.3 * ahead, across, np.zeros_like(ahead)], axis=2)
    paths += 0.0005 * rng.normal(size=(24, 1, 3)) * ahead[:, :, None]
    assert cluster_chunks(paths, SETTINGS).count == 2


def test_chunks_are_measured_by_the_length_of_those_against_which_they_are_held():
    rng = stream(25, "like")
    paths = fan(rng.uniform(-0.1, 0.1, 9), rng)
    assert np.array_equal(features(paths, SETTINGS, paths), features(paths, SETTINGS))
    # One of them alone, and twice as fast: the same route, seen as far as the others go.
    slow, fast = features(paths[:1], SETTINGS, paths), features(2.0 * paths[:1], SETTINGS, paths)
    assert np.allclose(slow, features(paths, SETTINGS)[:1], atol=1e-12)
    assert np.linalg.norm(fast - slow) < 0.1 * np.linalg.norm(
        features(2.0 * paths[:1], SETTINGS) - slow
    )
