"""Draws of the audit's measures: around what was measured, certain where it is certain."""

from types import SimpleNamespace

import numpy as np
import pytest
from planar import SETTINGS

from genpolicy.audit.counts import count
from genpolicy.audit.documents import Persistence
from genpolicy.audit.labels import Replayed
from genpolicy.audit.modes import Clustering
from genpolicy.audit.neighbourhoods import Neighbourhood, Support
from genpolicy.audit.resamples import Measures, resamples
from genpolicy.audit.rows import ModeOutcome, Prediction, Stratum
from genpolicy.audit.situations import Situation
from genpolicy.audit.structure_draws import queries_of
from genpolicy.statistics.intervals import clopper_pearson

NULL = np.linspace(0.0, 0.5, 99)
# One row to each of twelve episodes: nothing moves, and rows are counted.
DATA = SimpleNamespace(
    episode=np.arange(12), position=np.zeros((12, 0)), first_row=np.arange(12),
    last_row=np.arange(12), action=np.zeros((12, 1)), action_position=slice(0, 1), forms=None,
)  # fmt: skip


def situations(kept=0.9, two_mode=True):
    """One situation in each of twelve episodes."""
    clustering = Clustering(np.array([0, 1, 0, 1]), 0.1, (0, 1))
    return tuple(
        Situation("approach", Neighbourhood(row, np.array([0]), np.zeros(1)), clustering,
                  two_mode, (kept, NULL), None, 0.1, 0.01)
        for row in range(12)
    )  # fmt: skip


def drawn(items=None, **changes):
    return both(items, **changes)[0]


def both(items=None, *, wrong=0, strata=(), told=(), modes=(), seed=1, draws=60):
    replayed = tuple(
        Replayed(str(n), "success", "failure" if n < wrong else "success") for n in range(40)
    )
    found = situations() if items is None else items
    reach = (Support("approach", 12, len(found)),)
    measured = Measures(
        replayed, Persistence(0.9, 0.4, 0.2, 12), strata, told, modes, count(DATA, found, reach, 0)
    )
    settings = SETTINGS.model_copy(update={"resamples": draws})
    queries = queries_of(DATA, settings, found, reach)
    return resamples(settings, measured, found, queries, root_seed=seed)


def stratum(**changes):
    fields = {
        "variable": "operator", "phase": "approach", "p_value": 0.2, "p_adjusted": 0.2,
        "effect": 0.5, "effect_lower": 0.3, "effect_upper": 0.7, "n": 50, "recorded": True,
        "observed": False,
    }  # fmt: skip
    return Stratum(**{**fields, **changes})


def test_a_seed_decides_the_draws_and_the_settings_their_number():
    assert drawn(wrong=10) == drawn(wrong=10) != drawn(wrong=10, seed=2)
    assert len(drawn(draws=7)) == 7


def test_labels_are_drawn_around_their_share():
    wrong = [row.disagreements for row in drawn(wrong=10, draws=400)]
    assert np.mean(wrong) == pytest.approx(10, abs=0.6)
    # Binomial: n p (1 - p) = 7.5.
    assert np.var(wrong) == pytest.approx(7.5, rel=0.3)
    assert {(r.disagreements, r.disagreement_upper) for r in drawn()} == {
        (0, clopper_pearson(0, 40)[1])
    }


def test_as_many_episodes_are_drawn_as_there_are_and_all_of_them_have_modes():
    for row in drawn():
        assert (row.two_mode, row.two_mode_episodes, row.persistent) == (12, 12, 12)
        assert (row.incoherent, row.kept_n) == (0, 12) and row.kept == pytest.approx(0.9)
        assert row.kept_null_q95 == pytest.approx(np.quantile(NULL, 0.95))


def test_modes_that_do_not_persist_are_incoherent_in_every_draw():
    for row in drawn(situations(kept=0.1)):
        assert (row.two_mode, row.incoherent, row.persistent, row.kept_n) == (0, 12, 0, 0)


def test_what_was_not_tested_stays_unknown_and_effects_stay_in_their_range():
    blank = {"p_value": None, "p_adjusted": None, "effect": None, "effect_lower": None}
    rows = drawn(strata=(stratum(), stratum(**blank, effect_upper=None)), draws=400)
    assert {(r.p_adjusted[1], r.effect[1], r.effect_lower[1]) for r in rows} == {(None,) * 3}
    effects = np.array([row.effect[0] for row in rows])
    # The interval of +-0.2 is two-sided at 95 %: a standard deviation of 0.4 / 3.92.
    assert np.std(effects) == pytest.approx(0.4 / 3.92, rel=0.15)
    assert effects.min() >= 0.0 and effects.max() <= 1.0
    assert np.median([row.p_adjusted[0] for row in rows]) == pytest.approx(0.2, abs=0.07)


def test_what_is_told_is_drawn_from_its_interval():
    row = Prediction("operator", "approach", 0.3, 0.1355, 0.4645, 0.65, 0.5, 100)
    found = np.array([draw.told for draw in drawn(told=(row, row), draws=400)])
    assert found.shape == (400, 2)
    assert np.mean(found) == pytest.approx(0.3, abs=0.02)
    # Each end is a bound of 95 %: 0.1645 is 1.645 standard deviations.
    assert np.std(found) == pytest.approx(0.1, rel=0.15)


def test_a_mode_that_always_succeeds_does_so_in_every_draw():
    modes = (ModeOutcome("m0", "approach", 30, 30, 0.88, 1.0, 5, 5),
             ModeOutcome("m1", "approach", 30, 15, 0.3, 0.7, 0, 0))  # fmt: skip
    rows, structures = both(modes=modes)
    assert {row.successes[0] for row in structures} == {30}
    assert all(
        row.success_lower[1] == clopper_pearson(structure.successes[1], 30)[0]
        for row, structure in zip(rows, structures, strict=True)
    )
    assert {row.success_lower[0] for row in rows} == {clopper_pearson(30, 30)[0]}
    assert {row.admissible for row in rows} == {(5, 0)}
    assert len({row.success_lower[1] for row in rows}) > 3


def test_no_situation_and_no_replay_are_drawn_as_nothing():
    nothing = count(DATA, (), (Support("approach", 0, 0),), 0)
    empty = Measures((), Persistence(0.0, 1.0, 1.0, 0), (), (), (), nothing)
    settings = SETTINGS.model_copy(update={"resamples": 1})
    queries = queries_of(DATA, settings, (), ())
    (row,), (drawn,) = resamples(settings, empty, (), queries, root_seed=1)
    assert (row.two_mode, row.kept_n, row.disagreement_upper) == (0, 0, 1.0)
    assert (drawn.queries, drawn.analysed, drawn.findings) == (0, 0, -1)
