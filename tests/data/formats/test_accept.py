"""An episode of others is accepted in SI units, or refused by name with its row."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from long_tables import UUIDS, rows

from genpolicy.data.dataset import load_dataset
from genpolicy.data.formats import open_dataset


@pytest.fixture
def long(layouts, tmp_path):
    path = tmp_path / "long.parquet"
    pq.write_table(pa.concat_tables([rows(layouts, i) for i in range(8)]), path, row_group_size=70)
    return path


def test_an_outcome_that_is_no_outcome(long, layouts, tmp_path):
    outcomes = ["success"] * 3 + ["splendid"] + ["failure"] * 4
    parts = [rows(layouts, i, success=[outcomes[i]] * 30) for i in range(8)]
    pq.write_table(pa.concat_tables(parts), long)
    opened = open_dataset(long, out=tmp_path / "out")
    assert [r.file for r in opened.refused] == [f"long.parquet#{UUIDS[3]}"]
    assert "splendid" in opened.refused[0].reason


@pytest.mark.parametrize("kind", ["i8", "u8"])
def test_a_clock_of_nanoseconds_keeps_its_digits_and_its_sign(layouts, tmp_path, kind):
    folder = tmp_path / "clock"
    folder.mkdir()
    begin = 1_700_000_000_000_000_001
    for i in range(5):
        state, action = layouts.samples(i)
        times = begin + 10_000_000_000 * i + 50_000_001 * np.arange(30)
        if i == 3:
            times[7] = times[6] - 1
        columns = {"stamp": times.astype(kind), "state": state.tolist(), "action": action.tolist()}
        pq.write_table(pa.table(columns), folder / f"{i}.parquet")
    opened = open_dataset(folder, out=tmp_path / "out")
    assert (opened.contract.time_unit, opened.contract.time_origin) == ("ns", "recording")
    assert opened.contract.rate_hz == 20.0
    assert [r.file for r in opened.refused] == ["3.parquet"]
    assert "stamp, row 7 is -1e-09 s later" in opened.refused[0].reason
    recorded = load_dataset(tmp_path / "out").episodes["recorded_at_s"].to_numpy()
    np.testing.assert_allclose(np.diff(recorded), [10, 10, 20])


def test_millimetres_and_degrees_become_metres_and_radians(layouts, tmp_path):
    folder = tmp_path / "mm"
    folder.mkdir()
    for i in range(5):
        state, action = layouts.samples(i)
        columns = {
            "tool_x_mm": 1000 * state[:, 0],
            "wrist_deg": np.degrees(state[:, 1]),
            "action_tool_x_mm": 1000 * action[:, 0],
            "action_wrist_deg": np.degrees(action[:, 1]),
        }
        pq.write_table(pa.table(columns), folder / f"{i}.parquet")
    opened = open_dataset(folder, out=tmp_path / "out")
    assert [c.unit for c in opened.contract.channels] == ["mm", "deg"]
    assert opened.contract.pairing == {
        "action_tool_x_mm": "tool_m.x", "action_wrist_deg": "wrist_rad.wrist",
    }  # fmt: skip
    dataset = load_dataset(tmp_path / "out")
    assert dataset.manifest["action_contract"]["units"] == ["m", "rad"]
    state, action = layouts.samples(0)
    rows = dataset.frames.episode == dataset.episodes["source_file"].tolist().index("0.parquet")
    np.testing.assert_allclose(dataset.frames.observation[rows], state[:, :2], atol=1e-12)
    np.testing.assert_allclose(dataset.frames.action[rows], action[:, :2], atol=1e-12)


@pytest.mark.parametrize("words", [("yes", "no"), ("True", "False"), ("1.0", "0.0")])
def test_flags_of_an_episode_are_read_by_the_same_words_as_those_of_its_rows(
    long, layouts, tmp_path, words
):
    parts = [rows(layouts, i, is_recovery=[words[i % 2]] * 30) for i in range(8)]
    pq.write_table(pa.concat_tables(parts), long)
    opened = open_dataset(long, out=tmp_path / "out")
    assert opened.contract.labels.is_recovery == "is_recovery" and not opened.refused
    kept = load_dataset(tmp_path / "out").episodes.set_index("episode_uuid")["is_recovery"]
    assert [kept[uuid] for uuid in UUIDS] == [True, False] * 4
