"""What arrives at the stub: observations are the trials, and no action is lost."""

import evidence
import pandas as pd
import pytest
from asked import asked, found_in
from editing import cells

from gates.evidence import MissingEvidenceError
from gates.feasibility.arrivals import (
    at_the_stub,
    conservation_error,
    stub_invalid,
    stub_stale,
    stub_violation_upper,
    unaccounted,
)
from gates.proof import judge
from genpolicy.statistics.intervals import clopper_pearson

STUB = "shadow/stub.parquet"


def of(frame):
    return frame["method"] == "flow"


def bound(root):
    return asked(root, stub_violation_upper, "flow", gate="C")


def test_a_bad_arrival_is_one_of_the_observations_and_not_of_the_rows(ladder):
    """Eight actions of one chunk arrive together: 400 observations are 400 trials, not 5400."""
    assert bound(ladder).value == clopper_pearson(0, 400, 0.95)[1]
    evidence.edit_table(ladder, STUB, cells("stale", 1, where=of, share=0.01))
    assert bound(ladder).value == clopper_pearson(1, 400, 0.95)[1]
    assert "1 of 400 observations" in bound(ladder).caveat


def test_too_few_observations_are_no_proof_of_a_small_share_and_no_failure(ladder):
    evidence.edit_table(ladder, STUB, cells("delivered", 120, where=of))
    report = judge(ladder, "C")
    found = next(c for c in found_in(report, "stub_violation_upper") if c.candidate == "flow")
    assert (found.verdict, found.measured) == ("INCONCLUSIVE", None)
    assert "none bad of 120 observations" in found.caveat and "3.03 %" in found.caveat
    evidence.edit_table(ladder, STUB, cells("delivered", 0, where=of))
    assert judge(ladder, "C").candidates["flow"] == "INCONCLUSIVE"
    # One that is bad among 120 is no want of evidence.
    evidence.edit_table(ladder, STUB, cells("delivered", 120, where=of))
    evidence.edit_table(ladder, STUB, cells("invalid", 1, where=of, share=0.01))
    assert judge(ladder, "C").candidates["flow"] == "FAIL"


def test_kinds_are_counted_together_and_nothing_that_arrived_is_no_answer():
    rows = pd.DataFrame({"arrivals": [8, 0, 16], "stale": [1, 0, 2], "invalid": [0, 0, 4]})
    assert at_the_stub(rows, "stale", "invalid") == (7, 24)
    assert at_the_stub(rows.iloc[::-1], "stale") == (3, 24)
    with pytest.raises(MissingEvidenceError, match="nothing arrived"):
        at_the_stub(rows.iloc[1:2], "stale")
    with pytest.raises(MissingEvidenceError, match="corrupt evidence"):
        at_the_stub(rows.assign(stale=[1, 0, -2]), "stale")


def _runs(**changes):
    """Two fixtures: 24 generated of which 16 executed, and 8 discarded for two reasons."""
    runs = {
        "fixture": ["a", "a", "b"], "generated": [24, 24, 8], "executed": [16, 16, 8],
        "queued": [0, 0, 0], "count": [5, 3, 0],
    }  # fmt: skip
    return pd.DataFrame(runs | changes)


def test_what_is_lost_in_one_run_is_not_made_good_by_what_appears_in_another():
    assert unaccounted(_runs(), ["fixture"]) == 0
    assert unaccounted(_runs(count=[5, 2, 0]), ["fixture"]) == 1
    assert unaccounted(_runs(count=[5, 2, 1]), ["fixture"]) == 2
    assert unaccounted(_runs(count=[5, 2, 1]).iloc[::-1], ["fixture"]) == 2


@pytest.mark.parametrize(
    ("changes", "why"),
    [({"executed": [16, 15, 8]}, "several totals"), ({"count": [9, -1, 0]}, "corrupt evidence")],
)
def test_totals_that_differ_or_count_below_zero_are_missing_evidence(changes, why):
    with pytest.raises(MissingEvidenceError, match=why):
        unaccounted(_runs(**changes), ["fixture"])


def test_none_bad_is_shown_up_to_the_limit_itself(ladder):
    upper = clopper_pearson(0, 400, 0.95)[1]
    for limit, shown in ((upper, True), (0.999 * upper, False)):
        evidence.write_params(ladder, evidence.set_limit("gate_c", "stub_violation_upper", limit))
        if shown:
            assert bound(ladder).value == upper
        else:
            with pytest.raises(MissingEvidenceError, match="none bad of 400"):
                bound(ladder)


def test_one_observation_is_some_and_no_more_are_bad_than_there_are(ladder):
    evidence.edit_table(ladder, STUB, cells("delivered", 1, where=of))
    evidence.edit_table(ladder, STUB, cells("stale", 9, where=of))
    assert bound(ladder).value == 1.0


def test_a_candidate_that_generated_nothing_shows_nothing(ladder):
    names = ("generated", "executed", "queued", "count")
    evidence.edit_table(
        ladder, "shadow/counts.parquet", lambda f: f.assign(**dict.fromkeys(names, 0))
    )
    with pytest.raises(MissingEvidenceError, match="nothing was generated"):
        asked(ladder, conservation_error, "flow", gate="C")

    def one(frame):
        """One action of one fixture, executed; all others have rows and generated nothing."""
        only = of(frame) & (frame["fixture"] == "held_out")
        return frame.assign(generated=only.astype(int), executed=only.astype(int))

    evidence.edit_table(ladder, "shadow/counts.parquet", one)
    assert asked(ladder, conservation_error, "flow", gate="C").value == 0.0


@pytest.mark.parametrize("name", ["generated", "executed", "queued", "count"])
def test_each_part_of_the_balance_counts(name):
    one_more = [n + (place == 2) for place, n in enumerate(_runs()[name])]
    assert unaccounted(_runs(**{name: one_more}), ["fixture"]) == 1


@pytest.mark.parametrize("fixture", ["held_out", "stale_observation"])
@pytest.mark.parametrize(
    ("criterion", "table"),
    [(stub_stale, "stub"), (stub_invalid, "stub"), (stub_violation_upper, "stub"),
     (conservation_error, "counts")],
)  # fmt: skip
def test_a_fixture_of_which_nothing_is_counted_gives_no_verdict(ladder, criterion, table, fixture):
    """What arrived of the fixture that was to be refused is in the rows that are not there."""
    path = f"shadow/{table}.parquet"
    evidence.edit_table(ladder, path, lambda f: f[f["fixture"] != fixture])
    with pytest.raises(MissingEvidenceError, match=f"nothing is counted of {fixture}"):
        asked(ladder, criterion, "flow", gate="C")


def test_one_arrival_is_some():
    rows = pd.DataFrame({"arrivals": [1], "stale": [1], "invalid": [0]})
    assert at_the_stub(rows, "stale", "invalid") == (1, 1)
