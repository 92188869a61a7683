"""The cost: the worst condition decides, starts are the draws, and nothing passes unexercised."""

import evidence
import numpy as np
import pandas as pd
import pytest
from asked import asked, settings_of
from editing import cells

from gates.bounds import draws_for_quantile
from gates.evidence import MissingEvidenceError
from gates.proof import judge
from gates.stress import cost
from genpolicy.evidence.stress.state import Outcome
from genpolicy.statistics.intervals import clopper_pearson

ROLLOUTS, INVOCATIONS = "stress/rollouts.parquet", "stress/invocations.parquet"
N = evidence.STARTS


def of(frame):
    return frame["method"] == "flow"


def in_(condition):
    return lambda frame: of(frame) & (frame["perturbation"] == condition)


def flow(root, criterion):
    return asked(root, criterion, "flow", gate="D")


SHARES = {
    "deadline_misses": (cost.deadline_miss_upper, 20),
    "hold_ticks": (cost.hold_share_upper, 160),
    "rejections": (cost.rejection_share_upper, 20),
    "fallback_ticks": (cost.fallback_share_upper, 160),
}


@pytest.mark.parametrize("column", SHARES)
def test_one_bad_condition_decides_however_good_the_pool_is(ladder, column):
    """A third of one condition of three: a ninth of the pool, which the old bound passed."""
    criterion, whole = SHARES[column]
    bad = in_("camera_delay")
    evidence.edit_table(ladder, ROLLOUTS, cells(column, 0, where=of))
    evidence.edit_table(ladder, ROLLOUTS, cells(column, whole // 3, where=bad))
    found = flow(ladder, criterion)
    assert found.value == pytest.approx((whole // 3) / whole, abs=1e-9)
    assert found.caveat.startswith("worst in camera_delay") and "nominal" in found.caveat
    report = judge(ladder, "D")
    assert report.candidates == {"diffusion": "PASS", "flow": "FAIL"}


@pytest.mark.parametrize("column", SHARES)
def test_a_share_that_varies_by_start_is_bounded_over_the_starts(ladder, column):
    criterion, whole = SHARES[column]
    evidence.edit_table(ladder, ROLLOUTS, cells(column, 0, where=of))
    half = lambda f: of(f) & (f["start"] % 2 == 0)  # noqa: E731
    evidence.edit_table(ladder, ROLLOUTS, cells(column, whole, where=half))
    found, exact = flow(ladder, criterion), clopper_pearson(N // 2, N, 0.95)
    assert found.interval == pytest.approx(exact, abs=0.03)
    assert found.value == found.interval[1]
    assert found == flow(ladder, criterion)


def test_none_on_any_start_is_bounded_by_the_number_of_starts(ladder):
    evidence.edit_table(ladder, ROLLOUTS, cells("deadline_misses", 0, where=of))
    assert flow(ladder, cost.deadline_miss_upper).value == clopper_pearson(0, N, 0.95)[1]


def test_the_fallback_is_not_counted_where_it_is_drilled(ladder):
    before = flow(ladder, cost.fallback_share_upper)
    evidence.edit_table(ladder, ROLLOUTS, cells("fallback_ticks", 150, where=in_("recovery_drill")))
    assert flow(ladder, cost.fallback_share_upper) == before
    evidence.edit_table(ladder, ROLLOUTS, cells("fallback_ticks", 150, where=in_("nominal")))
    assert flow(ladder, cost.fallback_share_upper).value > 0.9


def test_a_rollout_without_a_tick_is_missing_evidence_and_one_tick_is_enough(ladder):
    def of_ticks(n):
        for column, value in (("hold_ticks", 0), ("ticks", n)):
            evidence.edit_table(ladder, ROLLOUTS, cells(column, value, where=of))

    of_ticks(1)
    assert flow(ladder, cost.hold_share_upper).value == clopper_pearson(0, N, 0.95)[1]
    of_ticks(0)
    with pytest.raises(MissingEvidenceError, match="no part of ticks"):
        flow(ladder, cost.hold_share_upper)


@pytest.mark.parametrize("ticks", [161, -1])
def test_a_part_that_is_no_part_is_missing_evidence(ladder, ticks):
    evidence.edit_table(ladder, ROLLOUTS, cells("fallback_ticks", ticks, where=of, share=0.01))
    with pytest.raises(MissingEvidenceError, match="no part of ticks"):
        flow(ladder, cost.fallback_share_upper)


@pytest.mark.parametrize(
    ("criterion", "column", "value"),
    [
        (cost.intervention_upper, "interventions", 1),
        (cost.reset_upper, "outcome", "force_stop"),
        (cost.reset_upper, "outcome", "collision"),
    ],
)
def test_people_and_stops_are_exact_and_the_worst_condition_decides(
    ladder, criterion, column, value
):
    evidence.edit_table(ladder, ROLLOUTS, cells("outcome", "success", where=of))
    evidence.edit_table(
        ladder, ROLLOUTS, cells(column, value, where=in_("camera_delay"), share=0.25)
    )
    found = flow(ladder, criterion)
    lower, upper = clopper_pearson(N // 4, N, 0.95)
    assert (found.value, found.interval) == (upper, (lower, upper))
    assert judge(ladder, "D").candidates["flow"] == "FAIL"


def test_a_rollout_that_ran_out_of_time_needs_no_reset_and_one_without_outcome_is_missing(ladder):
    assert set(cost.STOPS) < {str(outcome) for outcome in Outcome}
    evidence.edit_table(ladder, ROLLOUTS, cells("outcome", "timeout", where=of))
    assert flow(ladder, cost.reset_upper).value == clopper_pearson(0, N, 0.95)[1]
    evidence.edit_table(ladder, ROLLOUTS, cells("outcome", "", where=of, share=0.01))
    with pytest.raises(MissingEvidenceError, match="no outcome"):
        flow(ladder, cost.reset_upper)


# -- latency --------------------------------------------------------------------------------------


def test_answers_of_nine_seconds_fail_though_only_one_condition_has_them(ladder):
    slow = lambda f: in_("camera_delay")(f) & (f["invocation"] > 0)  # noqa: E731
    evidence.edit_table(ladder, INVOCATIONS, cells("latency_s", 9.0, where=slow))
    found = [c for c in judge(ladder, "D").criteria if c.id == "latency_p95_s"]
    by_name = {c.candidate: c for c in found}
    assert by_name["flow"].verdict == "FAIL" and by_name["diffusion"].verdict == "PASS"
    assert by_name["flow"].measured == 9.0 and by_name["flow"].threshold == pytest.approx(0.4)


def test_the_upper_end_is_judged_and_not_the_point(ladder):
    """5 % of the answers of each of some starts are late: the point keeps the limit by a hair."""

    def some(frame):
        late = of(frame) & (frame["invocation"] == 5) & (frame["start"] % 20 != 0)
        return frame.assign(latency_s=np.where(late, 0.5, frame["latency_s"]))

    evidence.edit_table(ladder, INVOCATIONS, some)
    found = flow(ladder, cost.latency_p95_s)
    assert found.interval[0] < 0.4 < found.value == 0.5


def test_what_a_distilled_candidate_took_is_said_beside_its_latency(ladder):
    plain = flow(ladder, cost.latency_p95_s)
    evidence.edit_document(ladder, "stress/distilled.json", lambda d: {"flow": d["manicm"]})
    said = flow(ladder, cost.latency_p95_s)
    assert said.value == plain.value and "distilled" not in plain.caveat
    assert "distilled from diffusion cccc" in said.caveat and "2.67 times" in said.caveat
    evidence.replace(ladder, "stress/distilled.json", None)
    assert flow(ladder, cost.latency_p95_s).caveat == plain.caveat


def test_a_rollout_that_states_one_answer_has_one_recorded(ladder):
    """The answers of one rollout are gone, and it states that there was one, not none."""
    one = lambda f: in_("nominal")(f) & (f["start"] == 3)  # noqa: E731
    evidence.edit_table(ladder, INVOCATIONS, lambda f: f[~one(f)])
    evidence.edit_table(ladder, ROLLOUTS, cells("invocations", 1, where=one))
    with pytest.raises(MissingEvidenceError, match="other numbers"):
        flow(ladder, cost.latency_p95_s)


def test_an_answer_at_once_is_an_answer(ladder):
    evidence.edit_table(ladder, INVOCATIONS, cells("latency_s", 0.0, where=of))
    assert flow(ladder, cost.latency_p95_s).value == 0.0


def test_the_cold_invocation_is_said_and_not_judged(ladder):
    cold = lambda f: of(f) & (f["invocation"] == 0)  # noqa: E731
    evidence.edit_table(ladder, INVOCATIONS, cells("latency_s", 30.0, where=cold))
    found = flow(ladder, cost.latency_p95_s)
    assert found.value < 0.1
    assert "cold at most 30 s, beyond the maximum action age of 450 ms" in found.caveat
    evidence.edit_table(ladder, INVOCATIONS, cells("latency_s", 0.45, where=cold))
    assert flow(ladder, cost.latency_p95_s).caveat.endswith("cold at most 450 ms")


def test_where_phases_differ_the_oldest_action_of_any_of_them_counts(ladder):
    ages = {"default": 0.3, "insert": 0.5}
    evidence.write_params(ladder, lambda p: p["execution"].update(maximum_age_s=ages))
    cold = lambda f: of(f) & (f["invocation"] == 0)  # noqa: E731
    evidence.edit_table(ladder, INVOCATIONS, cells("latency_s", 0.51, where=cold))
    assert "beyond the maximum action age of 500 ms" in flow(ladder, cost.latency_p95_s).caveat


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (lambda f: f[~((f["method"] == "flow") & (f["start"] == 3))], "other numbers"),
        (lambda f: f[~((f["method"] == "flow") & (f["invocation"] == 9))], "other numbers"),
        (lambda f: f.assign(latency_s=-f["latency_s"]), "clocks are wrong"),
    ],
)
def test_invocations_left_out_are_missing_evidence(ladder, change, text):
    evidence.edit_table(ladder, INVOCATIONS, change)
    with pytest.raises(MissingEvidenceError, match=text):
        flow(ladder, cost.latency_p95_s)


# -- force ----------------------------------------------------------------------------------------


def test_a_force_is_judged_at_the_upper_end_in_the_worst_condition(ladder):
    # Peaks are 5.0 + 0.1 * start; of 80 values the largest bounds a p95.
    found = flow(ladder, cost.force_peak_p95_n)
    assert found.value == pytest.approx(5.0 + 0.1 * (N - 1)) and found.interval[0] < found.value
    evidence.edit_table(
        ladder, ROLLOUTS, cells("force_peak_n", 85.0, where=in_("camera_delay"), share=0.04)
    )
    found = flow(ladder, cost.force_peak_p95_n)
    assert found.value == 85.0 and found.caveat.startswith("worst in camera_delay")


def test_a_policy_that_hardly_ever_touches_shows_nothing_about_force(ladder):
    evidence.edit_table(ladder, ROLLOUTS, cells("force_peak_n", 0.0, where=of))
    with pytest.raises(MissingEvidenceError, match="hardly exercised: contact on 0 of 80"):
        flow(ladder, cost.force_peak_p95_n)
    report = judge(ladder, "D")
    assert report.candidates == {"diffusion": "PASS", "flow": "INCONCLUSIVE"}
    fewest = draws_for_quantile(0.95, settings_of(ladder, "D").confidence)
    touched = lambda f: in_("camera_delay")(f) & (f["start"] < fewest)  # noqa: E731
    evidence.edit_table(ladder, ROLLOUTS, cells("force_peak_n", 7.0, where=touched))
    assert flow(ladder, cost.force_peak_p95_n).value == 7.0
    one_less = lambda f: of(f) & (f["start"] == 0)  # noqa: E731
    evidence.edit_table(ladder, ROLLOUTS, cells("force_peak_n", 0.0, where=one_less))
    with pytest.raises(MissingEvidenceError, match="contact on 71 of 80"):
        flow(ladder, cost.force_peak_p95_n)


def test_a_force_is_never_negative(ladder):
    evidence.edit_table(ladder, ROLLOUTS, cells("force_peak_n", -1.0, where=of, share=0.01))
    with pytest.raises(MissingEvidenceError, match="negative"):
        flow(ladder, cost.force_peak_p95_n)


def test_a_rollout_that_asked_nothing_has_nothing_recorded(ladder):
    """It states no invocation, and none is recorded: that is the same number."""
    none = lambda f: in_("nominal")(f) & (f["start"] == 3)  # noqa: E731
    before = flow(ladder, cost.latency_p95_s).value
    evidence.edit_table(ladder, INVOCATIONS, lambda f: f[~none(f)])
    evidence.edit_table(ladder, ROLLOUTS, cells("invocations", 0, where=none))
    found = flow(ladder, cost.latency_p95_s)
    assert found.value == before
    assert f"1 of {N} rollouts in nominal without any invocation" in found.caveat


def test_of_no_invocation_no_share_is_known_and_no_answer_is_timed(ladder):
    """Every picture is lost in one condition: counted and without a verdict, and no crash.

    Nobody commands there but the fallback, as where it is drilled, which is no cost of a candidate.
    """
    none = in_("recovery_drill")
    evidence.edit_table(ladder, INVOCATIONS, lambda f: f[~none(f)])
    for column in ("invocations", "deadline_misses", "rejections"):
        evidence.edit_table(ladder, ROLLOUTS, cells(column, 0, where=none))
    evidence.edit_table(ladder, ROLLOUTS, cells("fallback_ticks", 152, where=none))
    said = f"{N} of {N} rollouts in recovery_drill without any invocation"
    for share in (cost.deadline_miss_upper, cost.rejection_share_upper):
        with pytest.raises(MissingEvidenceError, match=said):
            flow(ladder, share)
    with pytest.raises(MissingEvidenceError, match="no warm invocation in recovery_drill"):
        flow(ladder, cost.latency_p95_s)
    assert judge(ladder, "D").candidates["flow"] == "INCONCLUSIVE"


def test_without_a_cold_answer_none_is_said_to_be_slow(ladder):
    evidence.edit_table(ladder, INVOCATIONS, lambda f: f.assign(invocation=f["invocation"] + 1))
    assert "cold at most 0 s" in flow(ladder, cost.latency_p95_s).caveat


def test_the_point_that_is_said_is_the_share_of_the_pool(ladder):
    """Two misses of twenty on half of the starts: one of twenty in all."""
    half = lambda f: of(f) & (f["start"] % 2 == 0)  # noqa: E731
    evidence.edit_table(ladder, ROLLOUTS, cells("deadline_misses", 2, where=half))
    assert (
        ": 5 % (80 of 1,600 invocations), at most" in flow(ladder, cost.deadline_miss_upper).caveat
    )


@pytest.mark.parametrize(
    ("criterion", "column", "value"),
    [(cost.intervention_upper, "interventions", 1), (cost.reset_upper, "outcome", "collision")],
)
def test_a_start_that_is_hit_under_one_seed_counts_against_it(ladder, criterion, column, value):
    """One start of eighty, under one of two seeds: half a start is one, not none."""

    def two(frame):
        first = frame.assign(**{column: frame[column].mask(of(frame), type(value)())})
        if column == "outcome":
            first = frame.assign(outcome=frame["outcome"].mask(of(frame), "timeout"), success=False)
        hit = of(first) & (first["start"] == 3) & (first["perturbation"] == "nominal")
        second = first[of(first)].assign(seed=1)
        return pd.concat([first.assign(**{column: first[column].mask(hit, value)}), second])

    evidence.edit_table(ladder, ROLLOUTS, two)
    assert flow(ladder, criterion).interval == clopper_pearson(1, N, 0.95)


def test_the_time_of_people_is_said_for_each_success(ladder):
    own = lambda f: f["method"] == "flow"  # noqa: E731
    before = asked(ladder, cost.intervention_upper, "flow", gate="D")
    assert "people had the arm" not in before.caveat
    evidence.edit_table(ladder, ROLLOUTS, cells("person_s", 0.5, where=own))
    rows = evidence.read_table(ladder / "artifacts" / ROLLOUTS).to_pandas()
    mine = rows[rows["method"] == "flow"]
    found = asked(ladder, cost.intervention_upper, "flow", gate="D")
    each = 0.5 * len(mine) / mine["success"].sum()
    assert found.value == before.value
    assert f"for {each:.3g} s for each of {mine['success'].sum()} successes" in found.caveat
    evidence.edit_table(ladder, ROLLOUTS, cells("person_s", -1.0, where=own, share=0.01))
    with pytest.raises(MissingEvidenceError, match="less than no time"):
        asked(ladder, cost.intervention_upper, "flow", gate="D")
