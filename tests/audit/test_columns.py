"""Any recorded column can be named as the reason; thirty that say nothing change nothing."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from planar import LIMITS, SETTINGS, audited, named, planar
from planar import admissible as check
from planar_dataset import dataset_of

from genpolicy.audit import audit as audit_dataset
from genpolicy.audit.choices import Choices
from genpolicy.audit.columns import COLUMNS, Asking, binned, column_guesses, column_strata
from genpolicy.audit.data import canonical
from genpolicy.audit.guesses import right
from genpolicy.audit.linking import link
from genpolicy.audit.predictability import predictions
from genpolicy.audit.run import audit
from genpolicy.audit.situations import find_situations
from genpolicy.audit.strata import examine_strata
from genpolicy.audit.variable import Variable, numbered
from genpolicy.seeds import stream
from genpolicy.statistics.multiplicity import holm

N = 100
COARSE = SETTINGS.model_copy(update={"query_stride": 40})


def without_labels(data):
    """The planar rows with nothing recorded of an episode, and who had demonstrated it."""
    blank = np.full(len(data.episodes), "")
    told = numbered(data.episodes.operator)
    table = replace(data.episodes, operator=blank, object=blank, calibration_epoch=blank)
    return replace(data, episodes=table), told


def noise(seed, episodes, count=30):
    """Columns of every kind that say nothing."""
    rng = stream(seed, "noise")
    return tuple(
        Variable(f"n{k}", rng.normal(size=episodes))
        if k % 3 == 0
        else Variable(f"n{k}", numbered(rng.integers(0, 2 + k % 5, episodes)))
        for k in range(count)
    )


def several_of(data, seed=0, settings=COARSE):
    """Situations with several modes, and the mode of each episode."""
    items = [(i, c) for _, i, c in find_situations(data, settings, seed)[0] if c.count > 1]
    members = [(data.episode[item.members], split.labels) for item, split in items]
    return {"approach": items}, {"approach": link(members, len(data.episodes), 6)}


@pytest.fixture(scope="module")
def decided():
    """Rows in which an unlabelled column decided the side, and that column."""
    data, told = without_labels(canonical(planar(episodes=N, modes="operator")[0]))
    return data, told


def flipped(told, share, seed=1):
    """A column that tells the side in so many episodes beyond a guess."""
    rng = stream(seed, "flips")
    random = rng.random(len(told)) >= share
    return np.where(random, rng.integers(0, 2, len(told)), told)


@pytest.mark.parametrize("name", ["task", "latent", "q7_Ω"])
def test_the_column_that_decides_is_named_among_thirty_that_do_not(decided, name):
    data, told = decided
    data = replace(data, variables=(*noise(4, N), Variable(name, numbered(told), also=("index",))))
    result = audit(data, SETTINGS, admissible=check, replay=None, root_seed=3)
    cause = named(result)
    assert (cause.name, cause.variable) == ("hidden_state", name)
    row = next(row for row in result.strata if row.variable == name)
    assert (row.detail, row.observed) == ("the same as index", False)
    best = next(row for row in result.told if row.variable == COLUMNS)
    assert best.detail == name
    assert best.told_lower > LIMITS["told_share"]


def test_neither_its_name_nor_that_of_others_changes_a_number(decided):
    data, told = decided
    several, links = several_of(data)
    rows = []
    for names in (("a", "b"), ("zebra", "task")):
        columns = tuple(
            replace(item, name=name)
            for item, name in zip(
                (Variable("", numbered(told)), Variable("", noise(9, N)[0].values)), names,
                strict=True,
            )
        )  # fmt: skip
        some = replace(data, variables=tuple(sorted(columns, key=lambda item: item.key)))
        strata = examine_strata(some, COARSE, several, links, root_seed=5)
        told_by = predictions(some, COARSE, several, links, root_seed=5)
        rows.append(
            [replace(r, variable="", detail="") for r in (*strata, *told_by)]
        )  # fmt: skip
    assert rows[0] == rows[1]


@pytest.mark.parametrize(
    ("share", "measure"), [(0.9, False), (0.9, True), (0.7, False)],
    ids=["group", "measure", "weaker"],
)  # fmt: skip
def test_the_share_that_is_told_is_the_share_that_was_planted(decided, share, measure):
    data, told = decided
    values = numbered(flipped(told, share))
    if measure:
        values = flipped(told, share) + 0.2 * stream(2, "measure").normal(size=N)
    several, links = several_of(data)
    some = replace(data, variables=(*noise(6, N, 10), Variable("planted", values)))
    rows = {row.variable: row for row in predictions(some, COARSE, several, links, root_seed=1)}
    assert rows["planted"].told_lower - 0.1 <= share <= rows["planted"].told_upper + 0.1
    assert rows[COLUMNS].detail == "planted"
    assert abs(rows[COLUMNS].told - rows["planted"].told) < 0.15
    # All columns share the level: each interval is wider than that of the best.
    best, one = rows[COLUMNS], rows["planted"]
    assert one.told_upper - one.told_lower > best.told_upper - best.told_lower


def test_thirty_columns_that_say_nothing_name_nothing():
    result = audited(episodes=N)
    free = replace(result.data, variables=noise(11, N))
    again = audit(free, SETTINGS, admissible=check, replay=None, root_seed=3)
    assert named(result).name == named(again).name == "valid_modes"


def test_family_wise_error_of_thirty_columns():
    wrong = sure = 0
    runs = 40
    data, _ = without_labels(canonical(planar(episodes=N, seed=7)[0]))
    several, links = several_of(data)
    for seed in range(runs):
        some = replace(data, variables=noise(100 + seed, N))
        rows = examine_strata(some, COARSE, several, links, root_seed=seed)
        columns = [row for row in rows if row.variable.startswith("n")]
        assert len(columns) == 30
        wrong += any(row.p_adjusted <= 0.05 for row in columns)
        told = predictions(some, COARSE, several, links, root_seed=seed)
        sure += any(r.told_lower > 0.0 for r in told if r.variable.startswith("n"))
    bound = 0.05 + 3 * np.sqrt(0.05 * 0.95 / runs)
    assert wrong / runs <= bound
    assert sure / runs <= bound


def test_the_first_look_keeps_the_level():
    # Many tests of noise at once, without the situations of an audit.
    rng = stream(0, "first look")
    data, _ = without_labels(canonical(planar(episodes=60)[0]))
    rows = data.first_row[np.searchsorted(data.episode, np.arange(60))]
    blocks = np.arange(60) // 15
    columns = tuple(Variable(f"n{k}", numbered(rng.integers(0, 3, 60))) for k in range(400))
    settings = SETTINGS.model_copy(update={"permutations": 999})
    drawn = (rows, rng.integers(0, 2, 60), blocks)
    found = column_strata(replace(data, variables=columns), settings, drawn, Asking("any", 0))
    p_values = np.array([row.p_value for row in found])
    for level in (0.01, 0.05, 0.1):
        assert np.mean(p_values <= level) <= level + 3 * np.sqrt(level * (1 - level) / 400)
    assert holm(p_values).min() > 0.05


def test_a_column_that_switches_is_held_against_the_modes_row_by_row(decided):
    data, told = decided
    several, links = several_of(data)
    # What is recorded is the side in the first half of each episode, and anything later.
    later = data.index >= np.bincount(data.episode)[data.episode] * 0.9
    values = np.where(later, 2, told[data.episode])
    some = replace(data, variables=(Variable("goal", numbered(values), by_row=True),))
    row = next(
        r for r in examine_strata(some, COARSE, several, links, root_seed=0) if r.variable == "goal"
    )
    assert row.p_adjusted <= 0.05
    assert row.effect > 0.8
    told_by = {r.variable: r for r in predictions(some, COARSE, several, links, root_seed=0)}
    assert told_by["goal"].told_lower > 0.4


def test_what_an_observed_component_tells_apart_is_observed():
    data, _ = without_labels(canonical(planar(episodes=60)[0]))
    rows = data.first_row[np.searchsorted(data.episode, np.arange(60))]
    side = np.arange(60) % 2
    lamp = data.observation_names.index("lamp") if "lamp" in data.observation_names else -1
    seen = data.observation.copy()
    seen[:, lamp] = 5.0 * side[data.episode] * data.observation_scale[lamp]
    drawn = (rows, side, np.arange(60) // 15)
    variables = (Variable("side", numbered(side)), noise(1, 60, 2)[1])
    plain = column_strata(replace(data, variables=variables), SETTINGS, drawn, Asking("any", 0))
    shown = column_strata(
        replace(data, variables=variables, observation=seen), SETTINGS, drawn, Asking("any", 0)
    )
    assert [row.observed for row in plain] == [False, False]
    assert [row.observed for row in shown] == [True, False]


def test_the_best_of_columns_without_a_meaning_is_a_guess_on_average():
    shares = []
    for seed in range(60):
        rng = stream(seed, "best of noise")
        n = 60
        choices = Choices(np.arange(n), rng.integers(0, 2, n), np.full((n, 2), 0.5))
        data = type("Data", (), {"variables": noise(seed, n)})
        guesses, _, times = column_guesses(data, choices, np.arange(n))
        shares.append(right(choices, guesses[COLUMNS], rng, repeats=1).mean())
        assert isinstance(times, Counter)
        assert sum(times.values()) == 10
    assert abs(np.mean(shares) - 0.5) < 3 * np.std(shares) / np.sqrt(60)


def test_thirds_inside_blocks_and_what_was_not_recorded():
    values = np.array([1.0, 2.0, 3.0, np.nan, 10.0, 20.0, 30.0])
    blocks = np.array([0, 0, 0, 0, 1, 1, 1])
    assert binned(values, blocks).tolist() == [0, 1, 2, 3, 0, 1, 2]
    assert binned(np.array([4, 4, 9]), np.zeros(3)).tolist() == [4, 4, 9]


def test_the_page_says_what_was_looked_at_and_what_not(decided):
    data, told = decided
    dataset = dataset_of(data)
    order = {str(uuid): k for k, uuid in enumerate(data.episodes.uuid)}
    place = [order[str(uuid)] for uuid in dataset.episodes["episode_uuid"]]
    table = dataset.episodes.assign(
        **{
            "variable.scenario": [f"kitchen {told[k]}" for k in place],
            "variable.scenario_index": [float(told[k]) for k in place],
            "variable.seed": [float(1000 + 37 * k) for k in range(N)],
        }
    )
    report = audit_dataset(replace(dataset, episodes=table), SETTINGS, admissible=check)
    text = " ".join(report.rests_on)
    assert "Looked at as reasons: scenario (scenario_index says the same)." in text
    assert "Not looked at as a reason: seed (whole numbers, another in every episode" in text
    asked = {row.check: row for row in report.result.asked}
    assert asked["column.scenario"].asked
    assert not asked["column.seed"].asked
    assert named(report.result).text == "hidden_state(scenario)"
