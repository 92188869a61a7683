"""What tells the modes of held-out episodes: planted tellers are found, free choices are not."""

from dataclasses import replace

import numpy as np
import pytest
from planar import LIMITS, SETTINGS, named

from benchmarks.audit.plan import Plan
from benchmarks.audit.planar import admissible
from benchmarks.audit.recorder import record
from gates.cause import CauseName
from genpolicy.audit import predictability
from genpolicy.audit.before import STILL_TOGETHER, Before, seen_before
from genpolicy.audit.choices import Choices, choices
from genpolicy.audit.data import canonical
from genpolicy.audit.guesses import by_value
from genpolicy.audit.history import shortest_gap
from genpolicy.audit.linking import link
from genpolicy.audit.predictability import (
    HISTORY,
    LEAST_EPISODES,
    NOTHING_BEFORE,
    denied_where_known,
    predictions,
)
from genpolicy.audit.resolution import observed_gap
from genpolicy.audit.run import audit
from genpolicy.audit.situations import find_situations
from genpolicy.seeds import stream

EVEN = (0.5, 0.5)
N = 160


def told(plan, seed=0, stride=20, **changes):
    """What everything tells of the modes of a plan, by variable."""
    data = canonical(record("planar", plan).data)
    settings = SETTINGS.model_copy(update={"query_stride": stride, **changes})
    several = [(i, c) for _, i, c in find_situations(data, settings, seed)[0] if c.count > 1]
    members = [(data.episode[item.members], split.labels) for item, split in several]
    links = {"approach": link(members, len(data.episodes), 6)}
    rows = predictions(data, settings, {"approach": several}, links, root_seed=seed)
    return {row.variable: row for row in rows}


def planned(**changes):
    return Plan(3, shares=EVEN, episodes=N, exact=True, start_wide=0.5, **changes)


@pytest.mark.parametrize(
    ("decided_by", "fidelity", "variable", "ideal"),
    [("operator", 0.6, "operator", 0.6), ("object", 0.6, "object", 0.6),
     ("calibration_epoch", 0.6, "calibration_epoch", 0.6), ("habit", 0.7, "previous_episodes", 0.7),
     ("drift", 0.8, "episode_order", 0.4), ("session", 0.9, "recording_sequence", 0.7),
     ("alternation", 0.6, "every_other_episode", 0.6)],
)  # fmt: skip
def test_a_planted_teller_tells_as_much_as_it_was_made_to(decided_by, fidelity, variable, ideal):
    found = told(planned(decided_by=decided_by, fidelity=fidelity))
    row = found[variable]
    assert row.told_lower - 0.1 <= ideal <= row.told_upper + 0.1
    assert row.told_lower > 0.1
    assert row.told >= max(r.told for r in found.values()) - 0.15


def test_each_end_of_the_interval_is_a_bound_at_the_confidence_of_the_settings():
    plan = planned(decided_by="operator", fidelity=0.6)
    usual, loose = (told(plan, confidence=share)["operator"] for share in (0.95, 0.7))
    assert usual.told == loose.told
    assert usual.told_lower < loose.told_lower < loose.told < loose.told_upper < usual.told_upper


def test_where_an_episode_came_from_tells_where_it_goes():
    found = told(planned(decided_by="path_early"), stride=6)[HISTORY]
    assert found.told_lower > 0.4


def test_a_lamp_that_has_gone_out_tells_though_it_shows_one_of_two_values():
    # As a deviation from the median of a situation it told -.12 to .10 of the mode, and whoever
    # obeyed it three times of five was said to choose freely.
    often, always = (
        told(planned(decided_by="lamp_early", fidelity=share), stride=6)[HISTORY]
        for share in (0.6, 0.95)
    )
    assert often.told >= 0.25 and often.told_upper > 0.4
    assert always.told_lower > 0.5


@pytest.mark.parametrize(
    "plan",
    [planned(), planned(correlation=0.9), replace(planned(), shares=(0.75, 0.25)),
     planned(goal_half_width_m=0.01)],
    ids=["free", "strata that go together", "uneven", "goals apart"],
)  # fmt: skip
def test_a_free_choice_is_told_by_nothing(plan):
    for row in told(plan).values():
        assert row.told_lower <= 0.0 + 1e-9 or row.told < 0.2, row
        assert row.told_upper <= 0.4, row


