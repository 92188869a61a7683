"""Votes and what is made of them: weights by hand, rotations, order, prefix, and who has none."""

from dataclasses import replace

import numpy as np
import pytest

from genpolicy.candidates.joining import JoiningSettings
from genpolicy.candidates.votes import (
    VOTE_CHECKS,
    Now,
    Past,
    Prediction,
    Votes,
    blend,
    nearest_first,
    prefix,
    rest_of_plan,
)
from genpolicy.contract.action import join_action, split_action
from genpolicy.contract.chunk import Candidate, ChunkMetadata
from genpolicy.errors import ConfigError

PERIOD_S, ROWS, HORIZON = 0.05, 16, 8
DOWN = np.diag([1.0, -1.0, -1.0])


def metadata(number=0, *, start=0, **changes):
    """Of a chunk that begins `start` periods after the clock's zero."""
    own = ChunkMetadata(
        chunk_id=f"s/{number}", condition_observation_event_time_s=start * PERIOD_S,
        policy_checkpoint_hash="w" * 64, sampler_config_hash="s" * 64,
        action_start_time_s=start * PERIOD_S, action_period_s=PERIOD_S,
        valid_until_s=(start + HORIZON) * PERIOD_S, task_phase="approach",
        calibration_epoch="epoch_1", predecessor_chunk_id=f"s/{number - 1}" if number else "",
        session_epoch=0, method="flow", candidate_index=0,
    )  # fmt: skip
    return replace(own, **changes)


def chunk(x_m, *, rotation=DOWN, rows=ROWS):
    position = np.zeros((rows, 3))
    position[:, 0] = x_m
    return join_action(position, np.broadcast_to(rotation, (rows, 3, 3)), 0.01)


def prediction(number, *, start, x_m=0.0, **changes):
    actions = chunk(x_m)
    return Prediction(f"s/{number}", metadata(number, start=start, **changes), actions, actions)


def now(number, *, start, age_s=10.0, **changes):
    return Now(metadata(number, start=start, **changes), HORIZON, round(age_s * 1e9))


def remembered(*predictions, checks=VOTE_CHECKS):
    past = Past(checks)
    for one in predictions:
        past.note(one)
    return past


TWO = (prediction(0, start=0, x_m=1.0), prediction(1, start=3, x_m=2.0))


def spans(votes):
    return [(vote.before.invocation, vote.first, vote.stop, vote.shift) for vote in votes]


def test_each_votes_on_the_rows_that_its_own_horizon_reaches():
    votes = remembered(*TWO).votes(now(2, start=5), first=1)
    # Rows of the new chunk: row 1 is row 6 of the oldest, whose last is 7; row 3 of the newer.
    assert spans(votes) == [("s/0", 1, 3, 5), ("s/1", 1, 6, 2)]
    assert spans(remembered(*TWO).votes(now(2, start=5), first=4)) == [("s/1", 4, 6, 2)]
    assert remembered(*TWO).votes(now(2, start=5), first=6) == []
    assert remembered().votes(now(2, start=5), first=0) == []


WITHOUT_A_VOTE = {
    "chain": (TWO, {"predecessor_chunk_id": ""}),
    "horizon": ([prediction(0, start=0, valid_until_s=99.0)], {"start": 9}),
    "valid": ([prediction(0, start=0, valid_until_s=0.05)], {"start": 5}),
    "age": ([prediction(0, start=0)], {"start": 5, "age_s": 0.2}),
}


@pytest.mark.parametrize("name", [check.name for check in VOTE_CHECKS])
def test_who_breaks_one_check_has_no_vote_and_had_one_without_it(name):
    """Each row of the table alone keeps out its own case; the list of cases is complete."""
    assert set(WITHOUT_A_VOTE) == {check.name for check in VOTE_CHECKS}
    before, changes = WITHOUT_A_VOTE[name]
    asked = now(len(before), **{"start": 5, **changes})
    assert remembered(*before).votes(asked, first=0) == []
    others = tuple(check for check in VOTE_CHECKS if check.name != name)
    assert remembered(*before, checks=others).votes(asked, first=0) != []


