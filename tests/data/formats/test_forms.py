"""Pairs and forms from numbers: names break ties, and absorb no fault."""

import numpy as np
import pytest

from genpolicy.data.formats.forms import read_forms

RATE_HZ = 20.0
EPISODE = np.repeat(np.arange(10), 40)
ENDS = np.flatnonzero(np.diff(EPISODE, append=99))


def paths(seed=0, width=3):
    """Smooth ways to somewhere else in every episode. Shape (400, width)."""
    rng = np.random.default_rng(seed)
    times = np.tile(np.arange(40) / 40, 10)[:, None]
    ways = np.repeat(rng.normal(0, 0.3, (3, 10, width)), 40, axis=1)
    return ways[0] + ways[1] * times**2 * (3 - 2 * times) + 0.3 * ways[2] * np.sin(6 * times)


def later(path, rows):
    """What a follower of `path` does."""
    return np.concatenate(
        [part[np.maximum(np.arange(40) - rows, 0)] for part in np.split(path, 10)]
    )


def change(path):
    steps = np.diff(path, axis=0, append=path[-1:])
    steps[ENDS] = 0.0
    return steps


def read(observed, commanded, named=None, **more):
    return read_forms(
        observed, commanded, EPISODE, named=named or {}, period_s=1.0 / RATE_HZ, **more
    )


FORMS = {
    "place": (lambda path: path, ("place", 1.0)),
    "change": (change, ("change", 1.0)),
    "rate": (lambda path: change(path) * RATE_HZ, ("rate", 0.05)),
    "normalised change": (lambda path: change(path) / 0.02, ("change", 0.02)),
    "normalised place": (lambda path: (path - 0.4) / 2.0, ("place", 2.0)),
}


@pytest.mark.parametrize("form", list(FORMS))
@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1)])
def test_every_form_is_told_behind_any_order_of_columns(form, order):
    path = paths()
    written, (word, gain) = FORMS[form]
    noise = np.random.default_rng(1).normal(0, 1e-4, path.shape)
    observed = np.concatenate([later(path, 1) + noise, paths(9, 2)], axis=1)
    found = read(observed, written(path)[:, order])
    assert found.pairs == dict(enumerate(order))
    assert {item.form for item in found.forms} == {word}
    for item in found.forms:
        assert item.gain == pytest.approx(gain, rel=0.1)
    if form == "normalised place":
        assert [item.offset for item in found.forms] == pytest.approx([0.4] * 3, abs=0.05)


@pytest.mark.parametrize("form", list(FORMS))
def test_right_names_and_none_say_the_same(form):
    written = FORMS[form][0]
    commanded = written(paths())
    observed = later(paths(), 2)
    bare = read(observed, commanded)
    named = read(observed, commanded, named={0: 0, 1: 1, 2: 2})
    assert bare.pairs == named.pairs
    assert named.by_name == {0, 1, 2} and not bare.by_name
    assert bare.forms == named.forms


def test_names_that_contradict_in_a_circle_stand_and_are_said():
    path = paths()
    named = {0: 0, 1: 1, 2: 2}
    for written in (path[:, [1, 0, 2]], change(path)[:, [1, 0, 2]]):
        found = read(later(path, 1), written, named=named)
        assert found.pairs == named
        assert found.contradicted == ((0, 1), (1, 0))


def test_names_that_are_off_by_one_do_not_stand():
    """joint_1 here is joint_0 there: no exchange, but another way of counting."""
    path = paths(width=4)
    found = read(later(path, 1), path[:, :3], named={0: 1, 1: 2, 2: 3})
    assert found.pairs == {0: 0, 1: 1, 2: 2}
    assert not found.contradicted
    assert found.strangers == (0, 1, 2)


def test_a_sign_or_a_unit_under_the_right_name_is_left_to_the_audit():
    path = paths()
    named = {0: 0, 1: 1, 2: 2}
    for factor in (-1.0, 1000.0):
        wrong = path * np.array([1.0, factor, 1.0])
        assert all(item.is_plain for item in read(later(path, 1), wrong, named=named).forms)
        assert read(later(path, 1), wrong).forms[1].gain == pytest.approx(1 / factor, rel=0.1)
    flipped = change(path) * np.array([1.0, -1.0, 1.0])
    assert read(later(path, 1), flipped, named=named).forms[1].gain > 0
    assert read(later(path, 1), flipped).forms[1].gain < 0


@pytest.mark.parametrize("form", ["place", "change"])
def test_a_fault_in_a_quarter_of_the_episodes_is_not_absorbed(form):
    path = paths()
    commanded = FORMS[form][0](path)
    bad = EPISODE % 4 == 1
    commanded[bad] = commanded[bad][:, [1, 0, 2]]
    found = read(later(path, 1), commanded)
    assert found.pairs == {0: 0, 1: 1, 2: 2}
    assert [item.form for item in found.forms] == [form] * 3


def test_two_arms_that_move_as_one_are_assigned_at_once():
    path = paths(width=2)
    jitter = np.random.default_rng(3).normal(0, 2e-4, (2, 400, 2))
    observed = np.concatenate(
        [later(path, 1) + jitter[0], later(path, 1) + 0.5 + jitter[1]], axis=1
    )
    commanded = np.concatenate([path, path + 0.5], axis=1)
    assert read(observed, commanded).pairs == {k: k for k in range(4)}
    assert read(observed[:, [2, 3, 0, 1]], commanded).pairs == {0: 2, 1: 3, 2: 0, 3: 1}
    moved = read(observed, change(commanded), named={0: 2, 1: 3, 2: 0, 3: 1})
    assert moved.pairs == {0: 2, 1: 3, 2: 0, 3: 1}  # a change has no place: names break the tie