def test_what_only_a_combination_tells_is_told_by_everything_together():
    # Whoever takes this object and that one goes left: neither of the two tells it alone.
    data = canonical(record("planar", planned()).data)
    rng = stream(8, "pair")
    settings = SETTINGS.model_copy(update={"query_stride": 20})
    several = [(i, c) for _, i, c in find_situations(data, settings, 0)[0] if c.count > 1]
    links = link([(data.episode[i.members], c.labels) for i, c in several], N, 6)
    first = rng.integers(0, 2, N)
    table = replace(
        data.episodes,
        operator=np.where(first, "amber", "birch"),
        object=np.where(first ^ (links == 1), "peg_a", "peg_b"),
    )
    rows = predictions(
        replace(data, episodes=table), settings, {"approach": several}, {"approach": links},
        root_seed=0,
    )  # fmt: skip
    found = {row.variable: row for row in rows}
    assert found["everything_together"].told_lower > 0.7
    assert max(found["operator"].told, found["object"].told) < 0.4


def test_a_choice_at_the_start_has_no_past_that_could_tell_and_that_is_an_answer():
    data = canonical(record("planar", planned()).data)
    settings = SETTINGS.model_copy(update={"query_stride": 4})
    several = [(i, c) for _, i, c in find_situations(data, settings, 0)[0] if c.count > 1]
    links = {"approach": link([(data.episode[i.members], c.labels) for i, c in several], N, 6)}
    gap = shortest_gap(settings)
    early, late = [], []
    for item, split in several:
        steps = item.members - data.first_row[item.members]
        (early if np.all(steps < gap) else late).append((item, split))

    def history(items):
        rows = predictions(data, settings, {"approach": items}, links, root_seed=0)
        return [row for row in rows if row.variable == HISTORY]

    (row,) = history(early)
    assert (row.told, row.told_upper) == (0.0, 0.0) and row.detail == NOTHING_BEFORE
    assert row.n >= LEAST_EPISODES
    # Later the clusters have moved apart: the past was there, and could not be held to them.
    assert all(observed_gap(data, settings, *item) >= STILL_TOGETHER for item in late)
    assert history(late) == []


def test_too_few_episodes_decide_nothing():
    plan = replace(planned(decided_by="object"), episodes=LEAST_EPISODES + 4)
    data = canonical(record("planar", plan).data)
    settings = SETTINGS.model_copy(update={"query_stride": 12})
    several = [(i, c) for _, i, c in find_situations(data, settings, 0)[0] if c.count > 1]
    few = np.where(np.arange(len(data.episodes)) < 12, np.arange(len(data.episodes)) % 2, -1)
    rows = predictions(data, settings, {"approach": several}, {"approach": few}, root_seed=0)
    for row in rows:
        assert row.told_upper == 1.0 and row.told_lower < 0.0


# What the audit said of these before what is told was judged: valid modes, each time.
@pytest.mark.parametrize(
    ("decided_by", "fidelity", "names"),
    [("object", 0.6, {"object"}), ("habit", 0.7, {"previous_episodes", "unrecorded"}),
     ("drift", 0.8, {"episode_order", "calibration_epoch", "everything_together"}),
     ("operator", 0.6, {"operator", "recording_sequence", "everything_together"}),
     ("session", 0.6, {"recording_sequence"})],
)  # fmt: skip
def test_four_right_of_five_are_no_valid_modes(decided_by, fidelity, names):
    plan = planned(decided_by=decided_by, fidelity=fidelity, goal_half_width_m=0.004)
    labelled = record("planar", plan)
    result = audit(
        labelled.data, SETTINGS, admissible=admissible(plan),
        replay=labelled.outcomes.__getitem__, root_seed=3,
    )  # fmt: skip
    cause = named(result, limits=LIMITS)
    assert cause.name is not CauseName.VALID_MODES
    assert cause.variable in names


def test_a_few_episodes_with_a_past_are_no_proof_that_there_was_none(monkeypatch):
    data = canonical(record("planar", planned()).data)
    settings = SETTINGS.model_copy(update={"query_stride": 4})
    several = [(i, c) for _, i, c in find_situations(data, settings, 0)[0] if c.count > 1]
    links = {"approach": link([(data.episode[i.members], c.labels) for i, c in several], N, 6)}
    nothing = seen_before(data, settings, [], choices(data, several, links["approach"]))
    for reached, rows in ((0, 1), (1, 0), (LEAST_EPISODES - 1, 0)):
        seen = replace(nothing, reached=reached)
        monkeypatch.setattr(predictability, "seen_before", lambda *_, seen=seen: seen)
        found = predictions(data, settings, {"approach": several}, links, root_seed=0)
        assert len([row for row in found if row.variable == HISTORY]) == rows


