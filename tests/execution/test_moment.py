"""What a question is asked about: views after events, and facts that a place does not have."""

import pytest

from genpolicy.contract.chunk import DiscardReason
from genpolicy.execution.moment import Moment, View

FORCE = DiscardReason.FORCE_EVENT


def test_a_later_event_covers_an_earlier_one_and_never_the_reverse() -> None:
    view = View().voided(FORCE, 10, 3)
    assert view.voided(FORCE, 5, 2) is view
    assert tuple(view.voided(FORCE, 5, 7).voidings[FORCE]) == (10, 7)
    assert view.voidings.keys() == {FORCE}


def test_a_place_without_chunk_or_row_cannot_be_asked_about_one() -> None:
    with pytest.raises(AssertionError, match="no chunk"):
        _ = Moment(now_ns=0).chunk
    with pytest.raises(AssertionError, match="no row"):
        _ = Moment(now_ns=0).due_ns
