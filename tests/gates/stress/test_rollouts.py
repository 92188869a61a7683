"""Rollouts of the comparison: every planned condition and start, or no verdict."""

import evidence
import pandas as pd
import pytest
from asked import asked, settings_of
from editing import cells
from pydantic import ValidationError

from gates.evidence import Evidence, MissingEvidenceError
from gates.recount import AtLeast, Subset
from gates.stress.rollouts import (
    StressSettings,
    in_every_condition,
    rollouts,
    success_lower,
    within,
)
from gates.stress.trial import unmatched_starts
from genpolicy.statistics.intervals import clopper_pearson

TABLE = "stress/rollouts.parquet"


def of(root, method="flow"):
    return rollouts(Evidence(root), settings_of(root, "D"), method)


def test_all_planned_conditions_of_one_method_and_no_others(ladder):
    evidence.edit_table(
        ladder, TABLE, lambda f: pd.concat([f, f[:10].assign(method="flow", perturbation="storm")])
    )
    rows = of(ladder)
    assert len(rows) == evidence.STARTS * len(evidence.CONDITIONS)
    assert set(rows["method"]) == {"flow"} and set(rows["perturbation"]) == set(evidence.CONDITIONS)


def test_a_condition_that_was_not_met_is_named(ladder):
    evidence.edit_table(ladder, TABLE, lambda f: f[f["perturbation"] != "camera_delay"])
    with pytest.raises(MissingEvidenceError, match="flow did not meet camera_delay"):
        of(ladder)


def test_one_start_less_in_one_condition_is_named(ladder):
    def less(frame):
        gone = (frame["perturbation"] == "camera_delay") & (frame["start"] == 3)
        return frame[~gone]

    evidence.edit_table(ladder, TABLE, less)
    with pytest.raises(MissingEvidenceError, match="79 starts in camera_delay, planned 80"):
        of(ladder)


def test_the_lowest_bound_over_the_conditions_decides_and_the_starts_are_the_trials(ladder):
    settings = settings_of(ladder, "D")

    def spoil(frame):
        hit = (frame["perturbation"] == "camera_delay") & (frame["method"] == "flow")
        ten = hit & (frame["start"] < 60)
        return frame.assign(success=(frame["success"] | hit) & ~ten)

    evidence.edit_table(ladder, TABLE, spoil)
    found = success_lower(Evidence(ladder), settings, "flow", evidence.CONDITIONS)
    assert (found.value, found.interval[1]) == clopper_pearson(20, 80, settings.confidence)
    assert found.caveat.startswith("camera_delay: 25 % (20 of 80 rollouts) succeed; at least 1")
    undisturbed = success_lower(Evidence(ladder), settings, "flow", ("nominal",))
    assert undisturbed.value > found.value


def test_a_count_of_starts_that_is_no_whole_number_is_rounded_down(ladder):
    """Two rollouts of a start count half each: eleven halves are five starts of eighty, not six."""

    def spoil(frame):
        nominal = (frame["perturbation"] == "nominal") & (frame["method"] == "flow")
        twice = frame[nominal].assign(seed=frame["seed"] + 1)
        won = twice["start"] < 11
        lost = frame.assign(success=frame["success"] & ~nominal)
        frame = pd.concat([lost, twice.assign(success=won)])
        ended = frame["outcome"].where(frame["success"], "failed").mask(frame["success"], "success")
        return frame.assign(outcome=ended)

    settings = settings_of(ladder, "D")
    evidence.edit_table(ladder, TABLE, spoil)
    rows = of(ladder)
    assert len(rows[rows["perturbation"] == "nominal"]) == 2 * evidence.STARTS
    found = success_lower(Evidence(ladder), settings, "flow", ("nominal",))
    assert found.value == clopper_pearson(5, evidence.STARTS, settings.confidence)[0]


