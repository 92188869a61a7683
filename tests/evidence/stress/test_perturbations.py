"""Perturbation schedules: pure functions of their key, the same for every method."""

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from genpolicy.evidence.rows.stress import NEUTRAL
from genpolicy.evidence.stress.perturbations import (
    ChunkDrop,
    Injection,
    Nominal,
    Perturbation,
    RecoveryDrill,
    SidewaysPush,
    drill_s,
    gradable,
    injection,
    pushes,
    sensing,
)

KINDS = {
    "policy_stall": {"magnitude_s": 0.08},
    "compute_contention": {"factor": 4.0},
    "network_jitter": {"magnitude_s": 0.12},
    "queue_reorder": {"magnitude_s": 0.3},
    "chunk_drop": {},
}


def settings(kind, probability=1.0):
    return parsed({"kind": kind, "probability": probability, **KINDS[kind]})


def parsed(values):
    return TypeAdapter(Perturbation).validate_python(values)


def at(item, *, start=0, invocation=0, root_seed=1, name="x"):
    return injection(item, root_seed=root_seed, name=name, start=start, invocation=invocation)


@pytest.mark.parametrize("kind", KINDS)
def test_a_schedule_depends_on_its_key_alone(kind):
    item = settings(kind, 0.5)
    first = [at(item, invocation=n) for n in range(60)]
    np.random.seed(1)
    again = [at(item, invocation=n) for n in reversed(range(60))][::-1]
    assert first == again
    for change in ({"start": 1}, {"root_seed": 2}, {"name": "y"}):
        assert [at(item, invocation=n, **change) for n in range(60)] != first


@pytest.mark.parametrize("kind", KINDS)
def test_a_small_probability_and_one(kind):
    rarely = [at(settings(kind, 1e-9), invocation=n) for n in range(50)]
    always = [at(settings(kind, 1.0), invocation=n) for n in range(50)]
    assert rarely == [Injection()] * 50
    assert all(hit != Injection() for hit in always)


def test_the_share_of_hits_is_the_probability():
    hits = [at(settings("chunk_drop", 0.15), start=n).dropped for n in range(2000)]
    # Four standard deviations of a binomial with p = 0.15, n = 2000.
    assert abs(np.mean(hits) - 0.15) < 4 * np.sqrt(0.15 * 0.85 / 2000)


def test_a_shipped_chunk_that_is_overtaken_is_neither_too_old_nor_too_late_for_its_term(kit):
    """Beyond the deadline of its term it is thrown away unasked, and nothing is ever reordered."""
    execution, declared = kit.PARAMS["execution"], kit.PARAMS["latency"]["declared"]
    deadlines = {term: limit for term, limit, _ in execution["term_deadlines"]}
    planned = kit.PARAMS["stress"]["perturbations"]["queue_reorder"]
    latest_s = planned["magnitude_s"] + declared["queue"][1]
    assert latest_s < deadlines["queue"] and latest_s < execution["maximum_age_s"]


def test_each_kind_touches_what_it_names():
    assert at(settings("policy_stall")).extra_s == {"sample": 0.08}
    assert at(settings("queue_reorder")).extra_s == {"queue": 0.3}
    assert at(settings("compute_contention")) == Injection(compute_factor=4.0)
    assert at(settings("chunk_drop")) == Injection(dropped=True)
    sizes = [at(settings("network_jitter"), invocation=n).extra_s["network"] for n in range(200)]
    assert 0 <= min(sizes) < 0.01 and 0.11 < max(sizes) <= 0.12
    for other in (Nominal(), SidewaysPush(force_n=15.0), RecoveryDrill()):
        assert at(other) == Injection()


@pytest.mark.parametrize(
    ("entry", "suffers"),
    [
        ({"kind": "camera_delay", "magnitude_s": 0.08}, Injection(extra_s={"capture": 0.08})),
        ({"kind": "frame_drop"}, Injection(dropped=True)),
    ],
)
def test_what_hits_exposures_hits_no_invocation(entry, suffers):
    item = parsed({**entry, "probability": 0.3})
    assert sensing(item, falls=0.29, lot=0.5) == suffers
    assert sensing(item, falls=0.3, lot=0.5) == Injection() == at(item)
    for other in (Nominal(), settings("policy_stall"), RecoveryDrill()):
        assert sensing(other, falls=0.0, lot=0.5) == Injection()


def pushed(item, start):
    return pushes(item, root_seed=1, name="push", start=start)


