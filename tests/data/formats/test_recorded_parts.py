"""What was recorded in several values at once: mappings, lists, groups, and rows of numbers."""

import json

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import zarr

from genpolicy.data.dataset import load_dataset
from genpolicy.data.formats.opening import open_dataset
from genpolicy.data.variables import Runs, stored

EPISODES = 6
GOALS = np.eye(16, dtype="f4")


def values_of(path, tmp_path):
    """What was kept of the recordings, by column in the order of the files, and the notes."""
    opened = open_dataset(path, out=tmp_path / "out")
    assert opened.accepted == EPISODES
    episodes = load_dataset(tmp_path / "out").episodes
    order = np.argsort(episodes["source_file"].to_numpy())
    kept = {name: [runs[k] for k in order] for name, runs in stored(episodes).items()}
    return kept, " ".join(opened.notes)


def single(runs):
    return [None if item is None else item.values[0] for item in runs]


def said(number):
    """What people write of an episode into its list."""
    side = ("left", "right")[number % 2]
    return {
        "scene": {"side": side, "lamp": {"on": number % 2 == 0}},
        "tags": [side, "fast"],
        "goal": [number % 2, 1 - number % 2],
        "nothing": None,
        "steps": [{"text": side, "from": 0}, {"text": "leave", "from": 20}],
    }


def check_said(kept, notes):
    sides = ["left", "right"] * 3
    assert single(kept["scene.side"]) == sides
    assert [str(v).lower() for v in single(kept["scene.lamp.on"])] == ["true", "false"] * 3
    assert single(kept["tags"]) == [f"{side}, fast" for side in sides]
    assert single(kept["goal"]) == ["0, 1", "1, 0"] * 3
    assert set(kept) == {"scene.side", "scene.lamp.on", "tags", "goal"}
    assert "says what was done and when: steps." in notes


def test_the_list_of_a_lerobot_dataset(layouts, tmp_path):
    root = layouts.v2(tmp_path / "recordings")
    lines = [
        {"episode_index": i, "length": 30, "tasks": ["push"], **said(i)} for i in range(EPISODES)
    ]
    layouts.write(root / "meta" / "episodes.jsonl", lines)
    check_said(*values_of(root, tmp_path))


def test_the_table_of_episodes_of_a_lerobot_dataset(layouts, tmp_path):
    root = layouts.v3(tmp_path / "recordings")
    path = root / "meta" / "episodes" / "chunk-000" / "file-000.parquet"
    table = pq.read_table(path).drop_columns(["operator"])
    for name in said(0):
        table = table.append_column(name, pa.array([said(i)[name] for i in range(EPISODES)]))
    table = table.append_column("tasks", pa.array([["push"]] * EPISODES))
    table = table.append_column("note/side", pa.array(["ab"[i % 2] for i in range(EPISODES)]))
    table = table.append_column("thumbnail", pa.array([b"png"] * EPISODES))
    pq.write_table(table, path)
    kept, notes = values_of(root, tmp_path)
    assert single(kept.pop("note/side")) == ["a", "b"] * 3
    check_said(kept, notes)
    assert "Not read from the list of episodes: thumbnail (no plain values)." in notes


@pytest.mark.parametrize("described", [True, False])
def test_several_texts_of_an_episode(layouts, tmp_path, described):
    root = layouts.v2(tmp_path / "recordings")
    lines = [
        {"episode_index": i, "length": 30, "tasks": ["push", "left"] if i % 2 else ["push"]}
        for i in range(EPISODES)
    ]
    layouts.write(root / "meta" / "episodes.jsonl", lines)
    if not described:
        (root / "meta" / "tasks.jsonl").unlink()
    assert single(values_of(root, tmp_path)[0]["tasks"]) == ["push", "push, left"] * 3


def test_one_instruction_is_not_told_twice(layouts, tmp_path):
    assert not values_of(layouts.v2(tmp_path / "recordings"), tmp_path)[0]


def test_groups_and_arrays_of_an_hdf5_file(layouts, tmp_path):
    with h5py.File(tmp_path / "demo.hdf5", "w") as file:
        for i in range(EPISODES):
            state, action = layouts.samples(i)
            demo = file.create_group(f"data/demo_{i}")
            demo["actions"], demo["obs/joint_pos"] = action, state
            demo["meta/side"] = said(i)["tags"][0]
            demo["meta"].attrs["said"] = json.dumps(said(i)["scene"])
            demo.attrs["tags"] = said(i)["tags"]
            demo.attrs["goal"] = np.array(said(i)["goal"])
            demo["obs"].attrs["camera"] = f"c{i % 2}"
            demo["goal_language"] = np.tile(GOALS[i % 3], (30, 1))
            demo["states"] = np.cumsum(np.ones((30, 4)), axis=0)
            demo.attrs["model_file"] = "<mujoco>" + "<body/>" * 99
    kept, notes = values_of(tmp_path / "demo.hdf5", tmp_path)
    sides = ["left", "right"] * 3
    assert single(kept["meta/side"]) == single(kept["meta/said.side"]) == sides
    assert single(kept["tags"]) == [f"{side}, fast" for side in sides]
    assert single(kept["goal"]) == ["0, 1", "1, 0"] * 3
    assert single(kept["obs/camera"]) == ["c0", "c1"] * 3
    assert len(set(single(kept["goal_language"]))) == 3
    assert "states" not in kept
    assert "changes row by row: states." in notes
    assert "the model of a simulator: model_file." in notes