def test_a_rollout_without_outcome_is_missing_evidence(ladder):
    first = lambda frame: (frame["method"] == "flow") & (frame["start"] == 0)  # noqa: E731
    evidence.edit_table(ladder, TABLE, cells("success", None, where=first))
    with pytest.raises(MissingEvidenceError, match="empty cells in column success"):
        success_lower(Evidence(ladder), settings_of(ladder, "D"), "flow", ("nominal",))


def test_the_highest_bound_of_all_conditions_is_judged_and_the_others_are_said():
    rows = pd.DataFrame(
        {"perturbation": ["calm", *3 * ["storm"]], "start": [0, 0, 1, 1], "value": [1.0, 2, 3, 2.5]}
    )

    def measure(part, subset, condition):
        assert subset == within("rollouts", condition)
        interval = part["value"].mean(), 0.0, part["value"].max()
        return interval, subset.counted(part)

    of = Subset("rollouts")
    found = in_every_condition(rows, of, ("calm", "storm"), measure, "{:g} N".format)
    assert (found.value, found.interval) == (3.0, (0.0, 3.0))
    assert found.caveat == "worst in storm: 2.5 N, at most 3 N; at most in the others: calm 1 N"
    assert found.counted == "2 starts"
    assert found.recount.where == ("perturbation = storm",) and found.recount.whole == 3.0


def test_what_counts_in_a_condition_is_what_its_recount_says():
    rows = pd.DataFrame({"perturbation": 3 * ["calm"], "start": [0, 1, 2], "value": [0.0, 2, 3]})

    def measure(part, subset, condition):
        return (part["value"].mean(), 0.0, part["value"].max()), subset.counted(part)

    of = Subset("rollouts", (AtLeast("value", 2),))
    found = in_every_condition(rows, of, ("calm",), measure, "{:g} N".format)
    assert (found.point, found.counted) == (2.5, "2 starts")
    assert found.recount.where == ("perturbation = calm", "value >= 2")
    assert found.recount.whole == 2.0


def test_the_undisturbed_condition_alone_is_no_comparison(ladder):
    known = settings_of(ladder, "D").model_dump()
    for names in (("nominal",), ("camera_delay", "network_jitter"), ()):
        with pytest.raises(ValidationError, match="at least one more condition"):
            StressSettings.model_validate(known | {"perturbations": names})


@pytest.mark.parametrize(
    ("name", "outside", "inside"),
    [("margin", (-1.0, 1.0), (-0.99, 0.99)), ("family_alpha", (0.0, 1.0), (0.01, 0.99)),
     ("planned_starts", (0,), (1,)), ("execution_horizon", (0,), (1,)),
     ("action_period_s", (0.0,), (0.001,)), ("candidates", ((),), (("flow",),)),
     ("baselines", ((),), (("bc",),)),
     ("perturbations", (("nominal",),), (("nominal", "camera_delay"),))],
)  # fmt: skip
def test_a_setting_on_its_border_is_refused_and_one_inside_is_taken(ladder, name, outside, inside):
    known = settings_of(ladder, "D").model_dump()
    for value in inside:
        assert getattr(StressSettings.model_validate(known | {name: value}), name) == value
    for value in outside:
        with pytest.raises(ValidationError, match=name):
            StressSettings.model_validate(known | {name: value})


def test_a_chunk_is_of_use_as_long_as_it_has_an_action(ladder):
    settings = settings_of(ladder, "D")
    assert settings.usable_s == pytest.approx(8 * 0.05)
    assert settings.alpha == pytest.approx(settings.family_alpha / 2)


def test_more_starts_than_planned_are_read_and_are_no_trial(ladder):
    """As long a trial as is needed until it comes out right: the starts are those of the plan."""
    evidence.write_params(ladder, lambda params: params["stress"].update(starts=79))
    assert of(ladder)["start"].nunique() == 80
    with pytest.raises(MissingEvidenceError, match="1 starts lack or nobody planned them"):
        asked(ladder, unmatched_starts, "flow", gate="D")
