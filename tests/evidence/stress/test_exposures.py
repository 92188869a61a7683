"""What an invocation sees is the newest that has arrived, and it can be older than the present."""

import hashlib
import math

import numpy as np
import pytest

from genpolicy.contract.latency import DECLARED_TERMS
from genpolicy.evidence.stress.exposures import SENSOR_TERMS, Exposures, sensor_terms
from genpolicy.evidence.stress.perturbations import CameraDelay, FrameDrop
from genpolicy.execution.journal import Journal

PERIOD_NS = 50_000_000


def of_kind(rollout, kind):
    return [event for event in rollout.journal.events() if event.kind == kind]


def begun(rollout):
    """When each invocation began, and when what it saw was exposed, ns."""
    return [(event.t, event.payload["exposed_ns"]) for event in of_kind(rollout, "conditioning")]


def arrivals(rollout):
    return [(event.t, event.payload["exposed_ns"]) for event in of_kind(rollout, "arrived")]


def newest_by(rollout, when_ns):
    return max(exposed for t, exposed in arrivals(rollout) if t <= when_ns)


@pytest.fixture
def make(make_fixture):
    def build(**changes):
        setup, journal = make_fixture(**changes), Journal("s")
        return Exposures(setup, journal, start=0), journal, setup

    return build


def test_an_invocation_sees_the_newest_that_has_arrived(run, kit, plans):
    """With and without a delay; without one that is the newest exposure, a few ms old."""
    for changes, ages_ms in (({}, (4, 8)), ({"schedule": CameraDelay(magnitude_s=0.08)}, (84, 88))):
        (rollout,) = run(kit.Replay(plans.actions), ticks=60, **changes)
        assert len(begun(rollout)) > 5
        for t, exposed in begun(rollout):
            assert exposed == newest_by(rollout, t)
            assert ages_ms[0] * 1e6 <= t - exposed <= ages_ms[1] * 1e6


def test_a_late_camera_shows_an_older_world(run, kit, plans):
    """At the time at which it began, younger exposures had happened, and none of them was seen."""
    (rollout,) = run(kit.Replay(plans.actions), ticks=60, schedule=CameraDelay(magnitude_s=0.08))
    happened = [event.t for event in of_kind(rollout, "exposure")]
    behind = [sum(exposed < other <= t for other in happened) for t, exposed in begun(rollout)]
    assert behind and set(behind) == {1}


def test_age_and_rows_count_from_the_exposure(run, kit, plans):
    (rollout,) = run(kit.Replay(plans.actions), ticks=60, schedule=CameraDelay(magnitude_s=0.08))
    seen = {e.payload["id"]: e.payload["exposed_ns"] for e in of_kind(rollout, "conditioning")}
    chunks = {e.payload["chunk_id"]: e.payload for e in of_kind(rollout, "enqueue")}
    accepted = of_kind(rollout, "accept")
    assert accepted
    for event in accepted:
        chunk = chunks[event.payload["chunk_id"]]
        exposed = seen[event.payload["chunk_id"]]
        assert chunk["condition_ns"] == chunk["start_ns"] == exposed
        assert event.payload["age_ns"] == event.t - exposed


def test_what_it_says_it_saw_is_what_was_exposed(run, kit, plans):
    (rollout,) = run(kit.Replay(plans.actions), ticks=40, schedule=CameraDelay(magnitude_s=0.08))
    hashes = {event.t: event.payload["sha256"] for event in of_kind(rollout, "exposure")}
    told = of_kind(rollout, "conditioning")
    assert told
    for event in told:
        data = bytes.fromhex(event.payload["history"])
        row = len(data) // event.payload["rows"]
        newest = hashlib.sha256(data[-row:]).hexdigest()
        assert newest == hashes[event.payload["exposed_ns"]]


def test_lost_pictures_make_invocations_wait(run, kit, plans, tmp_path):
    plan = kit.Replay(plans.actions)
    (rollout,) = run(plan, ticks=80, schedule=FrameDrop(probability=0.5))
    lost = len(of_kind(rollout, "exposure")) - len(arrivals(rollout))
    assert 20 <= lost <= 60
    assert all(exposed == newest_by(rollout, t) for t, exposed in begun(rollout))
    assert kit.check([rollout], tmp_path).violations == []
    (none,) = run(plan, ticks=40, schedule=FrameDrop(probability=0.999999))
    assert begun(none) == [] and none.tally.action_ticks == 0


def test_one_that_is_overtaken_is_of_no_use(make):
    exposures, journal, _ = make(schedule=CameraDelay(magnitude_s=0.3, probability=0.5))
    seen = np.zeros(24)
    came = []
    for tick in range(200):
        exposures.expose(tick * 0.05, seen + tick, "approach", "epoch_1")
        came += [one.number for one in exposures.arriving((tick + 1) * 0.05)]
        assert came == [] or exposures.newest.number == max(came)
    assert came == sorted(set(came)) and 20 < len(came) < 199  # the late ones were behind
    told = [event.payload["exposed_ns"] // PERIOD_NS for event in journal.events()
            if event.kind == "arrived"]  # fmt: skip
    assert set(came) < set(told) and told != sorted(told)


def test_history_is_what_has_arrived_and_the_first_is_repeated(make):
    exposures, _, setup = make()
    exposures.expose(0.0, np.full(24, 1.0), "approach", "epoch_1")
    assert [one.number for one in exposures.arriving(0.05)] == [0]
    rows = setup.horizons.observation_horizon
    np.testing.assert_array_equal(exposures.conditioning()[:, 0], [1.0] * rows)
    exposures.expose(0.05, np.full(24, 2.0), "approach", "epoch_1")
    assert list(exposures.arriving(0.05)) == []  # it has happened, and is not there
    assert exposures.conditioning()[-1, 0] == 1.0


def test_terms_are_those_of_the_schedule_whatever_the_method(make_fixture):
    """Golden: four declared terms of 1 to 2 ms each, and the delay on one of them."""
    plain, lost = sensor_terms(make_fixture(method="a"), start=3, number=9)
    assert not lost and list(plain) == [str(term) for term in SENSOR_TERMS]
    assert all(0.001 <= value <= 0.002 for value in plain.values())
    assert sensor_terms(make_fixture(method="b"), start=3, number=9) == (plain, False)
    late, _ = sensor_terms(make_fixture(schedule=CameraDelay(magnitude_s=0.08)), start=3, number=9)
    assert late == plain | {"capture": plain["capture"] + 0.08}
    others = [sensor_terms(make_fixture(), start=s, number=n)[0] for s, n in ((3, 8), (4, 9))]
    assert plain not in others
    assert set(SENSOR_TERMS) < set(DECLARED_TERMS)


def test_a_share_of_pictures_is_hit(make_fixture):
    setup = make_fixture(schedule=FrameDrop(probability=0.3))
    share = np.mean([sensor_terms(setup, start=0, number=n)[1] for n in range(2000)])
    assert math.isclose(share, 0.3, abs_tol=0.04)
