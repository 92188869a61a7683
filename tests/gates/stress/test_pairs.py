"""Pairs by start: conditions and seeds are one number, and unshared starts are missing evidence."""

import evidence
import numpy as np
import pytest
from asked import settings_of

from gates.evidence import Evidence, MissingEvidenceError
from gates.stress.pairs import paired_by_condition, paired_differences, worth_by_start

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

    means = worth_by_start(*edit(ladder, change), "flow")
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


def test_pairs_of_the_conditions_average_to_those_of_the_starts(ladder):
    def change(frame):
        lost = (frame["method"] == "flow") & (frame["perturbation"] == "nominal")
        return frame.assign(success=frame["success"] & ~(lost & (frame["start"] % 3 == 0)))

    reader, settings = edit(ladder, change)
    found = paired_by_condition(reader, settings, "flow", "bc")
    assert list(found) == list(evidence.CONDITIONS)
    assert {pairs.shape for pairs in found.values()} == {(evidence.STARTS,)}
    assert found["nominal"].mean() < found["envelope"].mean()
    mean = np.mean(list(found.values()), axis=0)
    np.testing.assert_allclose(mean, paired_differences(reader, settings, "flow", "bc"))


def test_starts_that_are_not_shared_in_one_condition_are_missing_there(ladder):
    def change(frame):
        other = (frame["method"] == "bc") & (frame["perturbation"] == "envelope")
        return frame.assign(start=frame["start"] + 20 * other)

    with pytest.raises(MissingEvidenceError, match="only 60 starts are shared with bc in envelope"):
        paired_by_condition(*edit(ladder, change), "flow", "bc")