def test_a_chain_that_broke_in_between_ends_the_say_of_what_lies_before():
    replanned = prediction(1, start=3, predecessor_chunk_id="")
    votes = remembered(TWO[0], replanned).votes(now(2, start=5), first=1)
    assert [vote.before.invocation for vote in votes] == ["s/1"]


def test_a_chunk_between_the_periods_of_the_new_one_has_no_vote():
    half = prediction(0, start=0, action_start_time_s=0.5 * PERIOD_S)
    assert remembered(half).votes(now(1, start=5), first=0) == []


@pytest.mark.parametrize(
    ("rule", "expected", "two"),
    [("ensemble_oldest", (1.0 + 2.0 / 2 + 4.0 / 4) / 1.75, (2.0 + 4.0 / 2) / 1.5),
     ("ensemble_newest", (1.0 / 4 + 2.0 / 2 + 4.0) / 1.75, (2.0 / 2 + 4.0) / 1.5),
     ("running_average", 0.3 * (0.3 * 1.0 + 0.7 * 2.0) + 0.7 * 4.0, 0.3 * 2.0 + 0.7 * 4.0)],
)  # fmt: skip
def test_weights_by_hand(rule, expected, two):
    """Halved from one prediction to the next, 4, 2, 1 parts of seven from the first in line; or
    seven tenths of each blended into what was there."""
    joining = JoiningSettings(rule=rule, decay=float(np.log(2.0)))
    votes = remembered(*TWO).votes(now(2, start=5), first=1)
    mixed = blend(Candidate(metadata(2, start=5), chunk(4.0)), votes, joining)
    assert mixed.actions[1:3, 0] == pytest.approx(expected)
    assert mixed.actions[3:6, 0] == pytest.approx(two)
    assert np.array_equal(mixed.actions[[0, *range(6, 16)]], chunk(4.0)[[0, *range(6, 16)]])
    assert mixed.metadata == replace(metadata(2, start=5), chunk_id="s/2/blend")


def turned(angle):
    c, s = np.cos(angle), np.sin(angle)
    return DOWN @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def mixed_rotation(first, second):
    before = Prediction("s/0", metadata(0), chunk(0.0, rotation=first), chunk(0.0))
    mixed = blend(
        Candidate(metadata(1, start=0), chunk(0.0, rotation=second)),
        [Votes(before, 0, ROWS, 0)],
        JoiningSettings(rule="ensemble_oldest", decay=0.0),
    )
    return mixed.actions


def test_rotations_meet_half_way_and_stay_rotations():
    _, rotation, _ = split_action(mixed_rotation(turned(0.4), turned(-0.2)))
    np.testing.assert_allclose(rotation, np.broadcast_to(turned(0.1), (ROWS, 3, 3)), atol=1e-12)


def test_opposite_rotations_have_no_mean_and_are_left_to_the_first_layer():
    actions = mixed_rotation(turned(0.0), turned(np.pi))
    assert np.isnan(actions[:, 3:9]).all() and np.isfinite(actions[:, :3]).all()


@pytest.mark.parametrize("actions", [np.zeros((0, 0)), np.zeros((3, 4)), np.full((16, 10), np.nan)])
def test_what_is_no_chunk_is_not_made_one(actions):
    votes = remembered(*TWO).votes(now(2, start=5), first=1)
    mixed = blend(Candidate(metadata(2), actions), votes, JoiningSettings())
    assert np.array_equal(mixed.actions, actions, equal_nan=True)


def test_the_nearest_to_the_plan_is_tried_first_and_equal_ones_as_drawn():
    votes = remembered(*TWO).votes(now(2, start=5), first=1)
    drawn = [
        Candidate(metadata(2, start=5), actions)
        for actions in (chunk(np.nan), chunk(1.0), chunk(3.0), chunk(2.5), np.zeros((0, 0)))
    ]
    # 1 m away on either side of 2 m, by the newest plan; half a metre; no distance at all.
    assert nearest_first(drawn, votes, JoiningSettings()) == [3, 1, 2, 0, 4]
    assert nearest_first(drawn, [], JoiningSettings()) == [0, 1, 2, 3, 4]


