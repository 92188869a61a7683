"""Gate D: pairs by start, the least evidence over the baselines, and who is promoted."""

import evidence
import numpy as np
import pytest
from asked import asked, settings_of

from gates.evidence import Evidence, MissingEvidenceError
from gates.proof import judge
from gates.stress.gate import (
    best_baseline,
    paired_differences,
    promotion_e_value,
    success_by_start,
)
from genpolicy.statistics.eprocess import paired_e_value

TABLE = "stress/rollouts.parquet"


def edit(root, change):
    evidence.edit_table(root, TABLE, change)
    return Evidence(root), settings_of(root, "D")


def test_conditions_and_seeds_of_a_start_are_one_number(ladder):
    def change(frame):
        second = frame[frame["method"] == "flow"].assign(seed=1, success=False)
        own = (frame["method"] == "flow") & (frame["start"] == 4)
        first = frame.assign(success=frame["success"] | own)
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


def test_the_baseline_against_which_there_is_least_evidence_decides(ladder):
    better = lambda f: f.assign(  # noqa: E731
        success=f["success"] | ((f["method"] == "chunked_bc") & (f["start"] % 5 == 0))
    )
    _, settings = edit(ladder, better)
    values = {
        name: paired_e_value(
            paired_differences(Evidence(ladder), settings, "flow", name),
            margin=settings.margin, alpha=settings.alpha,
        ).e_value
        for name in settings.baselines
    }  # fmt: skip
    found = asked(ladder, promotion_e_value, "flow", gate="D")
    assert found.value == min(values.values())
    assert min(values, key=values.get) == "chunked_bc" and "against chunked_bc" in found.caveat


def test_the_best_baseline_is_the_first_of_equals_and_never_a_candidate(ladder):
    every = lambda frame: frame.assign(success=True)  # noqa: E731
    reader, settings = edit(ladder, every)
    assert best_baseline(reader, settings) == settings.baselines[0]
    last = settings.baselines[-1]
    only = lambda frame: frame.assign(success=~frame["method"].isin(settings.baselines[:-1]))  # noqa: E731
    assert best_baseline(*edit(ladder, only)) == last


def test_of_two_that_pass_the_one_with_more_evidence_is_promoted(ladder):
    report = judge(ladder, "D")
    passed = [name for name, verdict in report.candidates.items() if verdict == "PASS"]
    found = {c.candidate: c.measured for c in report.criteria if c.id == promotion_e_value.id}
    best = min(passed, key=lambda name: (-found[name], name))
    assert report.promoted == best and report.decision == f"promote {best}, this checkpoint only"


def test_starts_that_are_not_shared_are_missing_evidence(ladder):
    def change(frame):
        other = frame["method"] == "bc"
        return frame.assign(start=frame["start"] + 20 * other)

    with pytest.raises(MissingEvidenceError, match="only 20 starts are shared with bc"):
        paired_differences(*edit(ladder, change), "flow", "bc")
