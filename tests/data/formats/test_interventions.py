"""Flags of rows in which a person corrected: a label of the episode, a reason, and a note."""

from contextlib import nullcontext

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from genpolicy.data.dataset import load_dataset
from genpolicy.data.formats import open_dataset
from genpolicy.data.formats.interventions import flags_of
from genpolicy.data.variables import Runs, stored

EPISODES = 6


def recorded(layouts, root, name, flags):
    """A LeRobot dataset with a column of flags."""
    features = {**layouts.info()["features"]}
    features[name] = {"dtype": "bool", "shape": [1], "names": None}
    layouts.v2(root, features=features)
    for i in range(EPISODES):
        column = {name: pa.array(flags(i))}
        layouts.write(layouts.file(root, i), layouts.table(i, first=30 * i, **column))
    return root


@pytest.mark.parametrize("name", ["is_intervention", "complementary_info.is_intervention"])
@pytest.mark.parametrize("kind", [bool, float, "i8"])
def test_flags_by_row_refuse_nothing_and_are_asked(layouts, tmp_path, name, kind):
    def flags(i):
        return ((np.arange(30) >= 18) & (i % 2 == 0)).astype(kind)

    opened = open_dataset(recorded(layouts, tmp_path / "r", name, flags), out=tmp_path / "out")
    assert opened.accepted == EPISODES
    assert opened.contract.labels.is_intervention == name
    episodes = load_dataset(tmp_path / "out").episodes
    assert sorted(episodes["is_intervention"].tolist()) == [False] * 3 + [True] * 3
    kept = stored(episodes)
    number = episodes["source_file"].tolist().index("data/chunk-000/episode_000002.parquet")
    assert kept[name][number] == Runs((0, 18), (0.0, 1.0))
    assert set(kept) == {name}
    assert (
        f"{name} says where a person corrected: 20% of the rows, in 3 of 6 episodes. It is asked "
        "as a reason."
    ) in opened.notes


def test_flags_that_flicker_are_no_reason_and_neither_is_how_many_there_are(layouts, tmp_path):
    def flags(i):
        return np.random.default_rng(i).random(30) < 0.1 * i

    path = recorded(layouts, tmp_path / "r", "is_intervention", flags)
    opened = open_dataset(path, out=tmp_path / "out")
    kept = stored(load_dataset(tmp_path / "out").episodes)
    assert not kept
    said = [note for note in opened.notes if "where a person corrected" in note]
    assert len(said) == 1 and said[0].endswith(" episodes.")
    assert any("changes row by row: is_intervention" in note for note in opened.notes)


def test_one_flag_an_episode_is_asked_too_and_nothing_is_said(layouts, tmp_path):
    path = recorded(layouts, tmp_path / "r", "is_intervention", lambda i: np.full(30, i % 2 == 0))
    opened = open_dataset(path, out=tmp_path / "out")
    assert "is_intervention" in stored(load_dataset(tmp_path / "out").episodes)
    assert not any("corrected" in note for note in opened.notes)


def test_what_is_no_flag_is_refused_as_before(layouts, tmp_path):
    path = recorded(layouts, tmp_path / "r", "is_intervention", lambda i: np.arange(30) // 10)
    with pytest.raises(Exception, match="one value per episode"):
        open_dataset(path, out=tmp_path / "out")


@pytest.mark.parametrize(
    ("name", "said", "asked"),
    [("takeover", ["left_arm", "right_arm"], ["left_arm", "right_arm"]),
     ("intervened", [0, 1, 2], [0.0, 1.0, 2.0])],
)  # fmt: skip
@pytest.mark.parametrize("layout", ["parquet", "hdf5"])
def test_a_guessed_name_is_a_label_only_where_it_holds_flags(
    layouts, tmp_path, name, said, asked, layout
):
    path = tmp_path / "recordings"
    path.mkdir()
    with h5py.File(path / "demo.hdf5", "w") if layout == "hdf5" else nullcontext() as file:
        for i in range(EPISODES):
            one = said[i % len(said)]
            if file is not None:
                state, action = layouts.samples(i)
                demo = file.create_group(f"data/demo_{i}")
                demo["obs/joint_pos"], demo["actions"], demo.attrs[name] = state, action, one
                continue
            table = layouts.table(i).append_column(name, pa.array([one] * 30))
            pq.write_table(table.drop_columns(["index"]), path / f"e{i}.parquet")
    opened = open_dataset(path, out=tmp_path / "out")
    assert opened.accepted == EPISODES and opened.contract.labels.is_intervention is None
    note = f"{name} holds no flags: it is a column, not the label of interventions."
    assert note in opened.notes
    kept = stored(load_dataset(tmp_path / "out").episodes)[name]
    assert {str(runs.values[0]) for runs in kept} <= {*map(str, asked), *map(str, said)}
    assert len({runs.values[0] for runs in kept}) == len(said)


def test_a_guessed_name_that_holds_flags_is_the_label(layouts, tmp_path):
    path = recorded(layouts, tmp_path / "r", "takeover", lambda i: np.arange(30) >= 15 * (i % 3))
    opened = open_dataset(path, out=tmp_path / "out")
    assert opened.accepted == EPISODES and opened.contract.labels.is_intervention == "takeover"


@pytest.mark.parametrize(
    ("values", "flags"),
    [(np.array([0, 1, 1]), [0, 1, 1]), (np.array([0.0, np.nan]), [0, np.nan]),
     (np.array(["True", "false", ""], dtype=object), [1, 0, np.nan]),
     (np.array([0, 2]), None), (np.array(["a"], dtype=object), None), (np.zeros((2, 2)), None)],
)  # fmt: skip
def test_flags_of(values, flags):
    found = flags_of(values)
    assert (found is None) == (flags is None)
    if flags is not None:
        np.testing.assert_array_equal(found, flags)
