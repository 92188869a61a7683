"""Several numbers that hold are a category, and measures where there are many different ones."""

import numpy as np
import pytest

from genpolicy.data.formats import vectors as module
from genpolicy.data.formats.leaves import MAXIMUM_TEXT
from genpolicy.data.formats.vectors import MOST_NUMBERS, MOST_ROWS, Vectors, starts_of


def gathered(rows):
    """What is made of one row of numbers an episode."""
    vectors = Vectors()
    for number, row in enumerate(rows):
        vectors.add("goal", f"u{number}", np.zeros(1), np.array([row]))
    return {name: [runs[f"u{k}"].values[0] for k in range(len(rows))]
            for name, runs in vectors.recorded().items()}  # fmt: skip


def test_runs_of_equal_rows():
    values = np.array([[0.0, 1.0], [0.0, 1.0], [1.0, np.nan], [1.0, np.nan], [1.0, 1.0]])
    assert starts_of(values).tolist() == [0, 2, 4]
    assert starts_of(np.zeros((3, 2), "u1")).tolist() == [0]


def test_few_different_rows_are_one_category():
    kept = gathered(np.eye(3)[[0, 1, 2, 1]])
    assert kept == {"goal": ["1, 0, 0", "0, 1, 0", "0, 0, 1", "0, 1, 0"]}


def test_many_different_rows_are_also_measures():
    rows = np.random.default_rng(0).normal(size=(MOST_ROWS + 1, 3))
    kept = gathered(rows)
    assert set(kept) == {"goal", "goal[0]", "goal[1]", "goal[2]"}
    assert kept["goal[2]"] == rows[:, 2].tolist()


def test_an_embedding_is_told_apart_by_all_of_it():
    rows = np.zeros((3, 768))
    rows[1, 700] = 1e-3
    (texts,) = gathered(rows).values()
    assert texts[0] == texts[2] != texts[1]
    assert max(map(len, texts)) <= MAXIMUM_TEXT


@pytest.mark.parametrize("width", [MOST_NUMBERS, MOST_NUMBERS + 1])
def test_a_wide_row_is_no_measure(width):
    rows = np.random.default_rng(0).normal(size=(20, width))
    assert len(gathered(rows)) == (1 + width if width <= MOST_NUMBERS else 1)


def test_rows_of_several_widths_are_a_category_only():
    rows = [(0.5,) * (2 + k % 3) + (float(k),) for k in range(20)]
    assert list(gathered(rows)) == ["goal"]


@pytest.mark.parametrize("width", [MOST_NUMBERS, MOST_NUMBERS + 1])
def test_what_is_kept_of_many_different_rows_is_bounded(monkeypatch, width):
    monkeypatch.setattr(module, "MOST_DIFFERENT", 50)
    rows = np.random.default_rng(0).normal(size=(90, width))
    for few, kept, overfull in (
        (50, {"goal"}, []), (51, set(), ["goal"]), (90, set(), ["goal"])
    ):  # fmt: skip
        vectors = Vectors()
        for k in range(3):
            vectors.add("goal", f"u{k}", np.arange(few), rows[:few])
        found = set(vectors.recorded())
        measures = {f"goal[{k}]" for k in range(width)} if width <= MOST_NUMBERS else set()
        assert found == kept | measures
        assert vectors.overfull() == (overfull if not measures else [])


def test_what_is_missing_is_empty_and_zero_has_one_sign():
    assert gathered([(np.nan, np.nan), (-0.0, 1.0), (0.0, 1.0)]) == {"goal": ["", "0, 1", "0, 1"]}
