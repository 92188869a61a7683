"""Changes and rates added up: the same chunks in every form."""

from dataclasses import replace

import numpy as np
import pytest
from planar import SETTINGS, planar, shuffled
from planar_dataset import dataset_of
from written import forms

from genpolicy.audit.data import canonical, commanded_path, origin, relative_paths
from genpolicy.audit.forms import Forms, before, forms_of, in_place
from genpolicy.audit.propose import propose_settings
from genpolicy.audit.semantics.motion import make_motion
from genpolicy.errors import ContractError


@pytest.fixture(scope="module")
def data():
    return canonical(planar(episodes=20)[0])


def reading(gain, *, added=True, partner=(0, 1), offset=0.0):
    return Forms(
        added=np.full(2, added),
        gain=np.full(2, gain),
        offset=np.full(2, offset),
        partner=np.array(partner),
    )


FORMS = {
    "delta": reading(1.0),
    "velocity": reading(0.1),
    "absolute": reading(1.0, added=False),
}


@pytest.mark.parametrize("form", list(FORMS))
def test_a_path_is_the_same_in_every_form(data, form):
    written = replace(data, action=forms(data)[form], forms=FORMS[form])
    np.testing.assert_allclose(written.commanded, data.action, atol=1e-12)
    motion, plain = make_motion(written), make_motion(data)
    np.testing.assert_allclose(motion.commanded, plain.commanded, atol=1e-12)
    rows = np.arange(0, len(data.action), 7)
    chunks, known = relative_paths(written, rows, 16), relative_paths(data, rows, 16)
    # A chunk of changes begins at the last command, one of places where the arm was seen.
    gap = chunks - known
    np.testing.assert_allclose(gap, np.broadcast_to(gap[:, :1], gap.shape), atol=1e-12)
    assert np.abs(gap).max() < 0.03


def test_normalised_places_are_places_again(data):
    action = forms(data)["normalised_place"]
    low, high = data.action.min(axis=0), data.action.max(axis=0)
    half = 0.5 * (high - low)
    scaled = Forms(np.zeros(2, dtype=bool), half, low + half, np.array([0, 1]))
    np.testing.assert_allclose(
        relative_paths(replace(data, action=action, forms=scaled), np.arange(9), 16),
        relative_paths(data, np.arange(9), 16),
        atol=1e-12,
    )


def test_without_a_partner_it_is_added_up_from_nothing(data):
    bare = replace(
        data,
        action=forms(data)["delta"],
        forms=reading(1.0, partner=(-1, -1)),
        paired=False,
        observation_position=slice(0, 0),
    )
    rows = np.arange(0, len(data.action), 11)
    assert not np.any(bare.placed[bare.first_row] - bare.action[bare.first_row])
    chunks = relative_paths(bare, rows, 16)
    np.testing.assert_allclose(chunks[:, 0], bare.action[rows], atol=1e-12)
    # A constant velocity is a way, not a place: left and right do not both become nothing.
    sides = np.where(bare.episode % 2, 0.01, -0.01)[:, None] * np.array([0.0, 1.0])
    chunks = relative_paths(replace(bare, action=sides), rows, 16)
    assert set(np.sign(chunks[:, -1, 1])) == {-1.0, 1.0}
    np.testing.assert_allclose(origin(replace(bare, action=sides), bare.first_row), 0.0, atol=1e-12)


def test_episodes_do_not_run_into_each_other():
    action = np.ones((6, 1))
    episode = np.array([0, 0, 0, 4, 4, 4])
    seen = np.arange(6.0)[:, None]
    form = Forms(np.ones(1, dtype=bool), np.full(1, 2.0), np.zeros(1), np.zeros(1, dtype=int))
    np.testing.assert_array_equal(in_place(action, seen, episode, form)[:, 0], [2, 4, 6, 5, 7, 9])
    assert in_place(action[:0], seen[:0], episode[:0], form).shape == (0, 1)


def test_any_order_of_rows_and_episodes_gives_the_same(data):
    written = replace(data, action=forms(data)["velocity"], forms=FORMS["velocity"])
    again = canonical(shuffled(written, 3))
    np.testing.assert_array_equal(again.placed, written.placed)


def test_what_is_shown_of_a_chunk_is_where_it_leads(data):
    rows = np.array([40])
    plain = commanded_path(data, data.action[40:50], 40)
    np.testing.assert_array_equal(plain, data.action[40:50])
    written = replace(data, action=forms(data)["delta"], forms=FORMS["delta"])
    path = commanded_path(written, written.action[40:50], 40)
    np.testing.assert_allclose(
        path, relative_paths(written, rows, 10)[0] + origin(written, rows), atol=1e-12
    )
    np.testing.assert_array_equal(before(data, np.array([0]), rows), [[0.0]])


def test_the_settings_name_the_forms():
    names = ["x", "y", "grip"]
    plain = SETTINGS.model_copy(update={"action_forms": {"x": "unknown"}})
    assert forms_of(plain, names, {}) is None
    stated = SETTINGS.model_copy(
        update={"action_forms": {"x": "rate"}, "action_gains": {"x": 0.1, "grip": 2.0}}
    )
    found = forms_of(stated, names, {"x": 4})
    assert found.added.tolist() == [True, False, False]
    assert found.gain.tolist() == [0.1, 1.0, 2.0]
    assert found.partner.tolist() == [4, -1, -1]
    with pytest.raises(ContractError, match="naming the component z"):
        forms_of(stated.model_copy(update={"action_offsets": {"z": 1.0}}), names, {})


def test_scales_are_those_of_the_path(data):
    """A rate of 0.1 m/s has neither the unit nor the spread of what it moves."""
    pairing = {"x": "tcp.x", "y": "tcp.y"}
    rate = {name: {"form": "rate", "gain": 0.1, "offset": 0.0} for name in pairing}
    plain = propose_settings(dataset_of(data), source={"pairing": pairing})
    written = replace(data, action=forms(data)["velocity"])
    moved = propose_settings(dataset_of(written), source={"pairing": pairing, "forms": rate})
    assert moved.minimum_separation_m == plain.minimum_separation_m == pytest.approx(0.03)
    assert moved.chunk_rows == plain.chunk_rows
    assert moved.action_forms == {"x": "rate", "y": "rate"}
    assert not plain.action_forms and not plain.action_gains
