"""What may have been seen: a journal that is right, and one for each way to see otherwise."""

import hashlib

import pytest

from genpolicy.verification.arrived import Arrived

MS = 1_000_000
SESSION = ("session", {"t": 0, "labels": {"start_sha256": "ab"}})


def row(number):
    """What exposure `number` showed: eight bytes."""
    return number.to_bytes(8, "little")


def exposed(number, t):
    return "exposure", {"t": t * MS, "sha256": hashlib.sha256(row(number)).hexdigest()}


def arrived(t, of):
    return "arrived", {"t": t * MS, "exposed_ns": of * MS}


def began(t, of, rows):
    history = b"".join(map(row, rows)).hex()
    return "conditioning", {
        "t": t * MS, "id": "a", "exposed_ns": of * MS, "rows": len(rows), "history": history,
    }  # fmt: skip


def queued(condition=50, start=50, chunk_id="a"):
    return "enqueue", {
        "t": 200 * MS, "chunk_id": chunk_id, "source": "policy",
        "condition_ns": condition * MS, "start_ns": start * MS,
    }  # fmt: skip


# Three exposures; the first two are there, in order, when the invocation begins at 140 ms.
SEEN = (exposed(0, 0), exposed(1, 50), arrived(90, 0), exposed(2, 100), arrived(140, 50))


ALONE = ("exposure", {**exposed(3, 150)[1], "alone": True})


def rules(*events, session=SESSION):
    """Rules that are broken where each exposure is one of a tick that observes."""
    seen, found = Arrived(), []
    for kind, m in (session, *events):
        found += seen.follow(kind, m)
        if kind == "exposure" and "alone" not in m:
            found += seen.follow("observation", {"t": m["t"]})
    return [rule for rule, _ in found]


def test_the_newest_that_is_there():
    assert rules(*SEEN, began(140, 50, (0, 1)), queued()) == []
    assert rules(*SEEN[:3], began(90, 0, (0, 0)), queued(0, 0)) == []  # the first is repeated
    other = ("joined", {"chunk_id": "b", "invocation": "a"})
    assert rules(*SEEN, began(140, 50, (0, 1)), other, queued(chunk_id="b")) == []


@pytest.mark.parametrize(
    ("events", "rule"),
    [
        ((*SEEN, began(140, 100, (1, 2))), "sensor.not_there"),
        ((*SEEN, began(140, 0, (0, 0))), "sensor.older"),
        ((*SEEN, began(140, 50, (1, 2))), "sensor.other"),
        ((*SEEN, began(140, 50, (1, 1))), "sensor.other"),
        ((*SEEN, began(140, 50, (1, 0))), "sensor.other"),
        ((*SEEN, arrived(150, 50)), "sensor.again"),
        ((*SEEN, arrived(150, 60)), "sensor.unknown"),
        ((*SEEN, arrived(100, 100)), "sensor.early"),
        ((*SEEN, began(140, 50, (0, 1)), queued(condition=100)), "sensor.claims"),
        ((*SEEN, began(140, 50, (0, 1)), queued(start=100)), "sensor.claims"),
        ((*SEEN, queued()), "sensor.claims"),
        ((*SEEN, exposed(3, 100)), "sensor.exposed"),
        ((*SEEN, exposed(3, 90)), "sensor.exposed"),
        ((*SEEN, ALONE, exposed(3, 151)), "sensor.exposed"),
        ((*SEEN, ("observation", {"t": 150 * MS})), "sensor.exposed"),
    ],
)
def test_what_could_not_have_been_seen_is_found(events, rule):
    assert rule in rules(*events)


def test_a_session_without_a_virtual_clock_is_not_asked():
    session = ("session", {"t": 0, "labels": {}})
    assert rules(*SEEN, began(140, 100, (2, 2)), queued(), session=session) == []
