"""One shadow session: the first admitted candidate is played, the others are written off."""

from dataclasses import replace

import numpy as np
import pytest

from genpolicy.evidence.shadow.session import IN_FLIGHT_PHASE_CHANGE, play
from genpolicy.evidence.shadow.shadow import HELD_OUT, admit
from genpolicy.feasibility.admission import Rejected


@pytest.fixture(scope="module")
def judged(shadow, demonstrated):
    """A demonstrated chunk that is admitted, and what the layers say to a NaN in its place."""
    item, case, result = demonstrated
    bad = case.with_actions(np.full_like(case.proposal.actions, np.nan))
    return item, (case, result), (bad, admit(shadow, bad))


def played(shadow, judged, *pairs, fixture=HELD_OUT):
    return play(shadow.cell, judged[0], pairs, fixture=fixture, number=0)


def test_an_admitted_chunk_reaches_the_stub_for_its_horizon(shadow, judged):
    found = played(shadow, judged, judged[1])
    assert found.delivered == 1 and (found.stale, found.invalid) == (0, 0)
    # One row is late, and the last one is too old when its time comes.
    assert found.arrivals == shadow.cell.horizons.execution_horizon - 2
    assert (found.account.generated, found.account.executed, found.account.error) == (1, 1, 0)


def test_a_rejected_chunk_reaches_nobody_and_is_written_off(shadow, judged):
    assert isinstance(judged[2][1], Rejected)
    found = played(shadow, judged, judged[2])
    assert (found.delivered, found.arrivals) == (0, 0)
    assert found.account.discarded == {"infeasible": 1}


def test_of_two_candidates_the_first_admitted_is_played(shadow, judged):
    bad, good = judged[2], judged[1]
    metadata = replace(good[0].proposal.metadata, chunk_id="first", candidate_index=1)
    bad = (replace(bad[0], proposal=replace(bad[0].proposal, metadata=metadata)), bad[1])
    found = played(shadow, judged, bad, good)
    assert found.delivered == 1 and found.arrivals > 0
    assert (found.account.generated, found.account.executed) == (2, 1)
    kinds = [event.kind for event in found.journal.events()]
    assert kinds.count("candidate") == 2


def test_a_phase_that_changes_in_flight_stops_the_rest(shadow, judged):
    whole = played(shadow, judged, judged[1])
    cut = played(shadow, judged, judged[1], fixture=IN_FLIGHT_PHASE_CHANGE)
    assert 0 < cut.arrivals < whole.arrivals
    assert cut.account.executed == 1 and cut.account.error == 0
