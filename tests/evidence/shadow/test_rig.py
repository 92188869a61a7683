"""The rig itself: its good chunk passes, its clock obeys, an imitation stays one."""

import numpy as np
import pytest

from genpolicy.evidence.shadow.rig import (
    PERIOD_S,
    ROWS,
    Rig,
    StandIn,
    passing_verdict,
)
from genpolicy.execution.arrival import issued_by_feasibility
from genpolicy.execution.checks import CHECKS


def test_a_chunk_unchanged_is_executed_whole():
    rig = Rig()
    assert [command.action_index for command in rig.run()] == list(range(8))
    assert rig.now_s == pytest.approx(8 * PERIOD_S)


def test_changes_go_where_they_belong_and_hashes_follow_the_actions():
    rig = Rig()
    chunk = rig.chunk(task_phase="insert", verdict=passing_verdict(failed=2))
    assert chunk.metadata.task_phase == "insert"
    assert [layer.passed for layer in chunk.verdict.layers] == [True, True, False] + [True] * 3
    assert rig.chunk(actions_sha256="x").actions_sha256 == "x"
    one, other = rig.chunk(), rig.chunk()
    assert one.actions_sha256 != other.actions_sha256 and one.metadata != other.metadata


def test_actions_of_two_seeds_differ_in_every_row_and_are_finite():
    one, other = Rig.actions(1), Rig.actions(2)
    assert one.shape == (ROWS, 10) and np.isfinite(one).all()
    assert (one != other).any(axis=1).all()


def test_an_imitation_is_never_what_feasibility_issued():
    chunk = Rig().chunk()
    assert type(chunk) is StandIn and not issued_by_feasibility(chunk)
    whole = Rig(checks=CHECKS)
    assert {command.kind for command in whole.run()} == {"hold"}
    assert whole.executor.conservation().chunks.discarded == {"infeasible": 1}


def test_time_passes_with_and_without_the_controller_s_own_clock():
    for poll, held in ((True, 1), (False, 0)):
        rig = Rig()
        rig.run()
        rig.advance(0.3, poll=poll)
        assert rig.now_s == pytest.approx(0.7)
        holds = [e for e in rig.journal.events() if e.kind == "hold"]
        assert len(holds) == held


def test_an_observation_has_the_age_that_is_asked_for():
    rig = Rig()
    rig.advance(1.0)
    rig.observe(age_s=0.4)
    (seen,) = [e for e in rig.journal.events() if e.kind == "observation"]
    assert seen.payload["event_time_ns"] == 600_000_000