def test_a_constant_pairs_with_nothing_and_harms_nobody():
    path = paths()
    held = np.full((400, 1), 0.2)
    noise = np.random.default_rng(4).normal(0, 1e-4, (400, 1))
    observed = np.concatenate([later(path, 1), held + noise], axis=1)
    for named in ({}, {k: k for k in range(4)}):
        found = read(observed, np.concatenate([path, held], axis=1), named=named)
        assert found.pairs == {0: 0, 1: 1, 2: 2}
        assert found.forms[3].is_plain and not found.strangers


def test_a_hand_that_is_told_two_values_is_a_place():
    path = paths()
    closed = (np.tile(np.arange(40), 10) > 20).astype(float)[:, None]
    width = 0.04 - 0.04 * later(np.repeat(closed, 3, axis=1), 3)[:, :1]
    observed = np.concatenate([later(path, 1), width], axis=1)
    found = read(observed, np.concatenate([change(path), 2 * closed - 1], axis=1))
    assert [item.form for item in found.forms] == ["change"] * 3 + ["place"]
    assert 3 not in found.pairs


def test_a_measured_rate_and_an_echo_of_the_command_are_not_what_is_commanded():
    path = paths()
    seen = later(path, 1)
    rate = np.diff(seen, axis=0, prepend=seen[:1]) * RATE_HZ
    rate[np.flatnonzero(np.diff(EPISODE, prepend=-1))] = 0.0
    found = read(np.concatenate([rate, seen], axis=1), change(path) * RATE_HZ)
    assert found.pairs == {0: 3, 1: 4, 2: 5}
    assert {item.form for item in found.forms} == {"rate"}
    told = change(path) / 0.03
    echo = later(told, 1)
    found = read(np.concatenate([echo, seen], axis=1), told)
    assert found.pairs == {0: 3, 1: 4, 2: 5}
    assert {item.form for item in found.forms} == {"change"}


def test_strangers_stay_unknown():
    found = read(paths(1), paths(2))
    assert not found.pairs
    assert {item.form for item in found.forms} == {"unknown"}
    found = read(paths(1), paths(2), named={0: 0, 1: 1, 2: 2})
    assert not found.pairs and found.strangers == (0, 1, 2)


def test_parts_of_a_rotation_pair_with_nothing():
    path = paths()
    assert read(later(path, 1), path, no_partner=(1,)).pairs == {0: 0, 2: 2}


def test_a_handful_of_rows_leaves_names_alone():
    found = read_forms(
        np.zeros((5, 2)), np.zeros((5, 2)), np.zeros(5, dtype=int), named={0: 1}, period_s=0.1
    )
    assert found.pairs == {0: 1} and found.forms[0].is_plain


def test_a_fast_target_is_a_place_although_it_looks_like_a_change():
    turn = np.arange(400)[:, None] * 0.4 + np.arange(3)
    found = read(np.sin(turn), np.sin(turn + np.pi / 2))
    assert {item.form for item in found.forms} == {"place"}


@pytest.mark.parametrize("named", [{}, {0: 3}])
def test_what_is_one_number_in_an_episode_answers_no_command(named):
    # A cue that says which way the first column will go is followed by nothing.
    path = paths()
    cue = np.repeat(np.sign(change(path)[:, 0].reshape(10, 40).sum(axis=1)), 40)
    noise = np.random.default_rng(1).normal(0, 2e-3, path.shape)
    observed = np.column_stack([later(path, 1) + noise, cue])
    for written in (change(path), np.column_stack([0.5 * cue + 0.05 * path[:, 0], path[:, 1:]])):
        found = read(observed, written, named=named)
        assert 3 not in found.pairs.values()
    # But a height that is commanded once in an episode is, also where nothing disturbs it.
    high = np.repeat(np.random.default_rng(2).normal(0, 0.3, 10), 40)
    held = read(np.column_stack([path[:, 1:], high]), np.column_stack([path[:, 1:], high]))
    assert held.pairs == {0: 0, 1: 1, 2: 2}


def test_an_arm_that_is_parked_in_most_episodes_keeps_its_pairs():
    path = paths(width=4)
    parked = np.repeat(np.arange(10) < 6, 40)
    seen, asked = later(path, 1), path.copy()
    seen[parked, 2:], asked[parked, 2:] = 0.0, 0.0
    asked += np.random.default_rng(3).normal(0, 1e-4, asked.shape)
    assert read(seen, asked, named={k: k for k in range(4)}).pairs == {k: k for k in range(4)}


def test_a_flag_that_is_down_in_most_episodes_answers_no_command_but_one_of_two_values():
    """Of the usual episode both are about 0: taken for a place, it froze every file."""
    path = paths()
    up = np.repeat(np.arange(10) % 4 == 0, 40) & np.tile(np.arange(40) < 20, 10)
    flag = up.astype(np.float64)[:, None]
    seen = later(path, 1) + np.random.default_rng(1).normal(0, 1e-3, path.shape)
    observed = np.concatenate([flag, seen], axis=1)
    assert read(observed, change(path)).pairs == {0: 1, 1: 2, 2: 3}
    hand = np.concatenate([change(path), flag], axis=1)
    assert read(np.concatenate([later(flag, 1), seen], axis=1), hand).pairs[3] == 0
