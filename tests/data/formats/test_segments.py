"""Episodes cut from long tables."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from long_tables import UUIDS, rows

from genpolicy.data.dataset import load_dataset
from genpolicy.data.formats import open_dataset
from genpolicy.data.formats import segments as segments_module


@pytest.fixture
def long(layouts, tmp_path):
    path = tmp_path / "long.parquet"
    pq.write_table(pa.concat_tables([rows(layouts, i) for i in range(8)]), path, row_group_size=70)
    return path


def test_how_the_table_is_cut_into_files_and_groups_changes_no_frame(long, layouts, tmp_path):
    folder = tmp_path / "files"
    folder.mkdir()
    for i in range(8):
        pq.write_table(rows(layouts, i).drop_columns("episode_uuid"), folder / f"{i}.parquet")
    open_dataset(long, out=tmp_path / "a")
    opened = open_dataset(folder, out=tmp_path / "b")
    assert opened.contract.labels.episode is None
    a, b = load_dataset(tmp_path / "a").frames, load_dataset(tmp_path / "b").frames
    np.testing.assert_array_equal(a.action, b.action)
    np.testing.assert_array_equal(a.observation, b.observation)
    pq.write_table(pq.read_table(long), long, row_group_size=7)
    open_dataset(long, out=tmp_path / "c")
    frames = [(tmp_path / name / "frames.parquet").read_bytes() for name in "ac"]
    assert frames[0] == frames[1]


def test_an_episode_in_two_places_and_a_uuid_twice(long, layouts, tmp_path):
    order = [0, 1, 2, 3, 1, 4, 5, 6, 7]
    pq.write_table(pa.concat_tables([rows(layouts, i) for i in order]), long)
    opened = open_dataset(long, out=tmp_path / "out")
    assert (opened.found, opened.accepted) == (8, 7)
    assert "in 2 places, rows [30, 120]" in opened.refused[0].reason
    folder = tmp_path / "folder"
    folder.mkdir()
    pq.write_table(pa.concat_tables([rows(layouts, i) for i in range(5)]), folder / "a.parquet")
    twice = rows(layouts, 7, episode_uuid=[UUIDS[2]] * 30)
    pq.write_table(twice, folder / "b.parquet")
    opened = open_dataset(folder, out=tmp_path / "out2")
    assert [r.file for r in opened.refused] == [f"b.parquet#{UUIDS[2]}"]
    assert "the episode_uuid of" in opened.refused[0].reason


def test_an_endless_episode_in_a_long_table_is_refused(long, tmp_path, monkeypatch):
    table = pq.read_table(long)
    ids = [UUIDS[0]] * 90 + table["episode_uuid"].to_pylist()[90:]
    pq.write_table(table.set_column(0, "episode_uuid", pa.array(ids)), long)
    monkeypatch.setattr(segments_module, "MAXIMUM_EPISODE_ROWS", 60)
    opened = open_dataset(long, out=tmp_path / "out")
    assert (opened.found, opened.accepted) == (6, 5)
    assert "90 rows long, expected at most 60" in opened.refused[0].reason
