"""Dates by their time of day, and free text by its words."""

import numpy as np
import pytest

from genpolicy.audit.parts import MOST_WORDS, number_of, parts
from genpolicy.data.variables import Runs

N = 40


def column(values):
    """One value an episode, None where it lacks the column."""
    return [None if value is None else Runs((0,), (value,)) for value in values]


def asked(values, **options):
    """Values of the parts of a column `said`, by name, one an episode."""
    found = parts({"said": column(values)}, **options)
    return {name: [item and item.values[0] for item in runs] for name, runs in found.items()}


@pytest.mark.parametrize("unit", [1, 1e3, 1e6, 1e9], ids=["s", "ms", "µs", "ns"])
def test_seconds_since_1970_have_a_time_of_day(unit):
    # By the clock of Greenwich the afternoons end after midnight: they stay one afternoon.
    hours = np.array([15.0 + k / 20 if k % 2 else 22.5 + k / 20 for k in range(N)])
    days = np.array([19000 + (7 * k) % 11 for k in range(N)])
    found = asked((days * 86400.0 + hours * 3600.0) * unit)
    seconds = np.array([number_of(text) for text in found["said (time of day)"]])
    late = np.arange(N) % 2 == 0
    assert seconds[late].min() > seconds[~late].max()
    assert seconds.min() == 0.0


@pytest.mark.parametrize(
    "values",
    [[40000.0 * k for k in range(N)], [1.7e9 + 60.0 * k for k in range(N)],
     [1.7e9 + 90000.0 * k if k else 1.7e12 for k in range(N)], [""] * N],
    ids=["no dates", "one day", "two units", "nothing"],
)  # fmt: skip
def test_other_numbers_have_none(values):
    assert asked(values) == {}


def test_a_word_parts_the_texts_once():
    texts = [f"verb{k % 14} to the {('Left', 'right')[k % 2]}, please." for k in range(N)]
    found = asked([*texts[:-1], None])
    assert found == {'said ("left")': [*(("with", "without")[k % 2] for k in range(N - 1)), None]}


def test_words_are_counted_by_run_where_the_text_changes_on_the_way():
    runs = [Runs((0, 9), (f"take {k} left", f"leave {k} right")) for k in range(N)]
    (name,) = found = parts({"said": runs})
    assert name == 'said ("leave")'
    assert found[name][0] == Runs((0, 9), ("without", "with"))


@pytest.mark.parametrize(
    "texts",
    [[f"go {k % 12} {('left', 'right')[k % 2]}" for k in range(0, 24, 2)] * 4,
     [f"{k:04d} {'left' if k < 4 else 'right'}" for k in range(N)],
     [f"{8 + k // 6:02d}:{k % 6}5" for k in range(N)], [str(k % 15) for k in range(N)],
     [f"2024-03-01T08:00:{k:02d}" for k in range(N)]],
    ids=["few texts", "in few episodes", "times", "numbers", "dates"],
)  # fmt: skip
def test_words_are_not_asked_of(texts):
    assert asked(texts) == {}


def test_the_most_even_words_are_asked_and_of_places_none():
    # Word k stands in the texts whose number is divisible by k + 2.
    texts = [" ".join([f"n{k}", *(f"w{w}" for w in range(30) if k % (w + 2) == 0)]) for k in
             range(400)]  # fmt: skip
    found = asked(texts)
    assert 'said ("w0")' in found and len(found) <= MOST_WORDS
    assert 'said ("w20")' not in found
    assert asked(texts, without=("said",)) == {}


@pytest.mark.parametrize(
    ("text", "number"),
    [("3", 3.0), ("true", 1.0), ("08:30", 30600.0), ("1970-01-02", 86400.0), ("left", None)],
)
def test_numbers_are_told_from_words(text, number):
    assert number_of(text) == number
