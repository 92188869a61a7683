"""The causal hold: what was not exposed, or not received, at a tick is never used."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from genpolicy.data.resample import hold, remove_clock_offsets, resample
from genpolicy.errors import ContractError


def test_golden_hold():
    """By hand: sample 1 is overtaken by sample 2; sample 3 is exposed but still on its way."""
    event = np.array([0, 10, 20, 30])
    receive = np.array([5, 28, 25, 60])
    ticks = np.array([4, 5, 24, 25, 28, 59, 60])
    assert hold(ticks, event, receive).tolist() == [-1, 0, 0, 2, 2, 2, 3]


@settings(max_examples=200, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(0, 8), st.integers(1, 8))
def test_hold_equals_its_definition(seed, samples, ticks):
    rng = np.random.default_rng(seed)
    event = np.cumsum(rng.integers(1, 5, samples))
    receive = event + rng.integers(-1, 12, samples)
    tick = np.sort(rng.integers(0, 40, ticks))
    if samples == 0:
        return
    for t, found in zip(tick, hold(tick, event, receive), strict=True):
        known = [i for i in range(samples) if event[i] <= t and receive[i] <= t]
        assert found == (max(known) if known else -1)


def rows_of(factory, recorded, **changes):
    return resample(
        remove_clock_offsets(recorded, where="e"), factory.contract(**changes), where="e"
    )


def test_frames_use_only_the_past(factory):
    rows = rows_of(factory, factory.episode(0, steps=30))
    assert np.diff(rows.tick_ns).tolist() == [50_000_000] * (len(rows.tick_ns) - 1)
    for name, event in rows.stream_event_ns.items():
        assert (event <= rows.tick_ns).all()
        assert (rows.stream_receive_ns[name] <= rows.tick_ns).all()


def test_declared_offsets_are_removed(factory):
    """The factory samples the robot at multiples of 10 ms after its start, offset by 3 ms."""
    recorded = factory.episode(0)
    rows = rows_of(factory, recorded)
    assert not ((rows.stream_event_ns["robot"] - factory.START_NS) % 10_000_000).any()
    assert (recorded.streams["robot"].event_time_ns % 10_000_000 == 3_000_000).all()


def test_a_future_sample_changes_nothing_before_it_arrives(factory):
    recorded = factory.episode(0, steps=30)
    values = recorded.streams["robot"].values.copy()
    values[100:, 0] += 0.01
    arrival = recorded.streams["robot"].receive_time_ns[100]
    before = rows_of(factory, recorded)
    after = rows_of(factory, factory.with_stream(recorded, "robot", values=values))
    early = before.tick_ns < arrival
    assert early.any()
    assert not early.all()
    np.testing.assert_array_equal(before.observation[early], after.observation[early])
    assert not (before.observation[~early] == after.observation[~early]).all()


def test_a_delayed_arrival_is_not_used_although_it_was_exposed(factory):
    recorded = factory.episode(0, steps=30)
    late = recorded.streams["robot"].receive_time_ns.copy()
    late[60:80] += 60_000_000
    rows = rows_of(factory, factory.with_stream(recorded, "robot", receive_time_ns=late))
    assert (rows.stream_receive_ns["robot"] <= rows.tick_ns).all()
    assert (rows.tick_ns - rows.stream_event_ns["robot"]).max() > 50_000_000


def test_too_old_is_refused_with_the_action(factory):
    recorded = factory.episode(0, steps=30)
    late = recorded.streams["camera"].receive_time_ns.copy()
    late[20:] += 250_000_000
    delayed = factory.with_stream(recorded, "camera", receive_time_ns=late)
    with pytest.raises(ContractError, match=r"channel target_pose at action \d+ .* s old"):
        rows_of(factory, delayed)


def cut_before(samples, start):
    keep = samples.event_time_ns >= start
    names = ("event_time_ns", "receive_time_ns", "values")
    return {name: getattr(samples, name)[keep] for name in names}


def test_leading_actions_without_observation_are_counted(factory):
    recorded = factory.episode(0)
    camera = recorded.streams["camera"]
    later = factory.START_NS + 60_000_000
    rows = rows_of(factory, factory.with_stream(recorded, "camera", **cut_before(camera, later)))
    assert len(rows.lead_action) == 2
    assert len(rows.tick_ns) == 10
    np.testing.assert_array_equal(
        np.concatenate([rows.lead_action, rows.action]), recorded.streams["action"].values
    )
    much_later = cut_before(camera, factory.START_NS + 400_000_000)
    with pytest.raises(ContractError, match=r"actions without a sample of \['camera'\]"):
        rows_of(factory, factory.with_stream(recorded, "camera", **much_later))


def test_phase_is_one_hot_and_causal(factory):
    rows = rows_of(factory, factory.episode(0, steps=30))
    one_hot = rows.observation[:, -3:]
    assert (one_hot.sum(axis=1) == 1.0).all()
    assert [factory.PHASES[i] for i in one_hot.argmax(axis=1)] == rows.phase.tolist()
    assert sorted(set(rows.phase)) == sorted(factory.PHASES)
