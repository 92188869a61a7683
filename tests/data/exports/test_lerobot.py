"""The export holds what the dataset holds, in the layout that LeRobot's v3.0 reads."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from genpolicy.data.dataset import load_dataset
from genpolicy.data.exports import lerobot
from genpolicy.data.exports.lerobot import export_lerobot
from genpolicy.data.formats.opening import open_dataset
from genpolicy.errors import ContractError

OWN = 10
"""Numbers of the streams `robot`: place, rotation, opening."""


@pytest.fixture
def exported(data, tmp_path):
    written = export_lerobot(data, tmp_path / "out", split="train")
    return tmp_path / "out", written


def frames_of(folder):
    files = sorted((folder / "data").rglob("*.parquet"))
    return pd.concat([pq.read_table(path).to_pandas() for path in files], ignore_index=True)


def numbers(column):
    return np.stack(column.to_numpy())


def test_frames_are_those_of_the_split_and_no_other(exported, data):
    folder, written = exported
    frames, split = frames_of(folder), data.split("train")
    assert (written.episodes, written.frames) == (len(split.episodes), len(frames))
    assert written.features == {
        "observation.state": OWN, "observation.environment_state": 14, "action": OWN,
    }  # fmt: skip
    seen = split.frames.observation.astype(np.float32)
    np.testing.assert_array_equal(numbers(frames["observation.state"]), seen[:, :OWN])
    np.testing.assert_array_equal(numbers(frames["observation.environment_state"]), seen[:, OWN:])
    np.testing.assert_array_equal(numbers(frames["action"]), split.frames.action.astype(np.float32))
    np.testing.assert_array_equal(frames["episode_index"], split.frames.episode)
    np.testing.assert_array_equal(frames["frame_index"], split.frames.index)
    np.testing.assert_array_equal(frames["index"], np.arange(len(frames)))
    np.testing.assert_allclose(frames["timestamp"], split.frames.index * 0.05, rtol=1e-6)


def test_a_row_group_is_an_episode(exported):
    folder, written = exported
    [path] = (folder / "data").rglob("*.parquet")
    file = pq.ParquetFile(path)
    assert file.num_row_groups == written.episodes
    for group in range(file.num_row_groups):
        assert set(file.read_row_group(group)["episode_index"].to_pylist()) == {group}


def test_what_lerobot_looks_up_by_episode(exported, data):
    folder, written = exported
    episodes = pq.read_table(folder / "meta/episodes/chunk-000/file-000.parquet").to_pandas()
    frames = frames_of(folder)
    assert len(episodes) == written.episodes
    for row in episodes.itertuples(index=False):
        own = frames[frames["episode_index"] == row.episode_index]
        assert row.length == len(own)
        assert (row.dataset_from_index, row.dataset_to_index) == (
            own["index"].min(), own["index"].max() + 1,
        )  # fmt: skip
        assert list(row.tasks) == ["tabletop_insertion"]
    assert (
        episodes["episode_uuid"].tolist() == data.split("train").episodes["episode_uuid"].tolist()
    )
    first = frames[frames["episode_index"] == 0]
    np.testing.assert_allclose(
        episodes["stats/action/mean"][0], numbers(first["action"]).mean(0, dtype=np.float64)
    )


def test_the_description_fits_the_frames(exported):
    folder, written = exported
    info = json.loads((folder / "meta/info.json").read_text())
    frames = frames_of(folder)
    assert (info["codebase_version"], info["fps"]) == ("v3.0", 20)
    assert (info["total_episodes"], info["total_frames"]) == (written.episodes, written.frames)
    assert info["splits"] == {"train": f"0:{written.episodes}"}
    assert set(info["features"]) == set(frames.columns)
    for name, feature in info["features"].items():
        values = frames[name]
        if feature["shape"] == [1]:
            assert str(values.dtype) == feature["dtype"]
        else:
            assert numbers(values).shape[1] == feature["shape"][0] == len(feature["names"])
            assert str(numbers(values).dtype) == feature["dtype"]
    tasks = pd.read_parquet(folder / "meta/tasks.parquet")
    assert tasks.index.tolist() == ["tabletop_insertion"]
    assert tasks["task_index"].tolist() == [0]


def test_statistics_are_those_of_all_frames(exported):
    folder, _ = exported
    stats = json.loads((folder / "meta/stats.json").read_text())
    actions = numbers(frames_of(folder)["action"]).astype(np.float64)
    assert set(stats["action"]) == {
        *("min", "max", "mean", "std", "count", "q01", "q10", "q50", "q90", "q99")
    }
    np.testing.assert_allclose(stats["action"]["std"], actions.std(axis=0))
    np.testing.assert_allclose(stats["action"]["q10"], np.quantile(actions, 0.1, axis=0))
    assert stats["action"]["count"] == [len(actions)]


def test_it_comes_back_through_our_own_import(exported, data, tmp_path):
    folder, written = exported
    opened = open_dataset(folder, out=tmp_path / "back")
    assert (opened.accepted, opened.refused) == (written.episodes, ())
    back, split = load_dataset(tmp_path / "back"), data.split("train")
    assert len(back.frames) == written.frames
    np.testing.assert_array_equal(
        np.sort(back.frames.action[:, 0]), np.sort(split.frames.action[:, 0].astype(np.float32))
    )


def test_whose_data_it_is_stands_beside_it(exported, data):
    said = json.loads((exported[0] / "meta/genpolicy.json").read_text())
    assert said["dataset_manifest_sha256"] == data.manifest_sha256
    assert said["split"] == "train"
    assert said["episodes"] == data.split("train").episodes["episode_uuid"].tolist()


def test_equal_datasets_are_equal_bytes(exported, data, tmp_path):
    folder, _ = exported
    export_lerobot(data, tmp_path / "again", split="train")
    for path in sorted(folder.rglob("*")):
        if path.is_file():
            again = tmp_path / "again" / path.relative_to(folder)
            assert again.read_bytes() == path.read_bytes(), path


def with_outcomes(data, outcomes):
    return replace(data, episodes=data.episodes.assign(outcome=outcomes))


def test_what_did_not_succeed_is_left_out_and_counted(data, tmp_path):
    outcomes = ["failure" if row == 1 else "success" for row in range(len(data.episodes))]
    failed = with_outcomes(data, outcomes)
    train = failed.split("train").episodes
    assert "failure" in train["outcome"].tolist()
    written = export_lerobot(failed, tmp_path / "out", split="train")
    assert (written.episodes, written.left_out) == (len(train) - 1, 1)
    frames = frames_of(tmp_path / "out")
    assert sorted(frames["episode_index"].unique()) == list(range(len(train) - 1))
    assert frames["index"].tolist() == list(range(len(frames)))


def test_without_outcomes_everything_is_written(data, tmp_path):
    unknown = with_outcomes(data, ["not_recorded"] * len(data.episodes))
    written = export_lerobot(unknown, tmp_path / "out", split="train")
    assert (written.episodes, written.left_out) == (len(unknown.split("train").episodes), 0)


def test_a_file_that_is_full_is_followed_by_another(data, tmp_path, monkeypatch):
    monkeypatch.setattr(lerobot, "MAXIMUM_FILE_BYTES", 30_000)
    monkeypatch.setattr(lerobot, "FILES_PER_CHUNK", 2)
    written = export_lerobot(data, tmp_path / "out", split="train")
    names = [
        path.relative_to(tmp_path / "out").as_posix()
        for path in sorted((tmp_path / "out" / "data").rglob("*.parquet"))
    ]
    assert names[:3] == [f"data/chunk-{place}.parquet" for place in
                         ("000/file-000", "000/file-001", "001/file-000")]  # fmt: skip
    frames = frames_of(tmp_path / "out")
    assert len(frames) == written.frames
    assert frames["index"].tolist() == list(range(len(frames)))
    episodes = pq.read_table(tmp_path / "out/meta/episodes/chunk-000/file-000.parquet").to_pandas()
    for row in episodes.to_dict("records"):
        place = lerobot.DATA_PATH.format(
            chunk_index=row["data/chunk_index"], file_index=row["data/file_index"]
        )
        held = pq.read_table(tmp_path / "out" / place)["episode_index"].to_pylist()
        assert row["episode_index"] in held


def test_a_robot_that_nobody_names_is_all_state(data, tmp_path):
    channels = [
        {**channel, "stream": "everything"}
        for channel in data.manifest["observation_contract"]["channels"]
    ]
    contract = {**data.manifest["observation_contract"], "channels": channels}
    other = replace(data, manifest={**data.manifest, "observation_contract": contract})
    written = export_lerobot(other, tmp_path / "out", split="test")
    assert written.features == {"observation.state": 24, "action": 10}


def test_a_rate_that_is_no_whole_number_is_refused_before_anything_is_written(data, tmp_path):
    action = {**data.manifest["action_contract"], "period_s": 0.07}
    other = replace(data, manifest={**data.manifest, "action_contract": action})
    with pytest.raises(ContractError, match=r"0\.07 s, expected a whole number"):
        export_lerobot(other, tmp_path / "out", split="train")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("rate", [10, 15, 20, 30, 50, 60, 100])
def test_common_rates_are_whole_numbers(rate):
    assert lerobot._fps(1.0 / rate) == rate


def test_a_feature_of_one_number_is_a_column_of_numbers(data, tmp_path):
    """LeRobot 0.4 casts shape (1,) to a plain number, and refuses a list of one."""
    channels = data.manifest["observation_contract"]["channels"]
    starts = np.cumsum([0, *(len(channel["components"]) for channel in channels)])
    kept = [
        number for number, channel in enumerate(channels)
        if channel["stream"] == "robot" or channel["name"] == "post_position_m"
    ]  # fmt: skip
    columns = np.concatenate([np.arange(starts[one], starts[one + 1]) for one in kept])
    contract = {**data.manifest["observation_contract"], "channels": [channels[k] for k in kept]}
    narrow = replace(
        data, manifest={**data.manifest, "observation_contract": contract},
        frames=replace(data.frames, observation=data.frames.observation[:, columns]),
    )  # fmt: skip
    written = export_lerobot(narrow, tmp_path / "out", split="train")
    name = "observation.environment_state"
    assert written.features[name] == 1
    [path] = (tmp_path / "out" / "data").rglob("*.parquet")
    assert pq.read_schema(path).field(name).type == pa.float32()
    seen = data.split("train").frames.observation[:, columns[-1]].astype(np.float32)
    np.testing.assert_array_equal(frames_of(tmp_path / "out")[name], seen)
    info = json.loads((tmp_path / "out/meta/info.json").read_text())
    assert info["features"][name]["shape"] == [1]
    stats = json.loads((tmp_path / "out/meta/stats.json").read_text())
    assert stats[name]["mean"] == [pytest.approx(seen.astype(np.float64).mean())]
    opened = open_dataset(tmp_path / "out", out=tmp_path / "back")
    assert (opened.accepted, opened.refused) == (written.episodes, ())
    back = load_dataset(tmp_path / "back").frames.observation
    assert np.isin(seen, back.astype(np.float32)).all()
