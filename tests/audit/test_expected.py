"""What is expected of a chunk comes from other episodes, and only from what helps to predict."""

import numpy as np

from genpolicy.audit.expected import expected_chunks
from genpolicy.seeds import stream


def curved(seed=1, episodes=80, noise=0.01):
    """Ten rows an episode; the chunk is a curve of the first of six numbers."""
    rng = stream(seed, "curved")
    seen = np.repeat(rng.uniform(-1, 1, (episodes, 6)), 10, axis=0)
    chunks = np.stack([np.sin(2 * seen[:, 0]), seen[:, 0] ** 2], axis=1)
    episode = np.repeat(np.arange(episodes), 10)
    own = np.repeat(rng.normal(0, noise, (episodes, 2)), 10, axis=0)
    return seen, chunks + own, episode, chunks


def expected(seen, chunks, episode, seed=2):
    importance = np.array([1.0, *[0.01] * 5])
    return expected_chunks(
        seen, seen[::10], chunks, episode=episode, importance=importance, rng=stream(seed, "rng")
    )


def test_a_curved_mean_is_found_and_what_an_episode_does_alone_is_not():
    seen, chunks, episode, truth = curved(noise=0.2)
    found = expected(seen, chunks, episode)
    guess = found.pool @ found.axes + chunks.mean(axis=0)
    assert np.sqrt(np.mean((guess - truth) ** 2)) < 0.12
    # Left out of its own mean, an episode's own way stays in what is left of it.
    own, left = chunks - truth, chunks - guess
    assert np.corrcoef(own.ravel(), left.ravel())[0, 1] > 0.85


def test_a_shift_takes_chunks_to_where_they_are_expected_of_the_query():
    seen, chunks, episode, _ = curved()
    found = expected(seen, chunks, episode)
    moved = chunks[:200] + found.shift(3, np.arange(200))
    assert np.abs(moved - chunks[30]).max() < 0.25
    assert moved.std(axis=0).max() < 0.1 * chunks.std(axis=0).max()


def test_a_seed_decides():
    data = curved()[:3]
    assert np.array_equal(expected(*data).pool, expected(*data).pool)
    assert not np.array_equal(expected(*data).pool, expected(*data, seed=3).pool)
