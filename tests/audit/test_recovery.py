"""Which mode each episode followed; disturbed episodes on their own, by mode and split."""

import numpy as np


def test_disturbed_episodes_stand_on_their_own(valid):
    assert sum(row.episodes for row in valid.recovery) == 20
    assert {row.mode for row in valid.recovery} <= {"m0", "m1", "unassigned"}
    used = {
        int(e) for item in valid.situations for e in valid.data.episode[item.neighbourhood.members]
    }
    assert not any(valid.data.episodes.is_recovery[e] for e in used)


def test_every_episode_that_passed_a_situation_is_said_to_follow_a_mode(valid):
    linked = valid.links[valid.primary_phase]
    clustered = linked >= 0
    assert np.array_equal(valid.demonstrated[clustered], linked[clustered])
    disturbed = valid.data.episodes.is_recovery
    assert (valid.demonstrated[disturbed] >= 0).any() and not clustered[disturbed].any()
    by_mode = {f"m{mode}": int((valid.demonstrated[disturbed] == mode).sum()) for mode in (0, 1)}
    counted = {
        mode: sum(row.episodes for row in valid.recovery if row.mode == mode) for mode in by_mode
    }
    assert by_mode == counted
