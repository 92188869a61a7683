"""Disturbed episodes: on their own, by mode and split."""


def test_disturbed_episodes_stand_on_their_own(valid):
    assert sum(row.episodes for row in valid.recovery) == 20
    assert {row.mode for row in valid.recovery} <= {"m0", "m1", "unassigned"}
    used = {
        int(e) for item in valid.situations for e in valid.data.episode[item.neighbourhood.members]
    }
    assert not any(valid.data.episodes.is_recovery[e] for e in used)
