"""What a person reads of a plan."""

from gates.plan_text import plan_text
from gates.planned_blocks import Saved
from gates.planned_power import Gain, Stated
from gates.planning import Bound, Plan

SIMPLE = ("bc", "act", "classical_planner")


def made(
    *bounds, gains=(), needed=77, graded=0, further=(0, 0), probed=0, searched=0, weighed="",
    simple=SIMPLE, saved=(),
):  # fmt: skip
    return Plan(
        starts=90, methods=8, simple=simple, conditions=("nominal", "push"),
        candidates=("diffusion", "flow"),
        rollouts=12_600, graded_rollouts=graded, further_seeds=further[0],
        further_rollouts=further[1], probe_rollouts=probed,
        searched_rollouts=searched, longest_s=63_000.0,
        measure="utility" if weighed else "success", weighed=weighed, margin=0.05, alpha=0.0125,
        power=0.8, bounds=bounds, gains=gains,
        stated=Stated(0.5, 0.8, 0.86, needed, 0.4 if weighed else None, 5, 0.57),
        block=15 if saved else None, saved=saved,
    )  # fmt: skip


def test_golden_what_a_person_reads_of_a_plan():
    """Written by hand: a mark, a column as wide as the longest name, and lines of 80 that hang."""
    long = "none of 90 bounds it by 0.0324 only, whatever is done and however often it is run"
    text = plan_text(made(
        Bound("kept", True, "up to 3 of 90"), Bound("never_kept", False, long),
        Bound("open", None, "declared not applicable"),
        gains=(Gain(0.1, 0.29, 0.81), Gain(0.95, None, 0.34)),
    ))  # fmt: skip
    assert text.splitlines() == [
        "90 starts of 8 methods in 2 conditions: 12,600 rollouts,",
        "at most 17.5 h of virtual time",
        "2 registered candidates, each at alpha 0.0125; margin 0.05",
        "",
        "The stated effect: success 80% against 50% (stress.planned_effect)",
        "  found in 86% of trials with 90 starts; in 80% from about 77 starts on",
        "  in 57% if all 5 simple methods are worth 50%",
        "",
        "To beat, each by the margin: bc, act, classical_planner",
        "",
        "What these starts can show",
        "  kept        up to 3 of 90",
        "! never_kept  none of 90 bounds it by 0.0324 only, whatever is done and however",
        "              often it is run",
        "? open        declared not applicable",
        "",
        "Smallest gain that is found in 80% of trials with 90 starts",
        "  baseline 10%: 19 points, a candidate of 29%",
        "  baseline 95%: none; a candidate that never fails in 34% only",
        "",
        "Gate D would be INCONCLUSIVE whatever the rollouts show: never_kept. Plan more",
        "starts (stress.starts) before any is run.",
    ]


def test_a_plan_that_can_be_decided_warns_of_nothing():
    for plan in (made(), made(Bound("kept", True, "x"), Bound("open", None, "y"))):
        assert "INCONCLUSIVE" not in plan_text(plan) and plan.undecidable == ()
    found = made(Bound("kept", True, "x"), Bound("b", False, "y"), Bound("a", False, "z"))
    assert found.undecidable == found.as_document()["undecidable"] == ("b", "a")


def test_what_is_run_beside_the_comparison_is_said_apart():
    lines = plan_text(
        made(graded=5_400, further=(2, 32_400), probed=176, searched=1_920)
    ).splitlines()
    assert lines[1:6] == [
        "5,400 beside them of graded sizes (stress.severities),",
        "32,400 beside them by further training seeds, 2 of them (policy.seeds),",
        "up to 176 after them for the monitors (monitors),",
        "up to 1,920 behind the gate for failures (card.failure_search),",
        "at most 17.5 h of virtual time",
    ]


def test_a_broken_test_is_a_fail_and_no_question_of_more_starts():
    broken = Bound("power", False, "x", fails=True)
    assert plan_text(made(broken)).splitlines()[-3:] == [
        "",
        "Gate D would be a FAIL whatever the rollouts show: power. The test promotes",
        "without a gain, which more starts do not mend.",
    ]
    both = plan_text(made(broken, Bound("cost", False, "y")))
    assert "INCONCLUSIVE" not in both
    assert "Not to be shown either: cost. Plan more starts" in both


def test_what_is_compared_is_said_where_it_is_not_success():
    lines = plan_text(made(weighed="duration 0.2, fallback 0.1")).splitlines()
    assert lines[4] == "The stated effect: utility 80% against 50% (stress.planned_effect)"
    said = " ".join(lines[10:15])
    assert said.startswith("Compared is utility: a success less duration 0.2, fallback 0.1, each")
    assert "it is found in 40%." in said
    assert "utility" not in plan_text(made())


def test_a_plan_without_the_planner_says_that_none_is_compared():
    assert "by the margin: bc; no classical_planner: none is compared" in plan_text(
        made(simple=("bc",))
    )


def test_golden_what_blocks_save_stands_behind_the_gains():
    saved = (Saved("without a gain", 0.5, 0.766, 0.93), Saved("at the margin", 0.55, 0.9, 0.5))
    lines = plan_text(made(saved=saved)).splitlines()
    assert lines[-5:] == [
        "",
        "Stopped where it can no longer pass, asked every 15 starts (stress.block):",
        "  without a gain, 50%: runs 77% of the starts on average, stopped in 93%",
        "  at the margin, 55%: runs 90% of the starts on average, stopped in 50%",
        "  and whoever stays in, with the simple methods beside it, runs them all",
    ]
    assert all(len(line) <= 80 for line in lines)
    assert "stress.block" not in plan_text(made())
