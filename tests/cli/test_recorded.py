"""What decides was recorded, in whatever way: `genpolicy audit` names it, through every layout."""

import json
import sys
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import zarr

sys.path.insert(0, str(Path(__file__).parents[1] / "audit"))

from planar import planar

from genpolicy.audit import learned
from genpolicy.audit.data import canonical
from genpolicy.audit.variable import numbered
from genpolicy.cli.main import main

EPISODES = 100
RATE_HZ = 10
SIDES = ("left", "right", "over")
STATE = ("x_m", "y_m", "goal_x_m", "goal_y_m")


@pytest.fixture(autouse=True)
def _few_learned(monkeypatch):
    """A sixth of the situations that are asked by what predicts the action: half of the time."""
    monkeypatch.setattr(learned, "QUERIES", 100)


@pytest.fixture(scope="module")
def data():
    """Planar rows in which somebody decided the side, and who: no label says so."""
    data = canonical(planar(episodes=EPISODES, modes="operator")[0])
    return data, numbered(data.episodes.operator)


def episodes_of(data):
    """State (n, 4) and action (n, 2) of each episode."""
    for number in range(EPISODES):
        rows = np.flatnonzero(data.episode == number)
        yield number, data.observation[rows, :4].astype("f4"), data.action[rows].astype("f4")


def vectors(values):
    return pa.FixedSizeListArray.from_arrays(pa.array(values.reshape(-1)), values.shape[1])


def lerobot(root, data, said, more=None):
    """A LeRobot v2.1 dataset whose list of episodes says something of each."""
    names = {"observation.state": list(STATE), "action": ["x_m", "y_m"]}
    features = {
        name: {"dtype": "float32", "shape": [len(parts)], "names": parts}
        for name, parts in names.items()
    }
    info = {
        "codebase_version": "v2.1", "fps": RATE_HZ, "features": features,
        "total_episodes": EPISODES, "data_path":
        "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet",
    }  # fmt: skip
    folder = root / "data" / "chunk-000"
    folder.mkdir(parents=True)
    (root / "meta").mkdir()
    (root / "meta" / "info.json").write_text(json.dumps(info))
    lines = []
    for number, state, action in episodes_of(data):
        lines.append(json.dumps({"episode_index": number, "length": len(state), **said(number)}))
        table = {
            "observation.state": vectors(state), "action": vectors(action),
            "episode_index": np.full(len(state), number), "frame_index": np.arange(len(state)),
            **(more(number, len(state)) if more else {}),
        }  # fmt: skip
        pq.write_table(pa.table(table), folder / f"episode_{number:06d}.parquet")
    (root / "meta" / "episodes.jsonl").write_text("\n".join(lines) + "\n")
    return root


def of_a_list(root, data, told):
    lerobot(root, data, lambda k: {"scene": {"side": SIDES[told[k]]}, "tags": ["of May"]})
    return root, "scene.side"


def of_a_wide_column(root, data, told):
    """An embedding of what was asked of the person, which the policy does not see."""
    rows = np.random.default_rng(5).normal(size=(3, 16)).astype("f4")

    def embedding(number, n):
        return {"task_embedding": vectors(np.tile(rows[told[number]], (n, 1)))}

    return lerobot(root, data, lambda k: {}, embedding), "task_embedding"


def of_a_group(root, data, told):
    path = root.with_suffix(".hdf5")
    with h5py.File(path, "w") as file:
        file.create_group("data").attrs["env_args"] = json.dumps(
            {"env_kwargs": {"control_freq": RATE_HZ}}
        )
        for number, state, action in episodes_of(data):
            demo = file.create_group(f"data/demo_{number}")
            demo["actions"], demo["obs/state"] = action, state
            demo["meta/side"] = SIDES[told[number]]
    return path, "meta/side"


def of_a_mask(root, data, told):
    path, _ = of_a_group(root, data, np.zeros(EPISODES, dtype=int))
    with h5py.File(path, "a") as file:
        for side in set(told):
            file[f"mask/lamp_{side}"] = [b"demo_%d" % k for k in np.flatnonzero(told == side)]
        file["mask/train"] = [b"demo_%d" % k for k in range(70)]
    return path, "mask/lamp_"


def of_a_meta_array(root, data, told):
    path = root.with_suffix(".zarr")
    group = zarr.open_group(str(path), mode="w", zarr_format=2)
    parts = list(episodes_of(data))
    onehot = np.eye(3)[told]
    ends = np.cumsum([len(state) for _, state, _ in parts])
    for name, values in {
        "data/state": np.concatenate([state for _, state, _ in parts]),
        "data/action": np.concatenate([action for _, _, action in parts]),
        "meta/episode_ends": ends, "meta/goal": onehot,
    }.items():  # fmt: skip
        group.create_array(name, data=values, chunks=(512, *values.shape[1:]))
    return path, "goal"


def of_a_session(root, data, told):
    """Who came on which day decided: `run` is the day, and rows begin anew in it."""
    order = np.argsort(told, kind="stable")
    parts = {number: (state, action) for number, state, action in episodes_of(data)}
    tables = []
    for number in order:
        state, action = parts[number]
        tables.append(pa.table({
            "run": [f"day {told[number]}"] * len(state), "frame": np.arange(len(state)),
            **{f"state_{name}": state[:, k] for k, name in enumerate(STATE)},
            "action_x_m": action[:, 0], "action_y_m": action[:, 1],
        }))  # fmt: skip
    path = root.with_suffix(".parquet")
    pq.write_table(pa.concat_tables(tables), path)
    return path, "run"


@pytest.mark.parametrize(
    "recorded",
    [of_a_list, of_a_wide_column, of_a_group, of_a_mask, of_a_meta_array, of_a_session],
)
def test_what_decides_is_named(data, tmp_path, recorded):
    path, name = recorded(tmp_path / "recordings", *data)
    assert main(["audit", str(path), "--out", str(tmp_path / "audit")]) == 0
    said = json.loads((tmp_path / "audit" / "audit.json").read_text())
    assert (said["verdict"], said["variable"][: len(name)]) == ("hidden_state", name)
