"""Modes at the chosen NFE: what covers a mode, what lies outside, over which draws."""

import evidence
import pytest
from asked import found_in, red
from editing import cells

from gates.proof import judge
from genpolicy.statistics.intervals import clopper_pearson

MODES = "reload/modes.parquet"
EARLIER = "reload/modes_earlier.parquet"


def test_a_noisy_point_policy_that_samples_between_the_modes_is_red(ladder):
    """Every mode is reached, with admissible samples enough, and 45 % lie between."""
    for table in (MODES, EARLIER):
        evidence.edit_table(
            ladder, table,
            lambda f: f.assign(
                samples=20, modes_covered=2, between_modes=9, admissible=8, fewest_admissible=4
            ),
        )  # fmt: skip
    report = judge(ladder, "B")
    assert red(report) == {"outside_modes_upper"}
    assert "45 % (270 of 600 samples)" in found_in(report, "outside_modes_upper")[0].caveat


def test_samples_far_from_every_mode_lie_outside_as_well(ladder):
    evidence.edit_table(ladder, MODES, cells("far_from_modes", 14))
    assert red(judge(ladder, "B")) == {"outside_modes_upper"}
    evidence.edit_table(ladder, MODES, cells("far_from_modes", 6))
    report = judge(ladder, "B")
    assert (report.verdict, red(report)) == ("INCONCLUSIVE", set())


@pytest.mark.parametrize(("fewest", "passes"), [(0, False), (1, False), (2, True)])
def test_a_mode_counts_from_its_share_of_admissible_samples_on(ladder, fewest, passes):
    """Reached by half of the samples, a mode whose samples may not be executed is lost: 2 of 16."""
    evidence.edit_table(ladder, MODES, cells("fewest_admissible", fewest))
    report = judge(ladder, "B")
    assert (report.verdict == "PASS") is passes
    assert red(report) == (set() if passes else {"mode_coverage_lower"})
    caveat = found_in(report, "mode_coverage_lower")[0].caveat
    share = "100 % (30" if passes else "0 % (none"
    assert f"in {share} of 30 two-mode situations) every mode gets" in caveat


def test_situations_of_one_episode_are_one_draw_of_the_coverage(ladder):
    """One situation a phase: thirty of ten episodes bound the share as ten draws do."""

    def shared(frame):
        return frame.assign(episode_uuid=[f"e{i % 10}" for i in frame["index"]])

    evidence.edit_table(
        ladder, "audit/neighbourhoods.parquet",
        lambda f: shared(f).assign(phase=[f"phase {i // 10}" for i in f["index"]]),
    )  # fmt: skip
    evidence.edit_table(ladder, MODES, shared)
    found = found_in(judge(ladder, "B"), "mode_coverage_lower")[0]
    lower, upper = clopper_pearson(10, 10, 0.95)
    assert found.interval == pytest.approx((lower, upper))
    assert "lower bound over 10 episodes" in found.caveat


def test_the_worst_training_seed_decides(ladder):
    def second_seed(frame):
        other = frame.assign(seed=1, fewest_admissible=0, between_modes=12)
        return evidence.pd.concat([frame, other], ignore_index=True)

    evidence.edit_table(ladder, MODES, second_seed)
    assert red(judge(ladder, "B")) == {"mode_coverage_lower", "outside_modes_upper"}


def test_modes_counted_at_another_nfe_say_nothing(ladder):
    evidence.edit_table(ladder, MODES, cells("nfe", 4))
    report = judge(ladder, "B")
    assert report.verdict == "INCONCLUSIVE"
    assert "chosen NFE" in found_in(report, "mode_coverage_lower")[0].caveat


def test_modes_beyond_what_an_adaptive_solver_may_take_say_nothing(ladder):
    evidence.edit_table(ladder, "reload/nfe.parquet", lambda f: f.assign(least=4, most=61))
    evidence.edit_table(ladder, MODES, cells("nfe", 64))
    report = judge(ladder, "B")
    assert "chosen NFE" in found_in(report, "mode_coverage_lower")[0].caveat


def test_the_seed_of_the_lowest_bound_is_told_with_its_own_numbers(ladder):
    """The second covers less, although its single samples reach more."""

    def second(frame):
        few = frame["index"].isin(evidence.NAMED[::3])
        other = frame.assign(seed=1, fewest_admissible=frame["fewest_admissible"].mask(few, 1))
        first = frame.assign(modes_covered=1)
        return evidence.pd.concat([first, other], ignore_index=True)

    evidence.edit_table(ladder, MODES, second)
    found = found_in(judge(ladder, "B"), "mode_coverage_lower")[0]
    assert found.interval == pytest.approx(clopper_pearson(20, 30, 0.95))
    assert found.caveat.startswith("in 66.7 % (20 of 30 two-mode situations)")
    assert "reaches every mode in 100 %" in found.caveat