def test_a_push_is_drawn_once_per_start():
    item = SidewaysPush(force_n=15.0)
    drawn = [pushed(item, n) for n in range(100)]
    assert drawn == [pushed(item, n) for n in range(100)]
    assert all(len(found) == 1 and not found[0].in_contact for found in drawn)
    assert {p.force_n for (p,) in drawn} == {-15.0, 15.0}
    assert all(0.3 <= p.time_s <= 1.5 and p.duration_s == 0.2 for (p,) in drawn)
    assert len({p.time_s for (p,) in drawn}) == 100


def test_a_push_in_contact_is_a_second_one_and_leaves_the_first_as_it_was():
    both, open_only = SidewaysPush(force_n=15.0, contact_force_n=30.0), SidewaysPush(force_n=15.0)
    drawn = [pushed(both, n) for n in range(100)]
    assert [found[:1] for found in drawn] == [pushed(open_only, n) for n in range(100)]
    assert all(found[1].in_contact and abs(found[1].force_n) == 30.0 for found in drawn)


def test_a_drill_is_drawn_once_per_start_and_nobody_else_drills():
    drawn = [drill_s(RecoveryDrill(), root_seed=1, name="drill", start=n) for n in range(100)]
    assert drawn == [
        drill_s(RecoveryDrill(), root_seed=1, name="drill", start=n) for n in range(100)
    ]
    assert all(0.5 <= time_s <= 3.0 for time_s in drawn) and len(set(drawn)) == 100
    for item in (Nominal(), SidewaysPush(force_n=15.0)):
        assert drill_s(item, root_seed=1, name="drill", start=0) is None


def test_nobody_else_pushes():
    for item in (Nominal(), ChunkDrop(), RecoveryDrill()):
        assert pushed(item, 0) == ()


@pytest.mark.parametrize(
    "bad",
    [
        {"kind": "earthquake"}, {"kind": "chunk_drop", "probability": 1.5},
        {"kind": "chunk_drop", "probability": float("nan")},
        {"kind": "camera_delay", "magnitude_s": -0.1}, {"kind": "camera_delay"},
        {"kind": "compute_contention", "factor": 0.5}, {"kind": "push", "force_n": 0.0},
        {"kind": "push", "force_n": 1.0, "contact_force_n": -1.0},
        {"kind": "chunk_drop", "probability": 0.0}, {"kind": "camera_delay", "magnitude_s": 0.0},
        {"kind": "network_jitter", "magnitude_s": 0.0}, {"kind": "queue_reorder", "magnitude_s": 0},
        {"kind": "compute_contention", "factor": 1.0},
        {"kind": "push", "force_n": 1.0, "probability": 0.5}, {"kind": "nominal", "factor": 2.0},
    ],
)  # fmt: skip
def test_bad_settings_are_refused(bad):
    with pytest.raises(ValidationError):
        parsed(bad)


def test_all_pictures_are_not_lost_and_nobody_loses_them_by_default():
    """Without any picture no invocation ever begins."""
    for entry in ({}, {"probability": 1.0}, {"probability": 0.0}):
        with pytest.raises(ValidationError):
            parsed({"kind": "frame_drop", **entry})
    assert parsed({"kind": "frame_drop", "probability": 0.99}).probability == 0.99


@pytest.mark.parametrize(
    ("kind", "fields"),
    [
        ("frame_drop", {"probability"}), ("chunk_drop", {"probability"}),
        *((kind, {"magnitude_s", "probability"})
          for kind in ("camera_delay", "policy_stall", "network_jitter", "queue_reorder")),
        ("compute_contention", {"factor", "probability"}),
    ],
)  # fmt: skip
def test_what_can_be_graded_is_nothing_at_its_neutral_size(kind, fields):
    sizes = {"magnitude_s": 0.08, "factor": 2.0} if kind != "frame_drop" else {}
    sizes = {name: size for name, size in sizes.items() if name in fields}
    item = parsed({"kind": kind, "probability": 0.5, **sizes})
    assert set(gradable(item)) == fields
    for field in fields - {"probability"}:
        hit = item.model_copy(update={field: NEUTRAL[field]}).hit(0.7)
        assert not any(hit.extra_s.values()) and hit.compute_factor == 1.0 and not hit.dropped
    assert NEUTRAL["probability"] == 0.0


def test_a_push_can_be_graded_only_where_nothing_of_it_stays():
    assert gradable(SidewaysPush(force_n=15.0)) == ("force_n",) and NEUTRAL["force_n"] == 0.0
    assert gradable(SidewaysPush(force_n=15.0, contact_force_n=30.0)) == ()
    assert gradable(Nominal()) == gradable(RecoveryDrill()) == gradable(None) == ()