def test_a_past_that_by_itself_may_tell_too_much_is_not_denied_for_what_is_seen_now():
    """Where the ways have begun to part, the present knows the choice by its consequence."""
    n, rng = 120, np.random.default_rng(3)
    mode = np.arange(n) % 2
    even = Choices(np.arange(n), mode, np.full((n, 2), 0.5))
    parted = np.where(rng.random(n) < 0.75, mode, 1 - mode) - 0.5
    cue = np.where(rng.random(n) < 0.7, mode, 1 - mode) - 0.5

    def told(past, present):
        seen = Before(even, past[:, None], present[:, None], n)
        return predictability._past("approach", seen, np.random.default_rng(0), 0.95)

    nothing = rng.random(n) - 0.5
    alone, both = told(cue, nothing), told(cue, parted)
    assert alone.told_lower < 0.4 < alone.told_upper  # seven of ten, astride the limit
    assert both.told_lower < 0.0 < both.told_upper  # beyond the present nothing is proved, and
    assert both.told_upper > 0.4  # nothing is denied
    assert told(nothing, nothing).told_upper < 0.4 and told(nothing, parted).told_upper < 0.4


def habit(seed, fidelity, n, *, unknown):
    """Modes of episodes that do as the one before, or as chance says; -1 where nobody can tell."""
    rng = np.random.default_rng([9, seed])
    modes = rng.integers(0, 2, n)
    for at in range(1, n):
        modes[at] = modes[at - 1] if rng.random() < fidelity else modes[at]
    return np.where(rng.random(n) < unknown, -1, modes)


def of_all(links):
    """Who chose, and what the two episodes before tell, whether or not their modes are known."""
    chose = np.flatnonzero(links >= 0)
    share = np.bincount(links[chose], minlength=2) / len(chose)
    chosen = Choices(chose, links[chose], np.tile(share, (len(chose), 1)))
    order, one = np.arange(len(links)), np.zeros(len(links), dtype=np.int64)
    rng = np.random.default_rng(1)
    guess = by_value(predictability._before(links, order, one)[chose])
    hits = predictability._hits(chosen, guess, rng, repeats=5)
    row = predictability._row("previous_episodes", "approach", chosen, hits, 0.95)
    return row, chosen, predictability._just_before(links, order, one)[chose], rng


@pytest.mark.parametrize(("n", "unknown"), [(150, 0.25), (150, 0.5), (80, 0.25)])
def test_a_habit_at_the_limit_is_denied_no_more_often_than_the_confidence_says(n, unknown):
    # A guess at an episode whose predecessor nobody could read is worth nothing, and counted as
    # proof: a habit that tells exactly .4 was surely below .4 in 28 to 62 of a hundred.
    before, after = [], []
    for seed in range(100):
        row, chosen, told_by, rng = of_all(habit(seed, 0.4, n, unknown=unknown))
        before.append(row.told_upper <= 0.4)
        after.append(denied_where_known(row, chosen, told_by, rng, 0.95).told_upper <= 0.4)
    assert sum(before) > 20 and sum(after) <= 10


def test_where_every_mode_is_known_a_free_choice_is_still_told_by_no_habit():
    denied = 0
    for seed in range(50):
        row, chosen, told_by, rng = of_all(habit(seed, 0.0, 150, unknown=0.0))
        denied += denied_where_known(row, chosen, told_by, rng, 0.95).told_upper <= 0.4
    assert denied >= 45


def test_nothing_is_denied_where_no_mode_is_known_of_what_would_tell():
    data = canonical(record("planar", planned()).data)
    settings = SETTINGS.model_copy(update={"query_stride": 20})
    several = [(i, c) for _, i, c in find_situations(data, settings, 0)[0] if c.count > 1]
    early = data.index < np.median(data.index)
    data = replace(data, phase=np.where(early, "begin", "approach"))
    modes, place = np.random.default_rng(4).integers(0, 2, N), np.arange(N)
    links = {
        "approach": np.where(place % 2 == 0, modes, -1),  # nobody just before can be read
        "begin": np.where(place < LEAST_EPISODES, modes[::-1], -1),
    }
    rows = predictions(data, settings, {"approach": several}, links, root_seed=0)
    upper = {row.variable: row.told_upper for row in rows}
    assert upper["previous_episodes"] == 1.0 and upper["mode_of_begin"] == 1.0
    assert upper["object"] < 0.4