def buffer(layouts, tmp_path, **more):
    parts = [layouts.samples(i) for i in range(EPISODES)]
    group = zarr.open_group(str(tmp_path / "arm.zarr"), mode="w", zarr_format=2)
    arrays = {
        "data/state": np.concatenate([state for state, _ in parts]),
        "data/action": np.concatenate([action for _, action in parts]),
        "meta/episode_ends": np.arange(1, EPISODES + 1) * 30,
        **more,
    }
    for name, values in arrays.items():
        group.create_array(name, data=values, chunks=(64, *values.shape[1:]))
    return tmp_path / "arm.zarr"


def test_arrays_of_several_numbers_an_episode(layouts, tmp_path):
    places = np.random.default_rng(0).normal(size=(EPISODES, 2))
    path = buffer(
        layouts, tmp_path,
        **{
            "meta/goal": np.array([said(i)["goal"] for i in range(EPISODES)]),
            "meta/place": places, "data/scene": GOALS[np.arange(EPISODES) % 2],
            "meta/names": np.array(["a", "b", "c"]), "meta/limits": np.zeros((3, 2)),
            "meta/pictures": np.zeros((EPISODES, 4, 4)), "meta/stage": np.arange(180) // 15 % 2,
            "data/embedding": np.repeat(GOALS[np.arange(EPISODES) % 3], 30, axis=0),
            "data/force": np.random.default_rng(1).normal(size=(180, 3)),
        },
    )  # fmt: skip
    root = zarr.open_group(str(path), mode="a", zarr_format=2)
    root.attrs["sides"] = ["left", "right"] * 3
    root["meta"].attrs["who"] = [{"name": f"op{i % 3}"} for i in range(EPISODES)]
    kept, notes = values_of(path, tmp_path)
    assert single(kept["goal"]) == ["0, 1", "1, 0"] * 3
    assert len(set(single(kept["place"]))) == EPISODES
    assert len(set(single(kept["scene"]))) == 2
    assert len(set(single(kept["embedding"]))) == 3
    assert single(kept["sides"]) == ["left", "right"] * 3
    assert single(kept["who.name"]) == ["op0", "op1", "op2"] * 2
    assert kept["stage"][0] == Runs((0, 15), (0.0, 1.0))
    assert "Not read: pictures (no plain columns)." in notes
    assert "Not read: limits, names (of another length than the episodes)." in notes
    assert "changes row by row: force." in notes


def test_what_comes_of_an_episode_is_named_and_not_asked(layouts, tmp_path):
    ends = np.random.default_rng(0).normal(size=(EPISODES, 4))
    path = buffer(layouts, tmp_path, **{"meta/final_state": ends, "meta/lamp": np.arange(EPISODES)})
    root = zarr.open_group(str(path), mode="a", zarr_format=2)
    root.attrs["episode_stats"] = [{"r": float(i), "l": 30 + i} for i in range(EPISODES)]
    root.attrs["log"] = [{"episode": {"t": i}, "side": "ab"[i % 2]} for i in range(EPISODES)]
    kept, notes = values_of(path, tmp_path)
    assert set(kept) == {"lamp", "log.side"}
    assert "comes of the episode: episode_stats, final_state, log.episode.t." in notes


@pytest.mark.parametrize("version", ["v2", "v3"])
def test_that_rows_and_episodes_have_numbers_is_no_news(layouts, tmp_path, version):
    notes = values_of(getattr(layouts, version)(tmp_path / "recordings"), tmp_path)[1]
    assert "index" not in notes


def test_what_of_a_buffer_cannot_be_read_beside_refuses_nothing(layouts, tmp_path):
    path = buffer(
        layouts, tmp_path, **{"data/wide": np.ones((180, 5)), "meta/lamp": np.arange(EPISODES)}
    )
    for name in ("data/wide", "meta/lamp"):
        for chunk in (path / name).iterdir():
            if not chunk.name.startswith("."):
                chunk.write_bytes(b"damaged")
    contract = open_dataset(buffer(layouts, tmp_path / "plain"), out=tmp_path / "first").contract
    opened = open_dataset(path, out=tmp_path / "out", contract=contract)
    assert opened.accepted == EPISODES
    assert "Not looked at as a reason, not readable: lamp, wide." in opened.notes


