"""The terms of a latency: a journal that is right, and one for each way to state others."""

import pytest

from genpolicy.contract.latency import Term
from genpolicy.evidence.stress.exposures import SENSOR_TERMS
from genpolicy.verification.terms import SENSED, TERMS, Terms

MS = 1_000_000
BEGIN = ("invocation", {"t": 104 * MS, "id": "a", "stage": "begin", "detail": "0.011"})
STATED = ("latency", {"t": 104 * MS, "id": "a", **dict.fromkeys(TERMS, 0.001)})
SAW = ("conditioning", {"t": 104 * MS, "id": "a", "exposed_ns": 100 * MS})
END = ("end", {"t": 200 * MS})
THERE = ("arrived", {"t": 104 * MS, "exposed_ns": 100 * MS})


def rules(*events):
    terms = Terms()
    return [rule for kind, m in events for rule, _ in terms.follow(kind, m)]


def changed(event, **to):
    return event[0], {**event[1], **to}


def test_eleven_terms_that_sum_to_the_whole():
    assert [*TERMS] == [f"{term}_s" for term in Term]
    assert [*SENSED] == [f"{term}_s" for term in SENSOR_TERMS]
    assert rules(THERE, BEGIN, STATED, SAW, END) == []
    # Beyond the sensors a second may move from one term to another: that is asked of `owed`.
    assert rules(THERE, BEGIN, changed(STATED, encode_s=0.0, sample_s=0.002), SAW) == []


@pytest.mark.parametrize(
    "events",
    [
        (THERE, BEGIN, changed(STATED, sample_s=0.0011), SAW),
        (THERE, BEGIN, changed(STATED, sample_s=-0.001, encode_s=0.003), SAW),
        (THERE, BEGIN, changed(STATED, sample_s=float("nan")), SAW),
        (THERE, BEGIN, changed(STATED, sample_s=float("inf")), SAW),
        (THERE, BEGIN, changed(STATED, capture_s=0.0, sample_s=0.002), SAW),
        (THERE, BEGIN, SAW),
        (THERE, BEGIN, END),
        (THERE, BEGIN, STATED, SAW, changed(BEGIN, id="b"), END),
        (THERE, STATED, BEGIN, SAW),
        (THERE, BEGIN, STATED, changed(STATED, sample_s=0.001), SAW),
        (THERE, BEGIN, changed(STATED, id="b"), SAW),
    ],
)
def test_terms_that_are_not_those_of_the_latency_are_found(events):
    assert set(rules(*events)) == {"clock.terms"}


def test_a_term_that_is_missing_cannot_be_read():
    kind, m = STATED
    with pytest.raises(KeyError, match="queue_s"):
        rules(BEGIN, (kind, {name: value for name, value in m.items() if name != "queue_s"}))
