"""A film: what stood where when, by the events of a journal."""

import numpy as np
import pytest
from replayed import SESSION

from genpolicy.contract.action import GRIPPER, POSITION
from genpolicy.execution.journal import Event, decode_actions, encode_actions, read_journal
from genpolicy.replay.film import PERIOD_S, film_of


@pytest.fixture(scope="session")
def events(journal):
    return read_journal(journal)[SESSION]


@pytest.fixture(scope="session")
def film(cell, events):
    return film_of(cell, events)


def commands(events):
    return [event for event in events if event.kind in ("accept", "fallback")]


def centre(outline):
    return (outline.min(axis=0) + outline.max(axis=0)) / 2


def test_there_is_a_frame_every_tenth_of_a_second_and_at_the_end(film, events):
    last_s = max(event.t for event in events) / 1e9
    assert film.duration_s == pytest.approx(last_s)
    assert len(film.frames) == int(np.ceil(round(last_s / PERIOD_S, 6))) + 1


def test_the_path_is_what_was_commanded(film, events):
    told = [decode_actions(event.payload["action"])[0, POSITION] for event in commands(events)]
    assert len(told) > 5
    np.testing.assert_array_equal(film.path_m, told)


def test_the_hand_stands_where_it_was_commanded_to_be_and_nowhere_before(cell, film, events):
    first = commands(events)[0]
    before = [n for n in range(len(film.frames)) if n * PERIOD_S < first.t / 1e9]
    assert before and all(film.frames[n].hand is None for n in before)
    action = np.array(decode_actions(first.payload["action"]))
    action[:, POSITION] += (0.02, -0.05, 0.03)
    moved = Event(
        SESSION, 900, "accept", max(event.t for event in events),
        {**first.payload, "action": encode_actions(action)},
    )  # fmt: skip
    only = [event for event in events if event.kind not in ("accept", "fallback")]
    told = sorted([*only, first, moved], key=lambda event: event.t)
    hands = [frame.hand for frame in film_of(cell, told).frames if frame.hand]
    for side, step in ((0, (0.02, -0.05)), (1, (0.02, 0.03))):
        away = centre(hands[-1][side]) - centre(hands[0][side])
        np.testing.assert_allclose(away, step, atol=1e-9)


def test_force_age_phase_and_who_commands_stand_with_their_times(cell, events):
    told = [
        *events,
        Event(SESSION, 900, "force", 40_000_000, {"force_n": 12.5}),
        Event(SESSION, 901, "mode", 50_000_000, {"old": "run", "new": "fallback"}),
    ]
    film = film_of(cell, told)
    assert film.forces == ((0.04, 12.5),)
    assert (0.05, "fallback") in film.modes
    accepted = [event for event in events if event.kind == "accept"]
    assert film.ages == tuple((e.t / 1e9, e.payload["age_ns"] / 1e9) for e in accepted)
    assert [name for _, name in film.phases] == [
        e.payload["new"] for e in events if e.kind == "phase"
    ]


def test_what_is_held_is_drawn_apart_and_an_open_hand_holds_nothing(cell, events):
    closed, opened = [], []
    for event in events:
        found = event
        if event.kind in ("accept", "fallback"):
            action = np.array(decode_actions(event.payload["action"]))
            for target, opening in ((closed, 0.0), (opened, 0.04)):
                action[:, GRIPPER] = opening
                payload = {**event.payload, "action": encode_actions(action)}
                target.append(Event(event.session, event.n, event.kind, event.t, payload))
            continue
        closed.append(found)
        opened.append(found)
    assert film_of(cell, closed).frames[-1].held is not None
    assert film_of(cell, opened).frames[-1].held is None


def test_the_scene_is_that_of_the_moment(cell, events):
    kinds = [kind for kind, _ in film_of(cell, events).frames[0].scene]
    assert {"obstacle", "target", "scene"} <= set(kinds)
    first = next(event for event in events if event.kind == "scene")
    text = first.payload["bodies"]["post"]
    numbers = np.frombuffer(bytes.fromhex(text), dtype="<f8").copy()
    numbers[1] += 0.05
    bodies = {**first.payload["bodies"], "post": numbers.tobytes().hex()}
    last = max(event.t for event in events)
    moved = film_of(cell, [*events, Event(SESSION, 950, "scene", last, {"bodies": bodies})])
    place = kinds.index("obstacle")
    before, after = (moved.frames[n].scene[place][1][0] for n in (0, -1))
    np.testing.assert_allclose(centre(after) - centre(before), (0.0, 0.05), atol=1e-9)
    assert moved.frames[0].scene == moved.frames[1].scene or len(moved.frames) == 2
