"""A name proposes the column of the episodes, and the rows say whether it is one."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from long_tables import UUIDS, rows

from genpolicy.data.dataset import load_dataset
from genpolicy.data.formats import open_dataset
from genpolicy.data.formats.parquet import ParquetFiles
from genpolicy.data.variables import stored

EPISODES = 8


def table(layouts, number, **changes):
    """An episode with a session of two, rows counted from 0 on, and no column of episodes."""
    plain = rows(layouts, number, timestamp=np.arange(30) / 20)
    plain = plain.drop_columns(["episode_uuid", "operator", "picture"])
    named = {"run": [("morning", "noon", "evening", "night")[number // 2]] * 30, **changes}
    for name, values in named.items():
        plain = plain.append_column(name, pa.array(values))
    return plain


def written(layouts, path, **by_number):
    """All episodes in one file, with columns as functions of the episode's number."""
    parts = [
        table(layouts, i, **{name: [value(i)] * 30 for name, value in by_number.items()})
        for i in range(EPISODES)
    ]
    pq.write_table(pa.concat_tables(parts), path)
    return path


def imported(path, tmp_path):
    opened = open_dataset(path, out=tmp_path / "out")
    return opened, stored(load_dataset(tmp_path / "out").episodes)


def test_a_session_is_no_episode_and_its_rows_begin_anew(layouts, tmp_path):
    opened, kept = imported(written(layouts, tmp_path / "t.parquet"), tmp_path)
    assert (opened.found, opened.accepted) == (EPISODES, EPISODES)
    assert (
        "run has one value for several episodes: an episode begins where timestamp begins anew; "
        "run is asked as a reason."
    ) in opened.notes
    assert {runs.values[0] for runs in kept["run"]} == {"morning", "noon", "evening", "night"}


@pytest.mark.parametrize("name", ["take", "goal_x"])
def test_no_other_column_is_taken_for_the_episode(layouts, tmp_path, name):
    """It may be what decides: what was taken for the episode would never be asked."""
    path = written(layouts, tmp_path / "t.parquet", **{name: lambda i: 7 * i})
    opened, kept = imported(path, tmp_path)
    assert opened.accepted == EPISODES and {"run", name} <= set(kept)
    assert any("an episode begins where timestamp begins anew" in n for n in opened.notes)


def _at(part, name, values):
    return part.set_column(part.column_names.index(name), name, pa.array(values))


