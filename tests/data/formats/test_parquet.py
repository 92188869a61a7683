"""Plain Parquet: long tables, files per episode, and tables that lie."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from genpolicy.data.dataset import load_dataset
from genpolicy.data.formats import open_dataset, propose
from genpolicy.data.formats import segments as segments_module
from genpolicy.data.formats import tables as tables_module
from genpolicy.data.formats.contract import load_contract, write_contract
from genpolicy.errors import BadInputError

UUIDS = [f"00000000-0000-4000-8000-{i:012d}" for i in range(8)]


def rows(layouts, number, **changes):
    """One episode of scalar columns, as a person's own recorder writes them."""
    state, action = layouts.samples(number)
    plain = {
        "episode_uuid": [UUIDS[number]] * 30,
        "timestamp": 100.0 * number + np.arange(30) / 20,
        "step": np.arange(30),
        "tool_x_m": state[:, 0],
        "tool_y_m": state[:, 1],
        "load_n": 3.0 * state[:, 2],
        "action_tool_x_m": action[:, 0],
        "action_tool_y_m": action[:, 1],
        "operator": [f"op{number % 2}"] * 30,
        "success": [number != 4] * 30,
        "phase": ["reach"] * 20 + ["hold"] * 10,
        "reward": np.zeros(30),
        "picture": [b"jpeg"] * 30,
    }
    return pa.table({**plain, **changes})


@pytest.fixture
def long(layouts, tmp_path):
    path = tmp_path / "long.parquet"
    pq.write_table(pa.concat_tables([rows(layouts, i) for i in range(8)]), path, row_group_size=70)
    return path


def rewrite(path, layouts, number, **changes):
    parts = [rows(layouts, i, **(changes if i == number else {})) for i in range(8)]
    pq.write_table(pa.concat_tables(parts), path, row_group_size=70)


def test_a_long_table(long, layouts, tmp_path):
    opened = open_dataset(long, out=tmp_path / "out")
    assert (opened.found, opened.accepted) == (8, 8)
    contract = opened.contract
    assert contract.pairing == {"action_tool_x_m": "tool_m.x", "action_tool_y_m": "tool_m.y"}
    assert [(c.name, c.unit) for c in contract.channels] == [("tool_m", "m"), ("load_n", "N")]
    assert contract.rate_hz == 20.0
    assert contract.time_origin == "recording"
    dataset = load_dataset(tmp_path / "out")
    assert dataset.episodes["episode_uuid"].tolist() == UUIDS
    assert dataset.episodes["operator"].tolist() == ["op0", "op1"] * 4
    assert dataset.episodes["outcome"].tolist()[3:6] == ["success", "failure", "success"]
    assert dataset.manifest["phases"] == ["hold", "reach"]
    np.testing.assert_allclose(
        dataset.frames.event_time_s[dataset.frames.episode == 3], 300 + np.arange(30) / 20
    )
    assert "picture" in " ".join(opened.notes)


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


FAULTS = {
    "step, row 5": {"step": np.arange(30) + (np.arange(30) >= 5)},
    "timestamp, row 6": {"timestamp": 300 + np.where(np.arange(30) == 6, 0, np.arange(30)) / 20},
    "timestamp, row 2 is 1e+30": {"timestamp": [300.0, 300.05] + [1e30] * 28},
    "row 8, column tool_x_m is nan": {"tool_x_m": pa.array([0.0] * 8 + [None] + [0.1] * 21)},
    "row 9, column action_tool_y_m is inf": {
        "action_tool_y_m": np.where(np.arange(30) == 9, np.inf, 0.0)
    },
    "operator, row 12": {"operator": ["op0"] * 12 + ["op1"] * 18},
    "is 'x', expected a lower-case UUID": {"episode_uuid": ["x"] * 30},
    "expected a lower-case UUID": {"episode_uuid": [UUIDS[3].replace("8", "A")] * 30},
}


@pytest.mark.parametrize("reason", list(FAULTS))
def test_a_bad_episode_is_refused_by_name_with_row_and_reason(long, layouts, tmp_path, reason):
    rewrite(long, layouts, 3, **FAULTS[reason])
    opened = open_dataset(long, out=tmp_path / "out")
    assert (opened.found, opened.accepted) == (8, 7)
    assert reason in opened.refused[0].reason
    assert opened.refused[0].file.startswith("long.parquet#")


def test_an_outcome_that_is_no_outcome(long, layouts, tmp_path):
    outcomes = ["success"] * 3 + ["splendid"] + ["failure"] * 4
    parts = [rows(layouts, i, success=[outcomes[i]] * 30) for i in range(8)]
    pq.write_table(pa.concat_tables(parts), long)
    opened = open_dataset(long, out=tmp_path / "out")
    assert [r.file for r in opened.refused] == [f"long.parquet#{UUIDS[3]}"]
    assert "splendid" in opened.refused[0].reason


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


def test_damage_in_the_middle_refuses_what_lies_behind(long, tmp_path):
    whole = bytearray(long.read_bytes())
    metadata = pq.ParquetFile(long).metadata
    place = metadata.row_group(2).column(3).data_page_offset
    whole[place : place + 40] = bytes(40)
    long.write_bytes(whole)
    opened = open_dataset(long, out=tmp_path / "out")
    assert opened.found == 8
    assert opened.accepted == 4  # 140 rows stand before the damaged group
    assert all("not a readable table" in r.reason for r in opened.refused)


