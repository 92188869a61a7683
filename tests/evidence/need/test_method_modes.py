"""Which modes the samples of a method cover, and which lie between them or far from all."""

import numpy as np
import pytest

from genpolicy.errors import ContractError
from genpolicy.evidence.need.method_modes import one_per_episode, read_situations, sample_modes

STRAIGHT = np.linspace(0.0, 0.3, 16)[:, None] * np.array([1.0, 0.0, 0.0])
SIDE_M = np.array([0.0, 0.1, 0.0])
MODES = np.stack([STRAIGHT + SIDE_M, STRAIGHT - SIDE_M])


def sampled(*paths, steps=16):
    """Samples whose action holds two numbers before the position."""
    chunks = np.stack(paths)[:, :steps]
    return np.concatenate([np.full((*chunks.shape[:2], 2), 9.0), chunks], axis=2)


def found(*paths, modes=MODES, steps=16):
    return sample_modes(sampled(*paths, steps=steps), modes, position=slice(2, 5))


def test_a_sample_on_a_mode_covers_it_and_the_mean_covers_none():
    both = found(*MODES)
    assert both.nearest.tolist() == [0, 1] and both.modes_covered == both.modes_present == 2
    mean = found(STRAIGHT)
    assert mean.between.all() and not mean.far.any() and mean.modes_covered == 0


def test_a_sample_beside_all_modes_is_far_and_not_between():
    wild = found(MODES[0] + 5.0)
    assert wild.far.all() and wild.modes_covered == 0
    # The modes are apart by twice the side: far is what lies further behind a mode than that.
    assert not found(MODES[0] + 1.99 * SIDE_M).far.any()
    assert found(MODES[0] + 2.01 * SIDE_M).far.all()


@pytest.mark.parametrize(("share", "between"), [(0.24, False), (0.26, True)])
def test_between_begins_a_quarter_of_the_way_from_mode_to_mode(share, between):
    on_the_way = MODES[0] + share * (MODES[1] - MODES[0])
    assert found(on_the_way).between.tolist() == [between]


def test_samples_are_counted_by_the_mode_that_they_reach():
    reached = found(MODES[0], MODES[0], MODES[1], STRAIGHT)
    assert reached.counts(np.ones(4, dtype=bool)).tolist() == [2, 1]
    assert reached.counts(np.array([True, False, False, True])).tolist() == [1, 0]


def test_a_shorter_sample_is_held_against_the_beginning_of_the_modes():
    assert found(*MODES, steps=4).modes_covered == 2


def test_not_a_number_covers_nothing():
    assert found(np.full_like(STRAIGHT, np.nan)).modes_covered == 0


def test_one_mode_or_another_width_is_refused():
    with pytest.raises(ContractError, match="at least two modes"):
        found(STRAIGHT, modes=MODES[:1])
    with pytest.raises(ContractError, match="positions of 2"):
        sample_modes(sampled(STRAIGHT), MODES, position=slice(0, 2))


def test_only_persistent_situations_with_modes_of_the_asked_splits_are_read(kit, tmp_path):
    rows = [
        ("a", 7, {}), ("a", 3, {}), ("b", 1, {"split": "validation"}),
        ("c", 1, {"two_mode": False}),
        ("d", 1, {"persistent": False}), ("e", 1, {"split": "train"}),
    ]  # fmt: skip
    situations = read_situations(kit.write_situations(tmp_path / "audit", rows))
    assert [(s.episode_uuid, s.index) for s in situations] == [("a", 7), ("a", 3), ("b", 1)]
    assert situations[0].mode_paths.shape == (2, 16, 3)
    first = [(s.episode_uuid, s.index) for s in one_per_episode(situations)]
    assert first == [("a", 3), ("b", 1)]
