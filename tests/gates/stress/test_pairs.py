"""Pairs by start: conditions and seeds are one number, and unshared starts are missing evidence."""

import evidence
import numpy as np
import pytest
from asked import settings_of

from gates.evidence import Evidence, MissingEvidenceError
from gates.stress.pairs import paired_differences, success_by_start

TABLE = "stress/rollouts.parquet"


def edit(root, change):
    evidence.edit_table(root, TABLE, change)
    return Evidence(root), settings_of(root, "D")


def test_conditions_and_seeds_of_a_start_are_one_number(ladder):
    def change(frame):
        second = frame[frame["method"] == "flow"].assign(seed=1, success=False, outcome="timeout")
        own = (frame["method"] == "flow") & (frame["start"] == 4)
        ended = frame["outcome"].mask(own, "success")
        first = frame.assign(success=frame["success"] | own, outcome=ended)
        return type(frame)(np.vstack([first, second]), columns=frame.columns).astype(frame.dtypes)

    means = success_by_start(*edit(ladder, change), "flow")
    assert list(means.index) == list(range(evidence.STARTS))
    assert means[4] == pytest.approx(0.5)  # one seed succeeds everywhere, the other nowhere


def test_pairs_are_differences_of_the_same_start(ladder):
    def change(frame):
        flow, bc = frame["method"] == "flow", frame["method"] == "bc"
        wins = (flow & (frame["start"] == 7)) | (bc & (frame["start"] == 9))
        return frame.assign(success=np.where(flow | bc, wins, frame["success"]))

    found = paired_differences(*edit(ladder, change), "flow", "bc")
    assert found.shape == (evidence.STARTS,)
    assert np.flatnonzero(found).tolist() == [7, 9] and found[[7, 9]].tolist() == [1.0, -1.0]


def test_starts_that_are_not_shared_are_missing_evidence(ladder):
    def change(frame):
        other = frame["method"] == "bc"
        return frame.assign(start=frame["start"] + 20 * other)

    with pytest.raises(MissingEvidenceError, match="only 60 starts are shared with bc"):
        paired_differences(*edit(ladder, change), "flow", "bc")
