"""Which mode each episode followed; disturbed episodes on their own, by mode and split."""

import numpy as np
import pytest
from planar import SETTINGS

from genpolicy.audit import recovery
from genpolicy.audit.recovery import assign
from genpolicy.audit.situations import by_phase

NARROW = 1.5  # scales, within which not every disturbed episode is near every situation


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


@pytest.fixture(scope="module")
def asked(valid):
    """What `assign` takes, of the disturbed episodes."""
    phase = valid.primary_phase
    situations, modes = by_phase(valid.situations)[phase], valid.links[phase]
    disturbed = np.flatnonzero(valid.data.episodes.is_recovery)
    return valid, situations, modes, disturbed


def follows(asked, situations=None, settings=SETTINGS):
    valid, every, modes, disturbed = asked
    some = every if situations is None else situations
    component = valid.component
    return assign(valid.data, settings, some, modes, disturbed, component=component)


def test_a_share_of_the_situations_says_what_all_of_them_say(asked, monkeypatch):
    every = follows(asked)
    assert len(asked[1]) <= recovery.VOTERS and (every >= 0).sum() >= 10
    monkeypatch.setattr(recovery, "VOTERS", len(asked[1]) // 4)
    few = follows(asked)
    assert np.array_equal(few >= 0, every >= 0)
    assert np.mean(few == every) >= 0.9


def test_who_is_near_none_of_the_first_voters_is_asked_of_the_others(asked, monkeypatch):
    situations, narrow = asked[1], SETTINGS.model_copy(update={"radius": NARROW})
    alone = [follows(asked, [item], narrow) for item in situations]
    first, other = next(
        (a, b)
        for a in range(len(alone))
        for b in range(len(alone))
        if ((alone[a] < 0) & (alone[b] >= 0)).any() and (alone[a] >= 0).any()
    )
    monkeypatch.setattr(recovery, "VOTERS", 1)
    both = follows(asked, [situations[first], situations[other]], narrow)
    assert np.array_equal(both, np.where(alone[first] >= 0, alone[first], alone[other]))
    assert (follows(asked, []) == -1).all()


def test_a_disturbed_episode_goes_as_its_own_side_does(asked):
    """The side of the post, which no vote has seen, against the mode that they give."""
    valid, _, modes, disturbed = asked
    data = valid.data
    away = np.array([
        data.action[data.episode == k, 1][np.argmax(np.abs(data.action[data.episode == k, 1]))]
        for k in range(len(data.episodes))
    ])  # fmt: skip
    said, side = follows(asked), away > 0
    known = said >= 0
    usual = {m: np.mean(side[modes == m]) > 0.5 for m in (0, 1)}
    assert usual[0] != usual[1]
    assert (
        np.mean([usual[m] == side[k] for m, k in zip(said[known], disturbed[known], strict=True)])
        >= 0.9
    )


def test_where_no_episode_has_a_mode_none_follows_one(asked):
    valid, situations, modes, disturbed = asked
    none = np.full_like(modes, -1)
    for some in (situations, []):
        said = assign(valid.data, SETTINGS, some, none, disturbed, component=valid.component)
        assert (said == -1).all()
