"""Labels against replay, and the success of each mode with exact intervals."""

from dataclasses import replace

import numpy as np
import pytest
from planar import SETTINGS, planar

from genpolicy.audit.data import canonical
from genpolicy.audit.labels import (
    ModeOutcome,
    Replayed,
    disagreement,
    mode_outcomes,
    replay_sample,
)
from genpolicy.statistics.intervals import clopper_pearson


@pytest.fixture(scope="module")
def data():
    return canonical(planar(episodes=10, recoveries=2)[0])


def outcomes(data, **by_number):
    changed = data.episodes.outcome.astype(object)
    for name, outcome in by_number.items():
        changed[int(name[1:])] = outcome
    return replace(data, episodes=replace(data.episodes, outcome=changed.astype(str)))


def sampled(data, count, seed=1, replay=lambda uuid: "success"):
    settings = SETTINGS.model_copy(update={"replay_episodes": count})
    return replay_sample(data, settings, replay=replay, root_seed=seed)


def test_a_sample_is_random_by_seed_in_order_and_only_of_labelled_episodes(data):
    some = outcomes(data, e0="", e1="", e2="")
    first = [item.episode_uuid for item in sampled(some, 4)]
    assert first == sorted(first) and len(set(first)) == 4
    assert first == [item.episode_uuid for item in sampled(some, 4)]
    assert first != [item.episode_uuid for item in sampled(some, 4, seed=2)]
    every = {item.episode_uuid for item in sampled(some, 99)}
    assert every == set(data.episodes.uuid[3:].tolist())


def test_without_a_replay_nothing_is_asked(data):
    assert sampled(data, 4, replay=None) == ()
    assert disagreement(()) == (0, 0)


def test_disagreements_are_counted():
    replayed = tuple(Replayed(str(n), "success", "failure" if n < 3 else "success")
                     for n in range(20))  # fmt: skip
    assert disagreement(replayed) == (3, 20)


def test_a_replay_overrules_the_label_and_what_is_no_demonstration_does_not_count(data):
    # Episodes 0..4 are mode 0, 5..9 mode 1; 10 and 11 were disturbed.
    labelled = outcomes(data, e1="failure", e9="")
    modes = np.array([0] * 5 + [1] * 5 + [0, 1])
    replayed = (Replayed(str(data.episodes.uuid[0]), "success", "failure"),
                Replayed(str(data.episodes.uuid[1]), "failure", "success"))  # fmt: skip
    first, second = mode_outcomes(labelled, "approach", modes, replayed, {1: (3, 4)})
    assert first == ModeOutcome("m0", "approach", 5, 4, *clopper_pearson(4, 5), 0, 0)
    assert second == ModeOutcome("m1", "approach", 4, 4, *clopper_pearson(4, 4), 3, 4)


def test_no_mode_has_no_outcome(data):
    assert mode_outcomes(data, "approach", np.full(12, -1), (), {}) == ()