def test_a_turn_counts_as_a_way():
    votes = remembered(TWO[1]).votes(now(2, start=5), first=1)
    drawn = [
        Candidate(metadata(2, start=5), actions)
        for actions in (chunk(2.0, rotation=turned(1.0)), chunk(2.01))
    ]
    assert nearest_first(drawn, votes, JoiningSettings()) == [1, 0]


def test_the_prefix_is_frozen_where_it_will_be_executed_and_fades_behind():
    votes = remembered(*TWO).votes(now(2, start=5), first=0)
    actions, weights = prefix(votes, rows=ROWS, frozen=3)
    assert actions[:6, 0] == pytest.approx(2.0) and not actions[6:].any()
    c = np.array([0.75, 0.5, 0.25])
    assert weights == pytest.approx([1, 1, 1, *(c * np.expm1(c) / np.expm1(1.0)), *[0.0] * 10])
    assert not prefix([], rows=ROWS, frozen=3)[1].any()


# -- the setting ----------------------------------------------------------------------------------


def test_a_hash_of_the_sampler_tells_rules_apart_and_replacing_changes_none():
    rules = (
        "ensemble_oldest", "ensemble_newest", "running_average", "bidirectional", "real_time",
        "warm_start",
    )  # fmt: skip
    found = {JoiningSettings(rule=rule).sampler_hash("own") for rule in rules}
    assert JoiningSettings().sampler_hash("own") == "own" and len(found | {"own"}) == 7
    sharper = JoiningSettings(rule="ensemble_oldest", decay=0.5).sampler_hash("own")
    assert sharper not in found
    quicker = JoiningSettings(rule="running_average", newest=0.5).sampler_hash("own")
    assert quicker not in found
    warmer = JoiningSettings(rule="warm_start", strength=0.25).sampler_hash("own")
    assert warmer not in found
    # What a rule does not read is not in its identity.
    assert JoiningSettings(rule="real_time", decay=0.5).sampler_hash("own") in found


def test_a_method_without_a_path_is_named_or_refused():
    joining = JoiningSettings(rule="real_time", exempt=["chunked_bc"])
    assert joining.of("flow", guided=True) is joining
    assert joining.of("chunked_bc", guided=False).rule == "replace"
    with pytest.raises(ConfigError, match=r"and act is .*not named"):
        joining.of("act", guided=False)
    with pytest.raises(ConfigError, match=r"and chunked_bc is .*can be guided"):
        joining.of("chunked_bc", guided=True)
    other = JoiningSettings(rule="bidirectional")
    assert other.of("act", guided=False) is other
    assert (joining.named("chunked_bc").rule, joining.named("flow").rule) == (
        "replace",
        "real_time",
    )


def test_a_method_without_a_path_to_start_on_is_named_or_refused():
    joining = JoiningSettings(rule="warm_start", exempt=["chunked_bc"])
    assert joining.of("chunked_bc", guided=False).rule == "replace"
    assert joining.of("flow", guided=True).starts_at == 0.5
    assert JoiningSettings(rule="real_time").starts_at is None
    with pytest.raises(ConfigError, match=r"act has no path|and act is .*no path.*to start on"):
        joining.of("act", guided=False)
    with pytest.raises(ConfigError, match=r"can be started on, named.*`warm_start`"):
        joining.of("chunked_bc", guided=True)


def test_a_start_is_all_that_is_left_of_the_newest_plan_and_then_its_last_row():
    older, newer = prediction(0, start=0, x_m=-1.0), prediction(1, start=1)
    newer.commanded[:, 0] = np.arange(ROWS)
    votes = [Votes(older, 0, 2, 6), Votes(newer, 0, 3, 5)]
    actions, weights = rest_of_plan(votes, rows=ROWS)
    assert actions[:, 0].tolist() == [*range(5, ROWS), *[ROWS - 1.0] * 5]
    assert (weights == 1.0).all()
    actions, weights = rest_of_plan([], rows=ROWS)
    assert not actions.any() and not weights.any()


def test_the_rule_is_said_with_what_it_reads():
    assert JoiningSettings().said() == "first_admissible"
    assert JoiningSettings(rule="real_time").said() == (
        "first_admissible; joined by real_time, guidance 5"
    )
    assert JoiningSettings(rule="warm_start").said().endswith("warm_start, strength 0.5")
