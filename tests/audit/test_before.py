"""What was seen before a choice: ranks among those who saw the same, where there is a past."""

from dataclasses import replace

import numpy as np
from planar import SETTINGS

from benchmarks.audit.plan import Plan
from benchmarks.audit.recorder import record
from genpolicy.audit import before
from genpolicy.audit.before import STILL_TOGETHER, seen_before
from genpolicy.audit.choices import choices
from genpolicy.audit.data import canonical
from genpolicy.audit.history import past_features, shortest_gap
from genpolicy.audit.linking import link
from genpolicy.audit.resolution import observed_gap
from genpolicy.audit.situations import find_situations

PLAN = Plan(5, shares=(0.5, 0.5), episodes=90, exact=True, decided_by="lamp_early", fidelity=1.0)


def chosen(stride=10, plan=PLAN):
    data = canonical(record("planar", plan).data)
    settings = SETTINGS.model_copy(update={"query_stride": stride})
    items = [(i, c) for _, i, c in find_situations(data, settings, 0)[0] if c.count > 1]
    links = link([(data.episode[i.members], c.labels) for i, c in items], len(data.episodes), 6)
    return data, settings, items, choices(data, items, links)


def test_a_lamp_is_high_or_low_among_those_who_saw_the_same_whichever_is_the_rarer():
    data, settings, items, who = chosen()
    seen = seen_before(data, settings, items, who)
    names = past_features(data, settings, np.unique(data.first_row)[:1])[1]
    lamp = seen.past[:, names.index("lamp at the start")]
    shown = {int(e): data.observation[data.first_row[data.episode == e][0], 4]
             for e in seen.choices.episode}  # fmt: skip
    lit = np.array([shown[int(episode)] for episode in seen.choices.episode])
    assert np.mean(np.sign(lamp) == np.sign(lit)) > 0.95
    assert np.abs(seen.past).max() <= 0.5 and np.abs(seen.present).max() <= 0.5


def test_only_situations_that_have_a_past_and_stand_together_are_asked():
    data, settings, items, who = chosen()
    gap = shortest_gap(settings)
    fit = [item for item in items if observed_gap(data, settings, *item) < STILL_TOGETHER]
    rows = np.concatenate([item.members for item, _ in fit])
    late = {int(e) for e in data.episode[rows[rows - data.first_row[rows] >= gap]]}
    seen = seen_before(data, settings, items, who)
    assert len(seen.choices.episode) and set(map(int, seen.choices.episode)) <= late
    assert np.all(np.isfinite(seen.past)) and np.all(np.isfinite(seen.present))
    apart = [item for item in items if observed_gap(data, settings, *item) >= STILL_TOGETHER]
    later = seen_before(data, settings, apart, who)
    assert len(later.choices.episode) == 0 and later.reached > 0
    assert seen.reached >= len(seen.choices.episode)


def going(data, rows, modes, *, apart):
    """The same data, but that these rows come to where they stand on two courses, by mode."""
    data = replace(data, observation=data.observation.copy())
    place = data.observation_position
    step = np.array([0.002, 0.0]) * np.where(modes == 0, 1.0, -1.0)[:, None]
    data.observation[rows - 1, place] = data.observation[rows, place]
    data.observation[rows - 1, place] -= step if apart else np.abs(step)
    return data


def test_who_stands_together_and_goes_apart_is_not_asked_what_was_before():
    """Where each came from tells where it goes, as soon as enough episodes stand near enough.

    A million frames without any cue were left open (`history`): of ways that had parted by three
    rows in thirty, the start told the side, as the last step did.
    """
    data, settings, items, who = chosen(stride=4)
    gap, mode = shortest_gap(settings), dict(zip(who.episode.tolist(), who.mode, strict=True))
    for item in items:
        rows = item[0].members
        known = [int(episode) in mode for episode in data.episode[rows]]
        rows = rows[(rows - data.first_row[rows] >= gap) & known]
        modes = np.array([mode[int(episode)] for episode in data.episode[rows]], dtype=np.int64)
        if observed_gap(data, settings, *item) < STILL_TOGETHER and min(
            np.bincount(modes, minlength=2)
        ) > 2:  # fmt: skip
            break
    same, parted = (going(data, rows, modes, apart=apart) for apart in (False, True))
    assert len(seen_before(same, settings, [item], who).choices.episode) > 5
    assert observed_gap(parted, settings, *item) < STILL_TOGETHER
    left = seen_before(parted, settings, [item], who)
    assert len(left.choices.episode) == 0 and left.reached > 5


