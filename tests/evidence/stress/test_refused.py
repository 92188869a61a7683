"""Refused chunks: whole for a failure, hashed in the journal for everybody."""

import numpy as np
import pytest

from genpolicy.contract.action import ACTION_DIM
from genpolicy.evidence.rows.stress import RefusedRow, RolloutRow
from genpolicy.evidence.shadow.candidate_rows import numbers_sha256
from genpolicy.evidence.stress.refused import refused_rows
from genpolicy.integrity.rows import read_rows, write_rows
from genpolicy.verification.refused import RefusedCandidates


@pytest.fixture(scope="module")
def blocked(run, kit):
    """A rollout that is sent through the post."""
    (rollout,) = run(kit.straight, ticks=60)
    return rollout


def as_row(rollout, outcome="timeout"):
    numbers = dict.fromkeys(
        ("seed", "ticks", "action_ticks", "hold_ticks", "fallback_ticks", "invocations",
         "deadline_misses", "discards", "rejections", "interventions"), 0
    )  # fmt: skip
    return RolloutRow(
        method=rollout.setup.method, perturbation=rollout.setup.perturbation,
        start=rollout.start_index, start_sha256="ab", outcome=outcome,
        success=outcome == "success", duration_s=1.0, rejected_by="", recovery_attempted=False,
        recovered=False, person_s=0.0, action_age_p50_s=None, action_age_p95_s=None,
        action_age_max_s=None, latency_p95_s=None, force_peak_n=0.0, mode="left", **numbers,
    )  # fmt: skip


def rows_of(rollout):
    return refused_rows([as_row(rollout)], [rollout.refused], rollout.setup.checker)


def test_every_refused_candidate_of_a_failure_is_there(blocked):
    judged = [e.payload for e in blocked.journal.events() if e.kind == "candidate"]
    refused = [payload for payload in judged if payload["first_reason"]]
    rows = rows_of(blocked)
    assert len(rows) == len(refused) > 3
    for row, said in zip(rows, refused, strict=True):
        assert (row.chunk_id, row.candidate) == (said["chunk_id"], said["index"])
        assert row.first_reason == said["first_reason"]
        assert said["layers"][row.layer] is not True
        assert numbers_sha256(row.raw) == said["measures"]["raw_sha256"]
        assert numbers_sha256(row.projected) == said["measures"]["projected_sha256"]
        assert len(row.raw) == blocked.setup.horizons.prediction_horizon * ACTION_DIM
    hit = [row for row in rows if row.layer == "geometric"]
    assert hit and all(len(row.touching) == 2 and row.first_row is not None for row in hit)
    admitted = [payload for payload in judged if not payload["first_reason"]]
    assert all("raw_sha256" not in payload["measures"] for payload in admitted)


def test_of_a_success_that_nobody_watches_nothing_is_kept(blocked):
    """Three that succeed alike but for their length: the first is neither median nor slowest."""
    rows = [as_row(blocked, "success") for _ in range(3)]
    rows = [RolloutRow(**{**vars(row), "duration_s": float(n)}) for n, row in enumerate(rows)]
    kept = refused_rows(rows, [blocked.refused] * 3, blocked.setup.checker)
    assert len(kept) == 2 * len(blocked.refused)


def test_the_journal_alone_says_which_rows_there_are(blocked):
    found = RefusedCandidates()
    for event in blocked.journal.events():
        found.read(event.kind, {**event.payload, "session": event.session})
    key = (blocked.setup.method, blocked.setup.perturbation, blocked.start_index)
    again = list(found.rows({key}))
    rows = rows_of(blocked)
    assert [
        (row["chunk_id"], row["candidate"], row["layer"], row["raw_sha256"]) for row in again
    ] == [(row.chunk_id, row.candidate, row.layer, numbers_sha256(row.raw)) for row in rows]
    assert list(found.rows(set())) == []


def test_a_chunk_that_is_no_numbers_is_kept_as_it_was(run, tmp_path, kit):
    def broken(rollout):
        chunk = kit.straight(rollout)
        chunk[:, 3] = np.nan
        return chunk

    (rollout,) = run(broken, ticks=12)
    rows = rows_of(rollout)
    assert rows and all(np.isnan(row.raw).any() for row in rows)
    write_rows(tmp_path / "refused.parquet", RefusedRow, rows)
    back = read_rows(tmp_path / "refused.parquet", RefusedRow)
    assert [numbers_sha256(row.raw) for row in back] == [numbers_sha256(row.raw) for row in rows]
