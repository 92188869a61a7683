"""Who had a say in a chunk follows from the journal, and what they said from their samples."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from genpolicy.candidates.joining import JoiningSettings
from genpolicy.candidates.votes import Votes, blend, nearest_first, prefix
from genpolicy.contract.rotation import rotation_to_6d
from genpolicy.verification.rejoined import (
    Made,
    Rejoined,
    Said,
    goes_on_from,
    mean_of,
    ways_to_plan,
)

ROWS = 16
STRAIGHT = np.array([1.0, 0.0, 0.0, 0.0, 1.0, 0.0])
HALVED, STEEP = {"decay": math.log(2.0), "newest": 0.7}, {"decay": 50.0, "newest": 0.7}
OPENED = {"execution_horizon": 8, "maximum_age_ns": {"approach": 90}, "replan_lead_rows": 3}


def samples(count, seed=0):
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=(count, ROWS, 10))
    turns, _ = np.linalg.qr(rng.normal(size=(count, ROWS, 3, 3)) * 0.2 + np.eye(3))
    rows[..., 3:9] = rotation_to_6d(turns * np.sign(np.einsum("...ii->...i", turns))[..., None, :])
    return rows


def made_of(rule, *said, turn=0, draw=0, lead=3):
    return Made(rule=rule, turn=turn, draw=draw, said=said, lead=lead)


def said_by(name, first, stop, shift, sample):
    return Said(name, 0, first, stop, shift, sample[first + shift : stop + shift],
                sample[first + shift :])  # fmt: skip


def test_the_weights_of_a_mean_by_hand():
    """Rows 2 and 3 of two earlier ones at 0 and 1 and the own at 2: half as much, one after the
    other."""
    parts = [np.full((ROWS, 10), float(place)) for place in range(3)]
    for part in parts:
        part[:, 3:9] = STRAIGHT
    oldest, newest, own = parts
    said = said_by("a", 2, 3, 8, oldest), said_by("b", 2, 4, 4, newest)
    earlier = {"a": oldest, "b": newest}
    by_age = mean_of(made_of("ensemble_oldest", *said), own, earlier, **HALVED)
    np.testing.assert_allclose(by_age[2, :3], (0 * 4 + 1 * 2 + 2 * 1) / 7)
    np.testing.assert_allclose(by_age[3, :3], (1 * 2 + 2 * 1) / 3)
    by_youth = mean_of(made_of("ensemble_newest", *said), own, earlier, **HALVED)
    np.testing.assert_allclose(by_youth[2, :3], (0 * 1 + 1 * 2 + 2 * 4) / 7)
    np.testing.assert_allclose(by_youth[3, :3], (1 * 1 + 2 * 2) / 3)
    running = mean_of(made_of("running_average", *said), own, earlier, **HALVED)
    np.testing.assert_allclose(running[2, :3], 0.3 * (0.3 * 0 + 0.7 * 1) + 0.7 * 2)
    np.testing.assert_allclose(running[3, :3], 0.3 * 1 + 0.7 * 2)
    for blended in (by_age, by_youth, running):
        np.testing.assert_array_equal(np.delete(blended, (2, 3), axis=0), own[:14])
        np.testing.assert_allclose(blended[2:4, 3:9], [STRAIGHT, STRAIGHT])


def test_the_row_of_an_earlier_sample_is_the_one_that_is_due_then():
    own, before = samples(2)
    blended = mean_of(
        made_of("ensemble_newest", said_by("a", 1, 3, 5, before)), own, {"a": before}, **STEEP
    )
    np.testing.assert_allclose(blended, own, atol=1e-9)
    blended = mean_of(
        made_of("ensemble_oldest", said_by("a", 1, 3, 5, before)), own, {"a": before}, **STEEP
    )
    np.testing.assert_allclose(blended[1:3], before[6:8], atol=1e-9)


def voted(name, first, stop, shift, sample):
    return Votes(
        SimpleNamespace(invocation=name, drawn=sample, commanded=sample), first, stop, shift
    )


@pytest.mark.parametrize(
    "rule", ["ensemble_oldest", "ensemble_newest", "running_average", "bidirectional"]
)
@pytest.mark.parametrize("seed", range(20))
def test_two_programs_agree(rule, seed):
    """The blend and the choice of the product, and the weights of what a chunk goes on from."""
    oldest, newest, *drawn = samples(6, seed)
    rows = [("a", 1, 3, 8, oldest), ("b", 1, 6, 4, newest)]
    joining = JoiningSettings(rule=rule, decay=0.05 * seed, newest=(seed + 1) / 22)
    votes = [voted(*row) for row in rows]
    candidates = [SimpleNamespace(metadata=METADATA, actions=sample) for sample in drawn]
    said = tuple(said_by(*row) for row in rows)
    if rule == "bidirectional":
        ways_m = ways_to_plan(made_of(rule, said[1]), np.stack(drawn), joining.decay)
        assert np.argsort(ways_m).tolist() == nearest_first(candidates, votes, joining)
        actions, weights = prefix([voted("b", 0, 6, 4, newest)], rows=ROWS, frozen=seed % 8)
        own = goes_on_from(made_of(rule, said_by("b", 0, 6, 4, newest), lead=seed % 8), ROWS)
        np.testing.assert_array_equal(own[0], actions)
        np.testing.assert_allclose(own[1], weights, rtol=1e-14)
    else:
        told = blend(candidates[0], votes, joining).actions
        earlier = {"a": oldest, "b": newest}
        weights = {"decay": joining.decay, "newest": joining.newest}
        own = mean_of(made_of(rule, *said), drawn[0], earlier, **weights)
        np.testing.assert_allclose(own, told, atol=1e-12)


METADATA = SimpleNamespace()


@pytest.fixture(autouse=True)
def _named(monkeypatch):
    """Only the numbers of a blend are asked here."""
    monkeypatch.setattr("genpolicy.candidates.votes._renamed", lambda metadata: metadata)
    monkeypatch.setattr("genpolicy.candidates.votes.Proposal", SimpleNamespace)


def test_the_weights_of_a_prefix_by_hand():
    (plan,) = samples(1)
    actions, weights = goes_on_from(made_of("real_time", said_by("a", 0, 5, 5, plan)), ROWS)
    np.testing.assert_array_equal(actions[:5], plan[5:10])
    assert not actions[5:].any() and not weights[5:].any()
    falling = [c * math.expm1(c) / math.expm1(1.0) for c in (2 / 3, 1 / 3)]
    np.testing.assert_allclose(weights[:5], [1.0, 1.0, 1.0, *falling])
    actions, weights = goes_on_from(made_of("real_time"), ROWS)
    assert not actions.any() and not weights.any()


def test_what_was_started_from_is_all_that_is_left_and_then_its_last_row():
    (plan,) = samples(1)
    actions, weights = goes_on_from(made_of("warm_start", said_by("a", 0, 3, 5, plan)), ROWS)
    np.testing.assert_array_equal(actions[:11], plan[5:])
    np.testing.assert_array_equal(actions[11:], np.repeat(plan[-1:], 5, axis=0))
    assert (weights == 1.0).all()
    actions, weights = goes_on_from(made_of("warm_start"), ROWS)
    assert not actions.any() and not weights.any()


def test_a_turn_counts_by_an_arm_of_a_tenth_of_a_metre_and_no_number_is_furthest():
    (plan,) = samples(1)
    drawn = np.stack([plan, plan, plan, plan])
    drawn[1, 2, 0] += 0.3
    drawn[2, 3, 4] += 0.3
    drawn[3, 2, 0] = math.nan
    said = Said("a", 0, 2, 4, 0, plan[2:4], plan[2:])
    ways_m = ways_to_plan(made_of("bidirectional", said), drawn, 2.0)
    np.testing.assert_allclose(ways_m, [0.0, 0.3, 0.03 * math.exp(-1.0), math.inf])


def chunk(name, start, *, before="", **changes):
    return {
        "chunk_id": name, "start_ns": start, "period_ns": 10, "condition_ns": start, "rows": ROWS,
        "valid_until_ns": start + 80, "predecessor": before, "phase": "approach",
        "actions": "00" * 80 * ROWS,
    } | changes  # fmt: skip


def entered(rejoined, told, *, rule="ensemble_oldest", now=None, parents=None, index=0, draw=None):
    """One chunk from its begin to the queue; what is objected to."""
    name, now = told["chunk_id"], told["start_ns"] + 10 if now is None else now
    rejoined.begin({"id": name, "exposed_ns": told["start_ns"]})
    own = {
        "chunk_id": name, "invocation": name, "rule": rule, "t": now, "parents": parents or {},
        "draw": index if draw is None else draw,
    }  # fmt: skip
    found = [*rejoined.join(own), *rejoined.judge({"chunk_id": name, "index": index})]
    return [*found, *rejoined.enter(told)]


@pytest.fixture
def session():
    """Two chunks of one chain, four rows apart; the first has a say in the second."""
    rejoined = Rejoined(OPENED)
    assert not entered(rejoined, chunk("a", 0))
    assert not entered(rejoined, chunk("b", 40, before="a"), parents={"a": [1, 4]})
    return rejoined


@pytest.mark.parametrize(("changes", "due"), [
    ({}, {"b": [1, 4]}),
    ({"predecessor": "a"}, {}),
    ({"predecessor": ""}, {}),
    ({"start_ns": 60}, {"a": [1, 2], "b": [1, 6]}),
    ({"start_ns": 65}, {}),
])  # fmt: skip
def test_who_has_a_say_follows_from_chain_and_times(session, changes, due):
    told = chunk("c", 80, before="b") | changes
    stated = {"a": [0, 1]}
    (found,) = entered(session, told, parents=stated)
    assert found == f"'c' rests on {stated}, required {due} by its journal"


@pytest.mark.parametrize(("name", "changes", "due"), [
    ("horizon", {}, [1, 4]),
    ("valid", {"valid_until_ns": 60}, [1, 3]),
    ("age", {"condition_ns": -30}, [1, 3]),
    ("rows", {"rows": 6}, [1, 2]),
])  # fmt: skip
def test_a_say_ends_where_the_earlier_chunk_could_not_be_executed(name, changes, due):
    rejoined = Rejoined(OPENED)
    entered(rejoined, chunk("a", 0, **changes))
    told = chunk("b", 40, before="a")
    assert name and not entered(rejoined, told, parents={"a": due})


def test_a_chunk_of_another_pace_has_no_say():
    rejoined = Rejoined(OPENED)
    entered(rejoined, chunk("a", 0, period_ns=20))
    assert not entered(rejoined, chunk("b", 40, before="a"), now=60, parents={})


def test_what_came_after_the_question_has_no_say(session):
    """Real-time chunks go on from the plan of when they were begun, nearest from their first."""
    session.begin({"id": "d", "exposed_ns": 60})
    assert not entered(session, chunk("c", 60, before="b"), parents={"a": [1, 2], "b": [1, 6]})
    own = {"chunk_id": "d", "invocation": "d", "rule": "real_time", "t": 90, "draw": 0,
           "parents": {"b": [0, 6]}}  # fmt: skip
    assert not [*session.join(own), *session.judge({"chunk_id": "d", "index": 0})]
    assert not list(session.enter(chunk("d", 60, before="b")))


def test_a_plan_that_came_after_the_invocation_began_is_none_to_go_on_from(session):
    """Whatever predecessor it names."""
    session.begin({"id": "d", "exposed_ns": 60})
    assert not entered(session, chunk("c", 60, before="b"), parents={"a": [1, 2], "b": [1, 6]})
    own = {"chunk_id": "d", "invocation": "d", "rule": "real_time", "t": 90, "draw": 0,
           "parents": {"c": [0, 8]}}  # fmt: skip
    assert not [*session.join(own), *session.judge({"chunk_id": "d", "index": 0})]
    (found,) = session.enter(chunk("d", 60, before="c"))
    assert found == "'d' rests on {'c': [0, 8]}, required {} by its journal"


def test_the_candidates_of_an_invocation_rest_on_one_plan(session):
    own = {"chunk_id": "c", "invocation": "c", "rule": "bidirectional", "t": 70, "draw": 1,
           "parents": {"b": [1, 6]}}  # fmt: skip
    session.begin({"id": "c", "exposed_ns": 60})
    assert not [*session.join(own), *session.judge({"chunk_id": "c", "index": 0})]
    later = own | {"t": 80, "parents": {"b": [2, 6]}}
    assert [*session.join(later)] == [
        "'c' rests on {'b': [2, 6]}, and its first candidate on another plan"
    ]
    # A later candidate still rests on the plan of the first one's moment.
    again = own | {"t": 80, "draw": 0}
    assert not [*session.join(again), *session.judge({"chunk_id": "c", "index": 1})]
    assert not list(session.enter(chunk("c", 60, before="b")))


def test_nobody_chooses_a_sample_without_a_plan(session):
    (found,) = entered(session, chunk("c", 400), draw=1)
    assert found == "candidate 0 of 'c' is sample 1, and nothing chose"


def test_a_chunk_starts_where_what_it_saw_was_exposed(session):
    session.begin({"id": "c", "exposed_ns": 90})
    own = {"chunk_id": "c", "invocation": "c", "rule": "real_time", "t": 110, "draw": 0,
           "parents": {}}  # fmt: skip
    assert not [*session.join(own), *session.judge({"chunk_id": "c", "index": 0})]
    (found,) = session.enter(chunk("c", 400))
    assert found == "'c' starts at 400 ns, and saw what was at 90 ns"


def test_what_is_stated_is_read_in_the_order_in_which_it_entered(session):
    told = chunk("c", 60, before="b")
    stated = {"b": [1, 6], "a": [1, 2]}
    assert not entered(session, told, parents=stated)
    own = {"invocation": "c", "rule": "ensemble_newest", "draw": 0, "parents": stated}
    made = session.made({"index": 0}, own)
    assert [(one.invocation, one.first, one.stop, one.shift) for one in made.said] == [
        ("a", 1, 2, 6), ("b", 1, 6, 2),
    ]  # fmt: skip
    assert made.blended and not made.guided and not made.chosen
    assert replace(made, rule="warm_start").guided
    assert replace(made, rule="real_time").guided and replace(made, rule="bidirectional").chosen


@pytest.mark.parametrize("rows", [[1, 15], [-8, 2], [1, -3]])
def test_rows_that_are_not_there_cannot_be_read(session, rows):
    assert not entered(session, chunk("c", 60, before="b"), parents={"a": [1, 2], "b": [1, 6]})
    own = {"invocation": "c", "rule": "real_time", "draw": 0, "parents": {"b": rows}}
    with pytest.raises(ValueError, match="rows"):
        session.made({"index": 0}, own)
