"""What a contract is proposed from depends on the episodes, never on their order."""

import numpy as np
import pytest
from scipy import stats

from genpolicy.data.assemble import Refusal
from genpolicy.data.formats.contract import Labels
from genpolicy.data.formats.following import MOST_EPISODES
from genpolicy.data.formats.sampling import (
    SAMPLE_EPISODES,
    labels_among,
    sample_episodes,
    settled,
)
from genpolicy.data.formats.source import Column, RawEpisode


class Recordings:
    """Episodes in the order given."""

    def __init__(self, episodes):
        self.handed = episodes

    def episodes(self, wanted, episode=None, also=None):
        yield from self.handed


def episode(number, *, start=0.0, finite=True):
    values = np.random.default_rng(number).normal(size=(8, 2))
    values[3, 0] = values[3, 0] if finite else np.nan
    return RawEpisode(f"e{number}", "", {"x": values, "t": start + np.arange(8) / 10})


def labels_of(sampled):
    return [item.label for item in sampled.episodes]


def test_the_same_episodes_in_any_order():
    episodes = [episode(k) for k in range(120)]
    chosen = labels_of(sample_episodes(Recordings(episodes), ["x"], Labels()))
    assert len(chosen) == SAMPLE_EPISODES
    for seed in range(3):
        order = np.random.default_rng(seed).permutation(120)
        again = sample_episodes(Recordings([episodes[k] for k in order]), ["x"], Labels())
        assert labels_of(again) == chosen
    assert chosen != [f"e{k}" for k in range(SAMPLE_EPISODES)]


def test_what_will_be_refused_decides_only_where_there_is_nothing_else():
    bad = [episode(k, finite=False) for k in range(90)]
    good = [episode(k) for k in range(90, 93)]
    assert set(labels_of(sample_episodes(Recordings(bad + good), ["x"], Labels()))) == {
        "e90", "e91", "e92",
    }  # fmt: skip
    assert len(sample_episodes(Recordings(bad), ["x"], Labels()).episodes) == SAMPLE_EPISODES
    refused = sample_episodes(Recordings([Refusal("a", "a", "why")]), ["x"], Labels())
    assert (refused.episodes, refused.reason) == ([], "why")


def test_a_fault_in_a_third_of_the_episodes_is_not_half_of_those_that_are_read_by_luck():
    """The median episode has the word; with 40 of 160 a third became 45 % once in seventy draws."""
    faulty = stats.hypergeom(160, 48, SAMPLE_EPISODES)
    assert faulty.sf(0.45 * SAMPLE_EPISODES - 1) < 1e-3
    assert MOST_EPISODES >= SAMPLE_EPISODES


@pytest.mark.parametrize(("apart", "expected"), [(1.0, True), (0.5, False), (0.0, False)])
def test_one_clock_is_seen_in_all_episodes(apart, expected):
    # Two collections that begin at 0 each are no one clock, whichever comes first.
    episodes = [episode(k, start=apart * k) for k in range(30)]
    assert sample_episodes(Recordings(episodes), ["x"], Labels(time="t")).one_clock is expected
    backwards = sample_episodes(Recordings(episodes[::-1]), ["x"], Labels(time="t"))
    assert backwards.one_clock is expected
    assert not sample_episodes(Recordings(episodes), ["x"], Labels()).one_clock


def words(number, *switches):
    values = np.repeat(["a", "b"], 4) if number in switches else np.repeat(["a"], 8)
    return RawEpisode(f"e{number}", "", {"task": values.astype(object)})


def test_one_episode_that_switches_is_damaged_a_quarter_mean_it():
    notes = []
    labels = Labels(task="task", outcome="success")
    assert settled(labels, [words(k, 3) for k in range(8)], notes) == labels
    assert not notes
    assert settled(labels, [words(k, 1, 3) for k in range(8)], notes).task is None
    assert "task switches inside episodes" in notes[0]


def test_labels_are_few_whole_numbers_that_hold():
    def columns(number):
        return {
            "goal": np.full(16, number % 3),
            "mode": np.repeat([number % 2, 1], 8),
            "gripper": np.repeat([0, 1], 8),
            "hand": np.full(16, number % 2),
            "height": np.full(16, 0.5 * (number % 2)),
            "count": np.arange(16),
            "same": np.zeros(16, dtype=int),
        }

    sample = [RawEpisode(str(k), "", columns(k)) for k in range(6)]
    found = labels_among([Column(name, None) for name in columns(0)], sample)
    assert found == ["goal", "mode", "hand"]
