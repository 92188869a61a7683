"""Numbers inside episodes."""

import numpy as np

from genpolicy.audit.semantics.robust import episode_centred, episode_deviation

STARTS = np.array([0, 3, 3, 8])  # the second episode has no rows


def test_values_without_the_mean_of_their_episode() -> None:
    values = np.random.default_rng(7).normal(size=(8, 2))
    expected = np.concatenate([part - part.mean(0) for part in (values[:3], values[3:])])
    np.testing.assert_allclose(episode_centred(values, STARTS), expected)
    np.testing.assert_allclose(episode_centred(values[:, 0], STARTS), expected[:, 0])


def test_deviation_inside_each_episode_is_zero_without_rows() -> None:
    values = np.random.default_rng(7).normal(size=(8, 2))
    expected = [values[:3].std(0), np.zeros(2), values[3:].std(0)]
    np.testing.assert_allclose(episode_deviation(values, STARTS), expected)