HELD = (np.arange(30) // 5) % 3


@pytest.mark.parametrize("named", [
    {"episode_index": lambda i: i, "attempt": lambda i: i % 3}, {"run": lambda i: i},
])  # fmt: skip
@pytest.mark.parametrize("clock", [True, False])
def test_a_number_that_counts_something_else_cuts_no_episode(layouts, tmp_path, named, clock):
    """A step of a plan that is held and tried again falls back inside the episode."""
    parts = []
    for i in range(EPISODES):
        part = table(layouts, i, **{name: [value(i)] * 30 for name, value in named.items()})
        part = _at(part, "step", HELD)
        parts.append(part if clock else part.drop_columns(["timestamp"]))
    pq.write_table(pa.concat_tables(parts), tmp_path / "t.parquet")
    source = ParquetFiles(tmp_path / "t.parquet")
    assert source.labels.episode == next(iter(named))
    assert len(list(source.episodes(["tool_x_m"], source.labels.episode))) == EPISODES


@pytest.mark.parametrize("clock", [True, False])
def test_files_without_any_name_stay_whole_where_something_else_is_counted(
    layouts, tmp_path, clock
):
    folder = tmp_path / "recordings"
    folder.mkdir()
    for i in range(EPISODES):
        part = table(layouts, i).drop_columns(["run"])
        part = _at(part, "step", HELD)
        part = part if clock else part.drop_columns(["timestamp"])
        pq.write_table(part, folder / f"{i}.parquet")
    source = ParquetFiles(folder)
    assert len(list(source.episodes(["tool_x_m"], source.labels.episode))) == EPISODES


def test_an_identifier_that_comes_twice_is_refused_and_no_session(layouts, tmp_path):
    folder = tmp_path / "recordings"
    folder.mkdir()
    for i in range(EPISODES):
        name = UUIDS[3 if i == 7 else i]
        part = table(layouts, i, episode_uuid=[name] * 30).drop_columns(["run"])
        pq.write_table(part, folder / f"{i}.parquet")
    opened, _ = imported(folder, tmp_path)
    assert (opened.found, opened.accepted) == (EPISODES, EPISODES - 1)
    assert opened.contract.labels.episode == "episode_uuid"


def test_a_clock_that_begins_a_little_later_each_time_begins_anew(layouts, tmp_path):
    parts = [
        _at(table(layouts, i), "timestamp", 0.05 * ((7 * i) % 5) / 5 + np.arange(30) / 20)
        for i in range(EPISODES)
    ]
    pq.write_table(pa.concat_tables(parts), tmp_path / "t.parquet")
    source = ParquetFiles(tmp_path / "t.parquet")
    assert len(list(source.episodes(["tool_x_m"], source.labels.episode))) == EPISODES


@pytest.mark.parametrize("first", [True, False])
def test_files_are_the_episodes_where_several_share_a_value(layouts, tmp_path, first):
    folder = tmp_path / "recordings"
    folder.mkdir()
    for i in range(EPISODES):
        name = f"{i if first else 9 - i}.parquet"
        pq.write_table(table(layouts, i), folder / name)
    opened, kept = imported(folder, tmp_path)
    assert opened.accepted == EPISODES
    assert opened.contract.labels.episode is None
    assert any("run has one value for several episodes: each file" in n for n in opened.notes)
    assert len({runs.values[0] for runs in kept["run"]}) == 4


def test_an_identifier_stays_one_and_a_session_beside_it_is_asked(layouts, tmp_path):
    path = written(layouts, tmp_path / "t.parquet", episode_id=lambda i: 40 + i)
    opened, kept = imported(path, tmp_path)
    assert opened.contract.labels.episode == "episode_id"
    assert "run" in kept
    assert not any("several episodes" in note for note in opened.notes)


def test_one_run_an_episode_is_its_identifier(layouts, tmp_path):
    parts = [table(layouts, i, run=[f"r{i}"] * 30) for i in range(EPISODES)]
    pq.write_table(pa.concat_tables(parts), tmp_path / "t.parquet")
    opened, kept = imported(tmp_path / "t.parquet", tmp_path)
    assert opened.contract.labels.episode == "run"
    assert opened.accepted == EPISODES and "run" not in kept


def test_without_any_name_rows_that_begin_anew_are_episodes(layouts, tmp_path):
    parts = [table(layouts, i).drop_columns(["run"]) for i in range(EPISODES)]
    pq.write_table(pa.concat_tables(parts), tmp_path / "t.parquet")
    opened, _ = imported(tmp_path / "t.parquet", tmp_path)
    assert (opened.found, opened.accepted) == (EPISODES, EPISODES)
    assert "An episode begins where timestamp begins anew." in opened.notes


def test_a_gap_or_a_jump_in_one_episode_is_damage_as_before(layouts, tmp_path):
    parts = []
    for i in range(EPISODES):
        step = np.arange(30)
        if i == 3:
            step[20:] = np.arange(10)
        part = table(layouts, i, episode_id=[i] * 30)
        parts.append(part.set_column(part.column_names.index("step"), "step", pa.array(step)))
    pq.write_table(pa.concat_tables(parts), tmp_path / "t.parquet")
    opened, _ = imported(tmp_path / "t.parquet", tmp_path)
    assert (opened.found, opened.accepted) == (EPISODES, EPISODES - 1)
    assert "step, row 20" in opened.refused[0].reason
    assert "a column `episode` that says so" in opened.refused[0].reason


def test_rows_that_begin_anew_in_what_is_called_an_episode_are_refused(layouts, tmp_path):
    """A counter of another kind, of a phase, must not cut episodes into parts."""
    parts = []
    for i in range(EPISODES):
        part = table(layouts, i, episode=[i] * 30).drop_columns(["run"])
        step = pa.array(np.arange(30) % 10)
        parts.append(part.set_column(part.column_names.index("step"), "step", step))
    pq.write_table(pa.concat_tables(parts), tmp_path / "t.parquet")
    source = ParquetFiles(tmp_path / "t.parquet")
    assert source.labels.episode == "episode"
    assert len(list(source.episodes(["tool_x_m"], "episode"))) == EPISODES


def test_a_damaged_file_does_not_keep_the_others_from_being_looked_at(layouts, tmp_path):
    folder = tmp_path / "recordings"
    folder.mkdir()
    for i in range(EPISODES):
        pq.write_table(table(layouts, i), folder / f"{i}.parquet", compression="none")
    data = bytearray((folder / "3.parquet").read_bytes())
    data[100:2000] = bytes(1900)
    (folder / "3.parquet").write_bytes(data)
    assert ParquetFiles(folder).labels.episode is None
