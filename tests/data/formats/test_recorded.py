"""Every layout keeps what else it recorded: text, numbers, by episode or by row, under any name."""

import json
from dataclasses import replace

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import zarr

from genpolicy.data.dataset import load_dataset
from genpolicy.data.formats.opening import open_dataset
from genpolicy.data.formats.recorded import MOST_ELEMENTS, Reasons
from genpolicy.data.formats.source import Column, RawEpisode
from genpolicy.data.formats.zarr_buffer import PUSHT
from genpolicy.data.variables import Runs, stored

EPISODES = 6


def values_of(path, tmp_path, **options):
    """What was kept of the recordings, by column and file of the episode."""
    opened = open_dataset(path, out=tmp_path / "out", **options)
    episodes = load_dataset(tmp_path / "out").episodes
    files = episodes["source_file"].tolist()
    return opened, {n: dict(zip(files, v, strict=True)) for n, v in stored(episodes).items()}


def planted(number, rows=30):
    """Columns of every kind in one episode."""
    return {
        "scenario": [f"kitchen {number % 2}"] * rows,
        "latent": np.full(rows, number % 3),
        "temperature": np.full(rows, 20.0 + number / 7),
        "subgoal": np.repeat([number % 2, 1], rows // 2),
        "noisy": np.random.default_rng(number).normal(size=rows),
        "constant": np.full(rows, 3),
    }


def check(kept, files):
    """The planted columns, whichever layout they came from."""
    assert not {"noisy", "constant"} & set(kept)
    for number, file in files.items():
        assert kept["scenario"][file].values == (f"kitchen {number % 2}",)
        assert float(kept["latent"][file].values[0]) == number % 3
        assert float(kept["temperature"][file].values[0]) == pytest.approx(20 + number / 7)
        switched = ((0.0, 1.0), (0, 15)) if number % 2 == 0 else ((1.0,), (0,))
        assert (kept["subgoal"][file].values, kept["subgoal"][file].rows) == switched


def test_parquet(layouts, tmp_path):
    folder = tmp_path / "recordings"
    folder.mkdir()
    for i in range(EPISODES):
        state, action = layouts.samples(i)
        table = {"observation.x_m": state[:, 0], "action.x_m": action[:, 0], **planted(i)}
        pq.write_table(pa.table(table), folder / f"e{i}.parquet")
    opened, kept = values_of(folder, tmp_path)
    check(kept, {i: f"e{i}.parquet" for i in range(EPISODES)})
    assert any("changes row by row: noisy" in note for note in opened.notes)


def test_a_column_that_only_some_files_have_refuses_nothing(layouts, tmp_path):
    folder = tmp_path / "recordings"
    folder.mkdir()
    for i in range(EPISODES):
        state, action = layouts.samples(i)
        table = {"observation.x_m": state[:, 0], "action.x_m": action[:, 0]}
        more = {"scenario": ["a"] * 30 if i % 2 else np.full(30, 7)} if i else {}
        pq.write_table(pa.table({**table, **more}), folder / f"e{i}.parquet")
    opened, kept = values_of(folder, tmp_path)
    assert opened.accepted == EPISODES
    assert kept["scenario"]["e0.parquet"] is None
    assert kept["scenario"]["e1.parquet"].values == ("a",)
    assert kept["scenario"]["e2.parquet"].values == ("7",)


@pytest.mark.parametrize("version", ["v2", "v3"])
def test_lerobot(layouts, tmp_path, version):
    root = tmp_path / "recordings"
    getattr(layouts, version)(root)
    for path in sorted((root / "data").rglob("*.parquet")):
        table = pq.read_table(path)
        numbers = table["episode_index"].to_pylist()
        columns = {
            name: np.concatenate([planted(n)[name] for n in dict.fromkeys(numbers)])
            for name in planted(0)
        }
        for name, values in columns.items():
            table = table.append_column(name, pa.array(values.tolist()))
        pq.write_table(table, path)
    opened, kept = values_of(root, tmp_path)
    assert opened.accepted == EPISODES
    if version == "v2":
        check(kept, {i: f"data/chunk-000/episode_{i:06d}.parquet" for i in range(EPISODES)})
    else:
        files = [f"data/chunk-000/file-{i // 4:03d}.parquet#episode_{i:06d}" for i in range(6)]
        check(kept, dict(enumerate(files)))
    assert "task_index" not in kept  # the same in all


def test_lerobot_says_of_an_episode_what_the_list_says(layouts, tmp_path):
    root = layouts.v2(tmp_path / "recordings")
    lines = [
        {"episode_index": i, "length": 30, "tasks": ["push"], "tool": f"tool {i % 2}", "t_c": i / 9}
        for i in range(EPISODES)
    ]
    layouts.write(root / "meta" / "episodes.jsonl", lines)
    _, kept = values_of(root, tmp_path)
    assert {runs.values[0] for runs in kept["tool"].values()} == {"tool 0", "tool 1"}
    assert set(kept) == {"tool", "t_c"}


def test_two_instructions_in_one_episode_are_values_by_row(layouts, tmp_path):
    root = layouts.v2(tmp_path / "recordings")
    tasks = [{"task_index": 0, "task": "go left"}, {"task_index": 1, "task": "go right"}]
    layouts.write(root / "meta" / "tasks.jsonl", tasks)
    for i in range(EPISODES):
        half = pa.array(np.repeat([i % 2, 0], 15))
        layouts.write(layouts.file(root, i), layouts.table(i, first=30 * i, task_index=half))
    opened, kept = values_of(root, tmp_path)
    assert opened.accepted == EPISODES
    switched = kept["instruction"]["data/chunk-000/episode_000001.parquet"]
    assert switched == Runs((0, 15), ("go right", "go left"))


def test_zarr_arrays_of_one_number_a_row_or_an_episode(layouts, tmp_path):
    parts = [layouts.samples(i) for i in range(EPISODES)]
    group = zarr.open_group(str(tmp_path / "arm.zarr"), mode="w", zarr_format=2)
    columns = [planted(i) for i in range(EPISODES)]
    arrays = {
        "data/state": np.concatenate([state for state, _ in parts]),
        "data/action": np.concatenate([action for _, action in parts]),
        "data/scenario": np.concatenate([c["scenario"] for c in columns]).astype("<U12"),
        "data/subgoal": np.concatenate([c["subgoal"] for c in columns]).astype("u1"),
        "meta/latent": np.arange(EPISODES) % 3,
        "meta/temperature": 20.0 + np.arange(EPISODES) / 7,
        "meta/episode_ends": np.arange(1, EPISODES + 1) * 30,
    }
    for name, values in arrays.items():
        group.create_array(name, data=values, chunks=(64, *values.shape[1:]))
    _, kept = values_of(tmp_path / "arm.zarr", tmp_path)
    check(kept, {i: f"arm.zarr#episode_{i:06d}" for i in range(EPISODES)})


def test_hdf5_attributes_and_data_sets_of_one_value(layouts, tmp_path):
    with h5py.File(tmp_path / "demo.hdf5", "w") as file:
        for i in range(EPISODES):
            state, action = layouts.samples(i)
            demo = file.create_group(f"data/demo_{i}")
            demo.create_dataset("actions", data=action)
            demo.create_dataset("obs/joint_pos", data=state)
            columns = planted(i)
            demo.attrs["scenario"] = columns["scenario"][0]
            demo.create_dataset("latent", data=columns["latent"][0])
            demo.create_dataset("temperature", data=columns["temperature"][:1])
            demo.create_dataset("subgoal", data=columns["subgoal"])
            demo.create_dataset("words", data=["left" if i % 2 else "right"] * 30)
            demo["elsewhere"] = h5py.ExternalLink("/etc/passwd", "x")
    _, kept = values_of(tmp_path / "demo.hdf5", tmp_path)
    check(kept, {i: f"demo.hdf5#demo_{i}" for i in range(EPISODES)})
    assert kept["words"]["demo.hdf5#demo_1"].values == ("left",)
    assert "elsewhere" not in kept


def spoken(number):
    """What a simulator says of an episode in one text: long, and another one each time."""
    scene = {"objects": [{"path": f"objects/{number}/{k}.xml"} for k in range(20)]}
    return json.dumps({"seed": f"s{977 * number}", "scene": scene, "success": number % 2 == 0,
                       "lang": f"go {('left', 'right')[number % 2]}"})  # fmt: skip


@pytest.mark.parametrize("stored_as", ["attribute", "data set", "column"])
def test_one_object_that_says_all_is_kept_part_by_part(layouts, tmp_path, stored_as):
    if stored_as == "column":
        path = tmp_path / "recordings"
        path.mkdir()
        for i in range(EPISODES):
            state, action = layouts.samples(i)
            table = {"observation.x_m": state[:, 0], "action.x_m": action[:, 0]}
            pq.write_table(pa.table({**table, "ep_meta": [spoken(i)] * 30}), path / f"e{i}.parquet")
    else:
        path = tmp_path / "demo.hdf5"
        with h5py.File(path, "w") as file:
            for i in range(EPISODES):
                state, action = layouts.samples(i)
                demo = file.create_group(f"data/demo_{i}")
                demo.create_dataset("actions", data=action)
                demo.create_dataset("obs/joint_pos", data=state)
                demo.attrs["model_file"] = f"<mujoco model='{i}'>" + "<body/>" * 100
                if stored_as == "attribute":
                    demo.attrs["ep_meta"] = spoken(i)
                else:
                    demo.create_dataset("ep_meta", data=spoken(i))
    _, kept = values_of(path, tmp_path)
    # Of the episode's outcome nothing is a reason, whoever says it.
    assert set(kept) == {"ep_meta.lang", "ep_meta.scene.objects", "ep_meta.seed"}
    said = {runs.values[0] for runs in kept["ep_meta.lang"].values()}
    assert said == {"go left", "go right"}


def test_mcap_metadata(factory, tmp_path):
    folder = tmp_path / "recordings"
    folder.mkdir()
    episodes = [factory.episode(i, tool=f"tool {i % 2}", batch="one") for i in range(EPISODES)]
    factory.write_all(folder, episodes)
    _, kept = values_of(folder, tmp_path)
    assert set(kept) == {"tool"}
    assert kept["tool"]["e001.mcap"].values == ("tool 1",)


def test_a_label_that_switches_is_a_value_by_row_and_one_that_is_damaged_is_not(layouts, tmp_path):
    def recordings(folder, damaged):
        folder.mkdir()
        for i in range(EPISODES):
            state, action = layouts.samples(i)
            task = ["reach"] * 30 if i not in damaged else ["reach"] * 20 + ["leave"] * 10
            table = {"observation.x_m": state[:, 0], "action.x_m": action[:, 0], "task": task}
            pq.write_table(pa.table(table), folder / f"e{i}.parquet")
        return folder

    opened, kept = values_of(recordings(tmp_path / "switches", range(0, 6, 2)), tmp_path)
    assert opened.accepted == EPISODES
    assert opened.contract.labels.task is None
    assert kept["task"]["e0.parquet"] == Runs((0, 20), ("reach", "leave"))
    opened, kept = values_of(recordings(tmp_path / "damaged", [3]), tmp_path)
    assert opened.accepted == EPISODES - 1
    assert opened.contract.labels.task == "task"


def test_whole_numbers_that_hold_are_labels_where_nothing_says_what_is_observed(layouts, tmp_path):
    def recordings(folder, prefix):
        folder.mkdir()
        for i in range(EPISODES):
            state, action = layouts.samples(i)
            table = {
                f"{prefix}x_m": state[:, 0], "action_x_m": action[:, 0],
                f"{prefix}goal": np.full(30, i % 2), f"{prefix}gripper": np.arange(30) // 10 % 2,
            }  # fmt: skip
            pq.write_table(pa.table(table), folder / f"e{i}.parquet")
        return folder

    opened, kept = values_of(recordings(tmp_path / "plain", ""), tmp_path)
    assert set(kept) == {"goal"}
    assert any("Taken as labels, not as observed: goal" in note for note in opened.notes)
    opened, kept = values_of(recordings(tmp_path / "stated", "obs_"), tmp_path)
    assert not kept
    assert any("goal" in channel.name for channel in opened.contract.channels)


def test_what_a_script_is_in_is_a_label_also_where_it_is_called_a_state(layouts, tmp_path):
    """The verdict does not depend on a name; a hand's state and what is observed stay so."""
    (tmp_path / "plain").mkdir()
    for i in range(EPISODES):
        state, action = layouts.samples(i)
        table = {
            "state_x_m": state[:, 0], "action_x_m": action[:, 0],
            "planner_state": np.full(30, i % 2), "gripper_state": np.full(30, i % 2),
            "observation.light_state": np.full(30, i % 2),
        }  # fmt: skip
        pq.write_table(pa.table(table), tmp_path / "plain" / f"e{i}.parquet")
    opened, kept = values_of(tmp_path / "plain", tmp_path)
    assert set(kept) == {"planner_state"}
    assert any("Taken as labels, not as observed: planner_state" in n for n in opened.notes)


def test_only_some_of_the_numbers_of_an_observed_column_are_asked():
    reasons = Reasons(PUSHT)  # it reads five numbers of the state
    for uuid in "ab":
        state = np.full((9, 5 + MOST_ELEMENTS + 2), float(uuid == "a"))
        reasons.add(RawEpisode(uuid, "", {"state": state}), uuid)
    assert set(reasons.recorded()) == {f"state[{k}]" for k in range(5, 5 + MOST_ELEMENTS)}
    assert reasons.notes([]) == [
        "Not looked at as a reason, all but the first 64 numbers that are not observed: state."
    ]


def test_what_is_not_kept_is_noted():
    reasons = Reasons(PUSHT)
    wide = [Column("picture", 3072), Column("state", 5), Column("latent", None)]
    assert [reasons.wants(column) for column in wide] == [False, False, True]
    assert reasons.notes([*wide, Column("next.reward", None)]) == [
        "Not looked at as a reason, more than 1024 numbers wide: picture.",
        "Not looked at as a reason, counts rows or comes of the episode: next.reward.",
    ]
    said = json.dumps({"seen": {f"k{k}": k for k in range(300)}, "success": 1})
    raw = RawEpisode(
        "a", "", {"latent": np.zeros(9)}, {"tool": "x", "reward": "1", "meta": said},
        left={"states": "too large", "rewards": "too large"},
    )  # fmt: skip
    reasons.add(raw, "a")
    reasons.add(replace(raw, attributes={"tool": "y", "goal": '{"success": 1}'}), "b")
    kept = reasons.recorded()
    assert "tool" in kept and not {"latent", "reward", "goal.success"} & set(kept)
    assert reasons.notes([]) == [
        "Not looked at as a reason, counts rows or comes of the episode: goal.success, reward.",
        "Not looked at as a reason, all but the first 256 of its parts: meta.",
        "Not looked at as a reason, too large: states.",
    ]


def test_a_limit_that_was_set_is_asked_and_what_was_measured_is_not():
    """Both may be called `max_force`: a setting comes again, a measurement hardly does."""
    reasons = Reasons(PUSHT)
    for k in range(8):
        rows = {"max_speed": np.full(9, k % 2), "max_force": np.full(9, 7 + k / 10)}
        reasons.add(RawEpisode(str(k), "", rows, {"info/mean_torque[1]": f"{k}.5"}), str(k))
    assert set(reasons.recorded()) == {"max_speed"}
    assert reasons.notes([]) == [
        "Not looked at as a reason, measured in the episode, another number in most: "
        "info/mean_torque[1], max_force."
    ]


def test_a_signal_by_the_name_of_a_measurement_is_noted_once():
    reasons = Reasons(PUSHT)
    for k in range(8):
        force = np.arange(9.0) if k < 4 else np.full(9, k / 10)
        reasons.add(RawEpisode(str(k), "", {"max_force": force}), str(k))
    assert reasons.notes([]) == ["Not looked at as a reason, changes row by row: max_force."]