@pytest.mark.parametrize("data", [b"", b"PAR1", b"PAR1" + bytes(100) + b"PAR1", b"x" * 50])
def test_no_parquet_at_all(tmp_path, data):
    path = tmp_path / "x.parquet"
    path.write_bytes(data)
    with pytest.raises(BadInputError, match=r"x\.parquet"):
        open_dataset(path, out=tmp_path / "out")


def test_a_row_bomb_is_refused_by_what_it_claims(tmp_path, monkeypatch):
    """80 MB of numbers in 45 kB; the cap is lowered instead of the bomb made bigger."""
    count = 5_000_000
    path = tmp_path / "bomb.parquet"
    names = ("state", "action")
    table = pa.table({name: pa.array(np.zeros(count)).dictionary_encode() for name in names})
    pq.write_table(table, path, compression="zstd", row_group_size=count)
    assert path.stat().st_size < 100_000
    monkeypatch.setattr(tables_module, "MAXIMUM_SOURCE_ROWS", 1_000_000)
    with pytest.raises(BadInputError, match="is 5000000 rows, expected"):
        open_dataset(path, out=tmp_path / "out")
    monkeypatch.undo()
    with pytest.raises(BadInputError, match="5000000 rows long, expected at most 1000000"):
        open_dataset(path, out=tmp_path / "out")


def test_a_row_of_too_many_numbers_is_refused_by_what_it_claims(tmp_path):
    path = tmp_path / "wide.parquet"
    wide = pa.array([np.zeros(5000)])
    pq.write_table(pa.table({"state": wide, "action": wide}), path)
    with pytest.raises(BadInputError, match="5000 values in 1 rows"):
        open_dataset(path, out=tmp_path / "out")


def test_an_endless_episode_in_a_long_table_is_refused(long, tmp_path, monkeypatch):
    table = pq.read_table(long)
    ids = [UUIDS[0]] * 90 + table["episode_uuid"].to_pylist()[90:]
    pq.write_table(table.set_column(0, "episode_uuid", pa.array(ids)), long)
    monkeypatch.setattr(segments_module, "MAXIMUM_EPISODE_ROWS", 60)
    opened = open_dataset(long, out=tmp_path / "out")
    assert (opened.found, opened.accepted) == (6, 5)
    assert "90 rows long, expected at most 60" in opened.refused[0].reason


def test_what_will_be_refused_decides_nothing_of_the_proposal(long, layouts):
    clean = propose(long)
    rewrite(long, layouts, 0, action_tool_x_m=np.full(30, np.nan))
    assert propose(long) == clean.model_copy(update={"frozen": propose(long).frozen})
    assert propose(long).frozen is not None


def test_ragged_vectors_are_refused_by_row(tmp_path):
    folder = tmp_path / "ragged"
    folder.mkdir()
    rng = np.random.default_rng(0)
    for i in range(5):
        state = rng.normal(size=(20, 2)).tolist()
        if i == 2:
            state[7] = [1.0, 2.0, 3.0]
        table = pa.table({"state": state, "action": rng.normal(size=(20, 2)).tolist()})
        pq.write_table(table, folder / f"{i}.parquet")
    opened = open_dataset(folder, out=tmp_path / "out")
    assert [r.file for r in opened.refused] == ["2.parquet"]
    assert "state, row 7 is 3 numbers wide" in opened.refused[0].reason
    assert opened.contract.pairing is None


def test_a_corrected_contract_decides(long, layouts, tmp_path):
    contract = propose(long)
    lowest = [layouts.samples(i)[0][:, 0].min() for i in range(8)]
    limit = float(np.median(lowest))
    edited = contract.model_copy(
        update={
            "ranges": {"tool_m.x": [limit, 2.0]},
            "labels": contract.labels.model_copy(update={"phase": None}),
        }
    )
    write_contract(tmp_path / "contract.yaml", edited)
    opened = open_dataset(
        long, out=tmp_path / "out", contract=load_contract(tmp_path / "contract.yaml")
    )
    assert len(opened.refused) == sum(low < limit for low in lowest) > 0
    assert "tool_m.x" in opened.refused[0].reason
    assert load_dataset(tmp_path / "out").manifest["phases"] == ["all"]


def test_a_contract_that_names_what_is_not_there(long, tmp_path):
    contract = propose(long)
    for part, text in (
        (
            {"channels": [contract.channels[0].model_copy(update={"columns": ["a", "b"]})]},
            "column a",
        ),
        (
            {
                "channels": [
                    contract.channels[0].model_copy(update={"columns": ["tool_x_m[3]", "step"]})
                ]
            },
            "tool_x_m is 1 numbers wide, expected element 3",
        ),
        (
            {"channels": [contract.channels[0].model_copy(update={"columns": ["phase", "step"]})]},
            "phase is not numbers per row",
        ),
        ({"labels": contract.labels.model_copy(update={"object": "thing"})}, "label object"),
    ):
        with pytest.raises(BadInputError, match=text):
            open_dataset(long, out=tmp_path / "out", contract=contract.model_copy(update=part))


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
    np.testing.assert_allclose(dataset.frames.observation[:30], state[:, :2], atol=1e-12)
    np.testing.assert_allclose(dataset.frames.action[:30], action[:, :2], atol=1e-12)