def test_a_group_an_episode(layouts, tmp_path):
    group = zarr.open_group(str(tmp_path / "arm.zarr"), mode="w", zarr_format=2)
    for i in range(EPISODES):
        state, action = layouts.samples(i)
        one = group.create_group(f"episode_{i}")
        for name, values in {
            "obs/state": state, "action": action, "goal": np.array(said(i)["goal"]),
            "embedding": np.tile(GOALS[i % 3], (30, 1)), "pictures": np.zeros((30, 4, 4)),
        }.items():  # fmt: skip
            one.create_array(name, data=values, chunks=values.shape)
        one.attrs["scene"] = said(i)["scene"]
        one["obs"].attrs["camera"] = f"c{i % 2}"
    kept, notes = values_of(tmp_path / "arm.zarr", tmp_path)
    assert single(kept["goal"]) == ["0, 1", "1, 0"] * 3
    assert single(kept["scene.side"]) == ["left", "right"] * 3
    assert single(kept["obs/camera"]) == ["c0", "c1"] * 3
    assert len(set(single(kept["embedding"]))) == 3
    assert "Not read: pictures (no columns of its rows)." in notes


def tables(layouts, folder, **more):
    """A table an episode; columns as functions of the episode's number."""
    folder.mkdir()
    for i in range(EPISODES):
        state, action = layouts.samples(i)
        table = {
            "observation.state": layouts.vectors(state), "action": layouts.vectors(action),
            **{name: value(i) for name, value in more.items()},
        }  # fmt: skip
        pq.write_table(pa.table(table), folder / f"e{i}.parquet")
    return folder


def test_wide_columns_that_hold_are_one_category_an_episode(layouts, tmp_path):
    path = tables(
        layouts, tmp_path / "r",
        task_embedding=lambda i: layouts.vectors(np.tile(GOALS[i % 2] / 3, (30, 1))),
        onehot=lambda i: pa.array([GOALS[i % 3][:3].tolist()] * 30),
        subgoal=lambda i: layouts.vectors(np.repeat(GOALS[[i % 2, 2]], 15, axis=0)),
        velocity=lambda i: layouts.vectors(np.random.default_rng(i).normal(size=(30, 3))),
        uneven=lambda i: pa.array([[1.0] * (1 + k % 2) for k in range(30)]),
        some=lambda i: layouts.vectors(np.zeros((30, 2 + i % 2))),
    )  # fmt: skip
    kept, notes = values_of(path, tmp_path)
    embeddings = single(kept["task_embedding"])
    assert len(set(embeddings)) == 2 and embeddings[0] == embeddings[2] != embeddings[1]
    assert single(kept["onehot"]) == ["1, 0, 0", "0, 1, 0", "0, 0, 1"] * 2
    assert [item.rows for item in kept["subgoal"]] == [(0, 15)] * EPISODES
    assert single(kept["some"]) == ["0, 0", "0, 0, 0"] * 3
    assert not {"velocity", "uneven"} & set(kept)
    assert "changes row by row: velocity." in notes
    assert "rows of different widths: uneven." in notes


@pytest.mark.parametrize("version", ["v2", "v3"])
def test_wide_columns_of_a_lerobot_dataset(layouts, tmp_path, version):
    root = getattr(layouts, version)(tmp_path / "recordings")
    for path in sorted((root / "data").rglob("*.parquet")):
        table = pq.read_table(path)
        numbers = np.array(table["episode_index"].to_pylist())
        table = table.append_column("embedding", layouts.vectors(GOALS[numbers % 2]))
        table = table.append_column("struct", pa.array([{"a": 1}] * len(numbers)))
        pq.write_table(table, path)
    kept, notes = values_of(root, tmp_path)
    assert len(set(single(kept["embedding"]))) == 2
    assert "Not read: struct (neither numbers nor text)." in notes


def test_numbers_of_a_column_that_the_contract_leaves_out(layouts, tmp_path):
    path = tables(
        layouts, tmp_path / "r",
        lamp=lambda i: layouts.vectors(np.tile([[0.5, i % 2, 1.0]], (30, 1))),
    )  # fmt: skip
    contract = open_dataset(path, out=tmp_path / "first").contract
    channel = contract.channels[0]
    short = channel.model_copy(
        update={"columns": ["observation.state[0:2]"], "components": channel.components[:2]}
    )
    contract = contract.model_copy(update={"channels": [short], "pairing": None, "forms": {}})
    contract = contract.model_copy(update={"frozen": None})
    opened = open_dataset(path, out=tmp_path / "out", contract=contract)
    assert "changes row by row: observation.state[2]." in " ".join(opened.notes)
