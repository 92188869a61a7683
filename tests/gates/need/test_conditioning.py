"""Conditioning: only significant strata count, the phase takes modes away or nothing does."""

import evidence
import pytest
from asked import asked, settings_of
from editing import cells

from gates.cause import default_limits
from gates.doubts import doubts_of
from gates.evidence import MissingEvidenceError
from gates.need import conditioning
from gates.proof import judge
from genpolicy.statistics.intervals import clopper_pearson


def test_an_effect_counts_only_where_it_is_significant(ladder):
    level = default_limits()["strata_p"]
    table = "audit/strata.parquet"
    evidence.edit_table(ladder, table, lambda f: f.assign(effect=0.9, p_adjusted=level * 1.01))
    quiet = asked(ladder, conditioning.strata_effect, gate="A")
    assert quiet.value == 0.0 and "none of" in quiet.caveat
    evidence.edit_table(ladder, table, cells("p_adjusted", level, share=0.01))
    evidence.edit_table(ladder, table, cells("effect", 0.4, share=0.01))
    chance = asked(ladder, conditioning.strata_effect, gate="A")
    assert chance.value == 0.0  # its interval begins at 0
    evidence.edit_table(ladder, table, cells("effect_lower", 0.2, share=0.01))
    assert asked(ladder, conditioning.strata_effect, gate="A").value == 0.4


@pytest.mark.parametrize(("without", "seen", "lost"), [(20, 20, 0), (20, 5, 15), (20, 30, 0)])
def test_the_collapse_is_the_upper_bound_of_what_the_phase_takes_away(ladder, without, seen, lost):
    counts = {"modes_without_phase": without, "modes_with_phase": seen}
    evidence.edit_document(ladder, "audit/summary.json", lambda d: {**d, **counts})
    found = asked(ladder, conditioning.phase_collapse_share, gate="A")
    assert found.value == clopper_pearson(lost, without, settings_of(ladder, "A").confidence)[1]


def test_without_modes_nothing_collapses_and_without_the_number_nothing_is_known(ladder):
    none = {"modes_without_phase": 0, "modes_with_phase": 0}
    evidence.edit_document(ladder, "audit/summary.json", lambda d: {**d, **none})
    assert asked(ladder, conditioning.phase_collapse_share, gate="A").value == 0.0
    evidence.edit_document(ladder, "audit/summary.json", lambda d: {**d, "modes_with_phase": None})
    with pytest.raises(MissingEvidenceError):
        asked(ladder, conditioning.phase_collapse_share, gate="A")


@pytest.mark.parametrize(
    ("lower", "upper", "found", "verdict"),
    [(-0.1, 0.2, 0.2, "PASS"), (0.3, 0.5, None, "INCONCLUSIVE"), (0.5, 0.8, 0.5, "FAIL")],
)
def test_what_tells_the_mode_is_judged_by_the_end_that_speaks_against(
    ladder, lower, upper, found, verdict
):
    worse = {"told": (lower + upper) / 2, "told_lower": lower, "told_upper": upper}
    evidence.edit_table(ladder, "audit/predictions.parquet", lambda f: f.assign(**worse))
    report = judge(ladder, "A")
    answers = {answer.id: answer for answer in report.criteria}
    told = answers["told_share"]
    assert (told.measured, told.verdict, told.interval) == (found, verdict, (lower, upper))
    assert report.verdict == verdict
    # The fixture's resampled audits still say valid modes, so that beyond the limit the cause is
    # left open; what tells the mode is not.
    cause = "INCONCLUSIVE" if verdict == "FAIL" else verdict
    assert answers["cause_accepted"].verdict == cause
    assert verdict == "PASS" or "told_share" in report.diagnosis


def test_one_variable_beyond_the_limit_is_red_whatever_the_others_say(ladder):
    def change(frame):
        frame.loc[0, ["told_lower", "told_upper"]] = [0.6, 0.8]
        frame.loc[1, ["told_lower", "told_upper"]] = [0.2, 0.9]
        return frame

    evidence.edit_table(ladder, "audit/predictions.parquet", change)
    report = judge(ladder, "A")
    told = next(answer for answer in report.criteria if answer.id == "told_share")
    assert (told.measured, told.verdict) == (0.6, "FAIL") and "operator" in told.caveat


def test_without_a_choice_nothing_is_known_of_it(ladder):
    evidence.edit_table(ladder, "audit/predictions.parquet", lambda frame: frame.head(0))
    with pytest.raises(MissingEvidenceError, match="no rows"):
        asked(ladder, conditioning.told_share, gate="A")


def test_of_several_recorded_columns_only_the_best_is_held_to_the_limit(ladder):
    names = ["variable", "told", "told_lower", "told_upper", "detail"]

    def change(frame):
        frame.loc[0, names] = ["scenario", 0.1, -0.3, 0.6, ""]
        frame.loc[1, names] = ["recorded_columns", 0.05, -0.1, 0.2, "scenario"]
        return frame

    evidence.edit_table(ladder, "audit/predictions.parquet", change)
    report = judge(ladder, "A")
    answers = {answer.id: answer for answer in report.criteria}
    assert (answers["told_share"].measured, answers["told_share"].verdict) == (0.2, "PASS")
    assert answers["cause_accepted"].verdict == "PASS"
    (open_,) = [doubt for doubt in doubts_of(report) if "told_share" in doubt.criteria]
    assert open_.kind == "not decided" and "scenario in approach (-30 % to 60 %)" in open_.text


def test_a_column_surely_below_the_limit_is_no_doubt(ladder):
    """Nor is one that is held to the limit, and said there."""
    names = ["variable", "told", "told_lower", "told_upper", "detail"]

    def change(frame):
        frame.loc[0, names] = ["scenario", 0.1, -0.3, 0.4, ""]
        frame.loc[1, names] = ["recorded_columns", 0.05, -0.1, 0.2, "scenario"]
        return frame

    evidence.edit_table(ladder, "audit/predictions.parquet", change)
    report = judge(ladder, "A")
    kinds = {doubt.kind for doubt in doubts_of(report) if "told_share" in doubt.criteria}
    assert "not decided" not in kinds


def test_columns_that_beat_no_guess_take_no_wrong_guesses_away(ladder):
    names = ["variable", "told", "told_lower", "told_upper", "detail"]

    def change(frame):
        frame = frame.head(2).copy()
        frame.loc[0, names] = ["scenario", 0.1, -0.3, 0.6, ""]
        frame.loc[1, names] = ["recorded_columns", 0.3, -0.1, 0.45, "scenario"]
        return frame

    evidence.edit_table(ladder, "audit/predictions.parquet", change)
    found = asked(ladder, conditioning.told_share, gate="A")
    assert (found.value, found.caveat) == (
        0.0,
        "by itself no recorded column beats a guess; not decided, and not held to the limit: "
        "scenario in approach (-30 % to 60 %), the best of all in approach (-10 % to 45 %)",
    )


@pytest.mark.parametrize(
    ("lower", "upper", "measured"),
    [(0.1, 0.4, 0.4), (0.1, 0.4001, None), (0.4, 0.6, None), (0.4001, 0.6, 0.4001)],
)
def test_an_interval_that_ends_at_the_limit_is_decided_below_it_and_open_above(
    ladder, lower, upper, measured
):
    worse = {"told": 0.3, "told_lower": lower, "told_upper": upper}
    evidence.edit_table(ladder, "audit/predictions.parquet", lambda f: f.assign(**worse))
    assert asked(ladder, conditioning.told_share, gate="A").value == measured
