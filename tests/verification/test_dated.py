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
    for kind, said in (("hold", ""), ("supervisor", "watchdog"), ("hold", "human_reset")):
        m = {**event, "event": said}
        assert [rule for rule, _ in misdated(BEGIN_NS, kind, m)] == found


def test_a_person_may_say_that_it_is_later_and_not_that_it_is_earlier():
    said = {"event": "human_reset"}
    assert not list(misdated(BEGIN_NS, "supervisor", {**said, "t": 100 * LEAP_NS}))
    back = misdated(BEGIN_NS, "supervisor", {**said, "t": 0})
    assert [rule for rule, _ in back] == ["journal.time"]


def test_the_first_time_may_be_any():
    assert not list(misdated(NEVER_NS, "session", {"t": 100 * LEAP_NS}))
