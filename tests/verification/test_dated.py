"""The order of time on record, and who may make it leap."""

import pytest

from genpolicy.verification.dated import LEAP_NS, NEVER_NS, misdated

BEGIN_NS = 1_000


@pytest.mark.parametrize(
    ("later_ns", "found"),
    [(-1, ["journal.time"]), (0, []), (LEAP_NS, []), (LEAP_NS + 1, ["journal.leap"])],
)
def test_time_goes_on_and_not_too_far(later_ns, found):
    event = {"t": BEGIN_NS + later_ns}
    assert [rule for rule, _ in misdated(BEGIN_NS, event)] == found
    assert [rule for rule, _ in misdated(BEGIN_NS, {**event, "event": "watchdog"})] == found


def test_a_person_may_say_that_it_is_later_and_not_that_it_is_earlier():
    said = {"event": "human_reset"}
    assert not list(misdated(BEGIN_NS, {**said, "t": 100 * LEAP_NS}))
    assert [rule for rule, _ in misdated(BEGIN_NS, {**said, "t": 0})] == ["journal.time"]


def test_the_first_time_may_be_any():
    assert not list(misdated(NEVER_NS, {"t": 100 * LEAP_NS}))
