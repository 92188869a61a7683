"""Admission in a thread: one job at a time, and no tick waits for it."""

import select
import threading

import numpy as np
import pytest
from arranged import GUARD_S, wait_for

from genpolicy.contract.chunk import ChunkMetadata, Proposal
from genpolicy.evidence.admission_context import Session
from genpolicy.execution.cell import Cell
from genpolicy.execution.issued import issued_by_feasibility
from genpolicy.feasibility.admission import Admitted, Rejected
from genpolicy.wall_clock.admission import AdmissionThread, Job, judge


def job_of(standing, cell, actions, *, epoch="epoch_1", late_rows=1):
    period_s = cell.horizons.action_period_s
    metadata = ChunkMetadata(
        chunk_id="0", condition_observation_event_time_s=0.0, policy_checkpoint_hash="c",
        sampler_config_hash="s", action_start_time_s=0.0, action_period_s=period_s,
        valid_until_s=8 * period_s, task_phase=standing.phases[0], calibration_epoch=epoch,
        predecessor_chunk_id="", session_epoch=0, method="m", candidate_index=0,
    )  # fmt: skip
    session = Session("epoch_1", 0, "c", "s", cell.execution.maximum_age_s, cell.controller_mode)
    return Job(
        Proposal(metadata, actions, selected_by="first"), standing.history(1, 2),
        standing.commanded(1), session, 0.0, 0.02, standing.phases[0], late_rows,
    )  # fmt: skip


@pytest.fixture(scope="module")
def cell(kit):
    return Cell(kit.HORIZONS, kit.EXECUTION)


def test_an_arm_that_stays_is_admitted_and_issued_here(task, checker, cell, standing):
    still = np.tile(standing.action_rows[0], (16, 1))
    result = judge(task, checker, job_of(standing, cell, still))
    assert isinstance(result, Admitted) and issued_by_feasibility(result)
    assert result.verdict.rows == (1, 16)
    assert result.context.measured_at_s == 0.0 and result.context.dq_meas is not None


@pytest.mark.parametrize(
    ("actions", "changes"),
    [(np.full((16, 10), np.nan), {}), (np.zeros((16, 10)), {}), (None, {"epoch": "epoch_2"})],
)
def test_what_a_layer_rejects_is_rejected(actions, changes, task, checker, cell, standing):
    actions = np.tile(standing.action_rows[0], (16, 1)) if actions is None else actions
    result = judge(task, checker, job_of(standing, cell, actions, **changes))
    assert isinstance(result, Rejected)


def test_a_result_wakes_whoever_waits_and_is_taken_once():
    thread = AdmissionThread(lambda job: job)
    assert thread.result() is None
    assert thread.submit("job")
    assert select.select([thread.descriptor], [], [], GUARD_S)[0]
    assert thread.result() == ("job", "job")
    assert thread.result() is None
    assert not select.select([thread.descriptor], [], [], 0)[0]
    assert thread.submit("another")


def test_one_that_never_ends_takes_no_other_and_lets_nobody_wait():
    release = threading.Event()
    thread = AdmissionThread(lambda job: release.wait(GUARD_S))
    assert thread.submit("first") and not thread.submit("second")
    assert thread.result() is None
    release.set()
    assert wait_for(thread.result) == ("first", True)


def test_one_that_cannot_be_judged_is_not_admitted_and_the_next_one_is():
    def judged(job):
        if job == "bad":
            raise RuntimeError("what a policy can make of a layer")
        return job

    thread = AdmissionThread(judged)
    thread.submit("bad")
    assert wait_for(thread.result) == ("bad", None)
    assert thread.failures == 1
    assert thread.submit("good") and wait_for(thread.result) == ("good", "good")


def test_the_usual_time_is_that_of_the_last_jobs_at_the_median():
    thread = AdmissionThread(lambda job: None)
    assert thread.usual_s == 0.0
    thread._lasted_s.extend([0.01] * 63 + [1.0])
    assert thread.usual_s == 0.01
    thread._lasted_s.extend([0.5] * 33)
    assert thread.usual_s == 0.5
