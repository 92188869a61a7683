"""How often the denser mode is the one drawn more often, over which situations and episodes."""

import math

import evidence
import pytest
from editing import cells

from gates.evidence import Evidence, MissingEvidenceError
from gates.reproducibility.densities import agreement, densities
from genpolicy.statistics.intervals import clopper_pearson

DENSITY = "reload/density.parquet"


def told(ladder, method="flow"):
    return agreement(densities(Evidence(ladder)), method, confidence=0.95)


def test_the_interval_is_over_episodes(ladder):
    evidence.edit_table(
        ladder, DENSITY, lambda f: f.assign(episode_uuid=[f"e{i // 2}" for i in f["index"]])
    )
    found = told(ladder)
    assert (found.share, found.situations, found.episodes, found.tied) == (0.75, 16, 8, 0)
    assert found.interval == pytest.approx(clopper_pearson(6, 8))


def test_situations_of_one_episode_that_differ_count_to_its_disadvantage(ladder):
    """Twelve of sixteen situations in five episodes are three and three quarters: three count."""
    evidence.edit_table(
        ladder, DENSITY, lambda f: f.assign(episode_uuid=[f"e{i % 5}" for i in f["index"]])
    )
    found = told(ladder)
    assert (found.share, found.episodes) == (0.75, 5)
    assert found.interval == pytest.approx(clopper_pearson(3, 5))


def test_a_tie_says_nothing_and_is_counted(ladder):
    """Situation 0 disagreed; now its modes are drawn equally often."""
    evidence.edit_table(
        ladder, DENSITY, lambda f: f.assign(reached=f["reached"].where(f["index"] != 0, 7))
    )
    found = told(ladder)
    assert (found.situations, found.tied) == (15, 1) and found.share == 12 / 15


def test_gains_are_over_the_mean_of_the_situation(ladder):
    rows = densities(Evidence(ladder))
    assert set(zip(rows["mode"], rows["gain"], strict=True)) == {(0, 2.0), (1, -2.0)}
    assert set(rows["share"]) == {5 / 16, 9 / 16}


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (cells("reached", 17), "more samples than were drawn"),
        (cells("samples", 0), "more samples than were drawn"),
        (lambda f: f.assign(samples=0, reached=0), "more samples than were drawn"),
        (cells("reached", -1), "corrupt"),
        (lambda f: f[f["mode"] == 0], "each once"),
        (lambda f: f.assign(mode=0), "each once"),
        (lambda f: f.head(0), "no rows"),
    ],
)
def test_what_cannot_be_is_no_evidence(ladder, change, text):
    evidence.edit_table(ladder, DENSITY, change)
    with pytest.raises(MissingEvidenceError, match=text):
        told(ladder)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_where_no_density_is_a_number_all_are_counted_as_that(ladder, value):
    evidence.edit_table(ladder, DENSITY, cells("log_density", value))
    found = told(ladder)
    assert math.isnan(found.share) and found.interval == (0.0, 1.0)
    assert (found.situations, found.tied, found.unknown, found.episodes) == (0, 0, 16, 0)
    assert densities(Evidence(ladder))["gain"].isna().all()


def test_where_every_situation_is_a_tie_nothing_is_known(ladder):
    """No share, an interval that holds all, and no episode."""
    evidence.edit_table(ladder, DENSITY, cells("reached", 7))
    found = told(ladder)
    assert math.isnan(found.share) and found.interval == (0.0, 1.0)
    assert (found.situations, found.tied, found.episodes) == (0, 16, 0)


def test_a_mode_may_be_reached_by_every_sample_or_by_none(ladder):
    """One of two modes is reached by all sixteen: a share of 1 and one of 0, and no tie."""
    evidence.edit_table(ladder, DENSITY, lambda f: f.assign(reached=16 * (f["mode"] == 0)))
    found = told(ladder)
    assert (found.share, found.situations) == (1.0, 16)
    evidence.edit_table(ladder, DENSITY, lambda f: f.assign(samples=1, reached=1 * (f["mode"] > 0)))
    assert told(ladder).share == 0.0
