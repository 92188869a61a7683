"""What is stated against what is derived again: the first difference is refused by name."""

import pytest

from gates.stated import compare_keys, compare_rows, mapping, root_seed, short, training_seed
from genpolicy.errors import ConfigError, RefusedError

TABLE = "artifacts/shadow/counts.parquet"


def compare(stated, derived, seed=0):
    compare_rows("C", TABLE, ("method",), stated, derived, seed=seed)


def test_equal_rows_stand_in_any_order():
    rows = [{"method": "a", "n": 1}, {"method": "b", "n": 2}]
    compare(rows, rows[::-1])
    compare([{**rows[0], "seed": 4}], rows[:1], seed=4)
    compare([], [])


@pytest.mark.parametrize(("stated", "derived", "said"), [
    ([{"method": "a", "n": 1}], [{"method": "a", "n": 2}], r"count a: n is 1, required 2, as its"),
    ([{"method": "a"}], [{"method": "a", "n": 2}], r"count a: n is None"),
    ([{"method": "a", "seed": 1}], [{"method": "a"}], r"count a: seed is 1, required 0"),
    ([{"method": "a"}], [], r"count a is without a journal"),
    ([], [{"method": "a"}], r"count a is only in a journal"),
    ([{"method": "a"}] * 2, [{"method": "a"}], r"count a is stated twice"),
])  # fmt: skip
def test_the_first_difference_is_refused_by_name(stated, derived, said):
    with pytest.raises(RefusedError, match=said) as caught:
        compare(stated, derived)
    assert caught.value.exit_code == 3


def test_of_several_differences_the_first_by_key_and_column_is_refused():
    """Whatever the order of the rows: a run that is refused twice is refused in the same words."""
    stated = [{"method": "b", "n": 1}, {"method": "a", "m": 1, "n": 1}]
    derived = [{"method": "b", "n": 2}, {"method": "a", "m": 2, "n": 2}]
    for rows in (stated, stated[::-1]):
        with pytest.raises(RefusedError, match=r"count a: m is 1, required 2, as its journal says"):
            compare(rows, derived)


def test_a_row_is_known_by_all_of_its_keys_and_named_by_its_table():
    rows = [{"method": "a", "start": start, "n": 1} for start in (0, 1)]
    for table, name in (("stress/rollouts.parquet", "rollout"),
                        ("shadow/conservation.parquet", "conservation")):  # fmt: skip
        compare_rows("D", table, ("method", "start"), rows, rows, seed=0)
        with pytest.raises(RefusedError, match=rf"Gate D refuses: {name} a/1 is without a journal"):
            compare_rows("D", table, ("method", "start"), rows, rows[:1], seed=0)


def test_keys_of_a_document():
    compare_keys("D", "power.json", {"a": 1}, {"a": 1}, "again")
    for stated in ({"a": 2}, {}, {"a": 1, "b": 2}):
        with pytest.raises(RefusedError, match=r"power\.json: [ab] is .*, again"):
            compare_keys("D", "power.json", stated, {"a": 1}, "again")


def test_a_value_in_few_words():
    assert short([{"a": 1}, 2]) == "2 entries" and short([1, 2]) == "[1, 2]"
    assert len(short("x" * 500)) == 120 and short("x" * 120) == "x" * 120
    assert mapping([1]) == {} and mapping({"a": 1}) == {"a": 1}


def test_seeds_of_the_workspace():
    assert root_seed({"seed": 3}) == 3
    for seed in (True, "3", None, 3.0):
        with pytest.raises(ConfigError, match="whole number"):
            root_seed({"seed": seed})
    assert training_seed({"policy": {"seeds": [7, 8]}}) == 7
    assert training_seed({"policy": {"seeds": []}}) is training_seed({"policy": {}}) is None
