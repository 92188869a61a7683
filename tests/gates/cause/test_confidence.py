"""A verdict is no surer than what it could look at, however many resamples agree."""

from dataclasses import replace

import pytest
from planted import BROKEN, VALID, named

from gates.cause.confidence import UNSEEN, looked_share
from genpolicy.audit.reach_rows import LEARNED, LOCAL, Reach

DRAWS = 200


def reach(kind, *spoke):
    return tuple(Reach(kind, fifth, 40, count) for fifth, count in enumerate(spoke, start=1))


def test_what_denies_modes_is_no_surer_than_the_fifth_that_was_looked_at_least():
    denied = replace(BROKEN["structure"][0], reach=reach(LOCAL, 40, 40, 30, 40, 40))
    sure = named(denied, draws=[denied] * DRAWS)
    assert sure.name.value == "unimodal" and sure.agreeing == (DRAWS, DRAWS)
    assert sure.confidence == pytest.approx((1.0 - UNSEEN) * DRAWS / (DRAWS + 1) * 0.75)
    # Near by declared scales in many numbers proves little where planted modes are not found.
    both = replace(denied, other_reach=reach(LEARNED, 40, 40, 10, 40, 40))
    assert looked_share(both) == pytest.approx(0.5)
    whole = replace(both, reach=reach(LOCAL, *[40] * 5), other_reach=reach(LEARNED, *[40] * 5))
    assert looked_share(whole) == 1.0


def test_a_kind_that_was_not_asked_has_no_say_and_without_fifths_all_situations_count():
    silent = tuple(Reach(LEARNED, fifth, 0, 0) for fifth in range(1, 6))
    denied = replace(VALID, reach=reach(LOCAL, 40, 40, 30, 40, 40), other_reach=silent)
    assert looked_share(denied) == pytest.approx(0.75)
    none = replace(VALID, reach=(), other_reach=())
    assert looked_share(none) == none.counts.share


def test_modes_that_are_seen_are_no_less_sure_for_what_was_not_looked_at():
    found = replace(VALID, reach=reach(LOCAL, 40, 40, 30, 40, 40))
    assert named(found, draws=[found] * DRAWS).confidence == pytest.approx(
        (1.0 - UNSEEN) * DRAWS / (DRAWS + 1)
    )
    # A variable that the policy sees makes the verdict, and no mode is denied.
    seen = BROKEN["validity"][0]
    assert named(seen, draws=[seen] * DRAWS).confidence > 0.9
