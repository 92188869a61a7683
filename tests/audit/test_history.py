"""The test of the past: a cue that has gone is found, and a free choice leaves no trace."""

import numpy as np
import pytest

from genpolicy.audit.data import AuditInput, Episodes
from genpolicy.audit.history import history_test, past_features, shortest_gap
from genpolicy.audit.settings import AuditSettings
from genpolicy.seeds import stream

SETTINGS = AuditSettings(permutations=199)
STEPS, EPISODES = 40, 24


def walks(seed, *, cue=None, length=STEPS):
    """Random walks of 24 episodes; `cue(mode, step)` is added to the second component."""
    rng = stream(seed, "history")
    modes = rng.integers(0, 2, EPISODES)
    observation = np.cumsum(rng.normal(0, 0.01, (EPISODES, length, 2)), axis=1)
    if cue is not None:
        observation[:, :, 1] += [[cue(mode, step) for step in range(length)] for mode in modes]
    n = EPISODES * length
    text = np.full(EPISODES, "")
    data = AuditInput(
        observation=observation.reshape(n, 2), action=observation.reshape(n, 2),
        phase=np.full(n, "all"), episode=np.repeat(np.arange(EPISODES), length),
        index=np.tile(np.arange(length), EPISODES), event_time_s=np.arange(n, dtype=float),
        episodes=Episodes(
            uuid=np.array([f"e{k:02d}" for k in range(EPISODES)]), split=text, operator=text,
            object=text, calibration_epoch=text, outcome=text,
            is_recovery=np.zeros(EPISODES, dtype=bool), order=np.arange(EPISODES, dtype=float),
        ),
        observation_scale=np.array([0.01, 0.01]), observation_names=("tcp.x", "lamp.on"),
        observation_position=slice(0, 2), action_position=slice(0, 2), period_s=0.1,
    )  # fmt: skip
    rows = np.arange(EPISODES) * length + length - 5
    return data, rows, modes


def measured(data, rows, modes, seed=0):
    blocks = np.repeat([0, 1], EPISODES // 2)
    return history_test(
        data, SETTINGS, rows=rows, labels=modes, blocks=blocks, rng=stream(seed, "test")
    )


def test_a_lamp_that_has_gone_out_is_found():
    result = measured(*walks(1, cue=lambda mode, step: 2.0 * mode if 5 <= step < 9 else 0.0))
    assert result.p_value <= 0.01
    assert result.effect > 0.8 and result.effect_lower > 0.5
    assert result.present < 0.3
    assert result.feature.startswith("lamp.on")
    assert result.n == EPISODES


def test_what_is_still_to_be_seen_is_no_matter_of_the_past():
    result = measured(*walks(2, cue=lambda mode, step: 2.0 * mode))
    assert result.present == pytest.approx(result.effect, abs=0.1)


def test_a_move_that_has_just_begun_is_not_the_past():
    gap = shortest_gap(SETTINGS)
    begun = STEPS - 5 - gap + 1
    result = measured(*walks(3, cue=lambda mode, step: 0.5 * mode if step >= begun else 0.0))
    assert result.p_value > 0.05


def test_a_free_choice_leaves_no_trace():
    p_values = [measured(*walks(seed), seed=seed).p_value for seed in range(100, 160)]
    # Binomial(60, 0.05): 9 or more with probability 0.4 %.
    assert np.count_nonzero(np.array(p_values) <= 0.05) < 9
    assert 0.3 < np.mean(p_values) < 0.7


def test_too_short_a_past_says_nothing():
    data, rows, modes = walks(4, length=10)
    result = measured(data, rows, modes)
    assert (result.n, result.p_value, result.effect) == (0, 1.0, 0.0)


def test_features_never_look_at_the_present():
    data, rows, _ = walks(5)
    before, names = past_features(data, SETTINGS, rows)
    late = data.index > STEPS - 5 - shortest_gap(SETTINGS)
    changed = np.where(late[:, None], 99.0, data.observation)
    data.observation[:] = changed
    assert np.array_equal(past_features(data, SETTINGS, rows)[0], before)
    assert before.shape == (EPISODES, len(names))