def test_a_single_row_of_a_mode_is_no_choice_that_could_be_told():
    data, settings, items, who = chosen()
    late = [item for item in items if observed_gap(data, settings, *item) < STILL_TOGETHER]
    asked = next(
        part
        for item in late
        if len((part := seen_before(data, settings, [item], who)).choices.episode) > 5
    )
    first = int(asked.choices.episode[0])
    alone = replace(who, mode=np.where(who.episode == first, 1, 0))
    for item in late:
        assert len(seen_before(data, settings, [item], alone).choices.episode) == 0


def test_at_the_start_of_an_episode_nothing_was_seen_before():
    data, settings, items, who = chosen(stride=4, plan=replace(PLAN, decided_by="chance"))
    gap = shortest_gap(settings)
    first = [(i, c) for i, c in items if np.all(i.members - data.first_row[i.members] < gap)]
    assert first and seen_before(data, settings, first, who).reached == 0


def test_who_splits_later_inside_one_mode_chose_nothing_that_is_asked_about():
    """Four of 367 episodes that turned off late left the past of all others unasked."""
    data, settings, items, who = chosen()
    gap = shortest_gap(settings)
    late = [item for item in items if seen_before(data, settings, [item], who).reached > 3]
    rows = late[0][0].members
    inside = np.isin(who.episode, data.episode[rows[rows - data.first_row[rows] >= gap]])
    assert late[0][1].count > 1 and np.count_nonzero(inside) > 3
    same = replace(who, mode=np.where(inside, 0, who.mode))
    assert seen_before(data, settings, late[:1], same).reached == 0
    one, two = np.flatnonzero(inside)[:2]
    for turned, reached in (([one], 0), ([one, two], np.count_nonzero(inside))):
        mode = same.mode.copy()
        mode[turned] = 1
        assert seen_before(data, settings, late[:1], replace(who, mode=mode)).reached == reached


def test_how_frequent_a_mode_is_is_read_where_the_past_is_asked():
    """While the lamp is seen, neighbours saw the same lamp: its word is no frequency of the mode.

    Taken from all situations, a mode that went against the lamp would be the rarer one and count
    more, so that a lamp that tells seven of ten would seem to tell nothing.
    """
    data, settings, items, who = chosen(stride=4, plan=replace(PLAN, fidelity=0.5))
    seen = seen_before(data, settings, items, who)
    part = seen.choices
    shown = np.array([data.observation[data.first_row[data.episode == e][0], 4]
                      for e in part.episode])  # fmt: skip
    own = {int(e): share for e, share in zip(who.episode, who.share, strict=True)}
    everywhere = np.array([own[int(e)] for e in part.episode])
    assert np.allclose(part.share.sum(axis=1), 1.0)
    assert np.all(part.share[np.arange(len(part.mode)), part.mode] > 0.0)

    def shift(share):
        """By how much mode 0 is the more frequent one where the lamp shines than where not."""
        return abs(share[shown > 0.0, 0].mean() - share[shown < 0.0, 0].mean())

    assert shift(everywhere) > 0.15
    assert shift(part.share) < 0.5 * shift(everywhere)


def test_a_slip_of_the_linking_does_not_weigh_as_much_as_twenty(monkeypatch):
    """Two of a crowd that are of another mode where it is asked had no choice: left out."""
    data, settings, items, who = chosen(stride=4)
    late = [item for item in items if observed_gap(data, settings, *item) < STILL_TOGETHER]
    gap = shortest_gap(settings)
    crowd = max(
        late, key=lambda item: np.sum(item[0].members - data.first_row[item[0].members] >= gap)
    )
    members = np.unique(data.episode[crowd[0].members])
    two = seen_before(data, settings, [crowd], who).choices.episode[:2]
    mode = np.where(np.isin(who.episode, members), 0, who.mode)
    lonely = replace(who, mode=np.where(np.isin(who.episode, two), 1, mode))
    asked = seen_before(data, settings, [crowd], lonely).choices
    assert set(two) <= set(asked.episode) and asked.weight.max() > 5.0
    monkeypatch.setattr(before, "LEAST_SHARE", 0.2)
    assert len(seen_before(data, settings, [crowd], lonely).choices.episode) == 0
