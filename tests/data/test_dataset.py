"""The dataset folder: splits, statistics, windows, and that no change to it goes unseen."""

import contextlib
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from genpolicy.contract.normalisation import MinMax, statistics_of
from genpolicy.data.assemble import seal
from genpolicy.data.contract import SplitRule
from genpolicy.data.dataset import load_dataset
from genpolicy.data.ingest import ingest_recordings
from genpolicy.data.split import assign_splits, split_hash
from genpolicy.errors import BadInputError, ContractError, IntegrityError
from genpolicy.integrity.hashing import sha256_file, sha256_tree
from genpolicy.integrity.tables import read_table, write_table


@pytest.fixture(scope="module")
def built(factory, tmp_path_factory):
    return factory.build(tmp_path_factory.mktemp("good"))


@pytest.fixture
def copied(built, tmp_path):
    shutil.copytree(built, tmp_path / "dataset")
    return tmp_path / "dataset"


def test_same_recordings_same_bytes_in_any_order_and_folder(factory, built, tmp_path):
    paths = factory.write_all(tmp_path, [factory.episode(number) for number in range(7)])
    ingest_recordings(paths[::-1], contract=factory.contract(), out=tmp_path / "again")
    assert sha256_tree(tmp_path / "again") == sha256_tree(built)


def test_columns_and_manifest(factory, built):
    table = read_table(built / "frames.parquet")
    assert table.column_names[:3] == ["episode_uuid", "index", "event_time_s"]
    for name in ("robot", "force", "camera", "phase"):
        assert f"receive_time_s.{name}" in table.column_names
        assert f"event_time_s.{name}" in table.column_names
    assert table["observation"].type == pa.list_(pa.float64(), factory.OBSERVATION.dim)
    assert table["action"].type == pa.list_(pa.float64(), 10)
    assert table["index"].type == pa.int32()
    manifest = json.loads((built / "manifest.json").read_text())
    assert manifest["observation_contract"]["sha256"] == factory.OBSERVATION.hash()
    assert manifest["files"]["frames.parquet"] == sha256_file(built / "frames.parquet")
    assert manifest["counts"] == {"accepted": 7, "found": 7, "refused": 0, "rows": table.num_rows}
    assert manifest["clocks"]["offsets_removed_ns"]["camera"] == {"c0": [11_000_000]}


def test_splits_are_causal_in_time_and_by_episode(built):
    dataset = load_dataset(built)
    parts = [dataset.split(name) for name in ("train", "validation", "test")]
    assert [len(part.episodes) for part in parts] == [4, 1, 2]
    latest = -np.inf
    seen = set()
    for part in parts:
        assert part.frames.event_time_s.min() > latest
        latest = part.frames.event_time_s.max()
        uuids = set(part.episodes["episode_uuid"])
        assert not uuids & seen
        seen |= uuids
        assert set(part.frames.episode.tolist()) == set(range(len(part.episodes)))
    assert sum(len(part.frames) for part in parts) == len(dataset.frames)


def test_statistics_come_from_the_training_split_only(built):
    dataset = load_dataset(built)
    training = dataset.split("train").frames
    np.testing.assert_array_equal(dataset.normalisation.action.minimum, training.action.min(axis=0))
    scaled = dataset.normalisation.observation.normalise(training.observation)
    assert scaled.min() == pytest.approx(-1.0, abs=1e-9)
    assert scaled.max() == pytest.approx(1.0, abs=1e-9)
    gripper = factory_column(dataset, "gripper_opening_m")
    assert (scaled[:, gripper] == 0.0).all()


def factory_column(dataset, name):
    start = 0
    for channel in dataset.manifest["observation_contract"]["channels"]:
        if channel["name"] == name:
            return start
        start += len(channel["components"])
    raise AssertionError(name)


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(-9, 4))
def test_normalisation_inverts(seed, exponent):
    rng = np.random.default_rng(seed)
    values = rng.normal(rng.normal(0, 10, 4), 10.0**exponent, (20, 4))
    values[:, 0] = 3.25
    statistics = statistics_of(values)
    scaled = statistics.normalise(values)
    # Around a large mean the spread itself is only known to the rounding of the values.
    spread = np.ptp(values[:, 1:], axis=0).min()
    rounding = 8 * np.finfo(np.float64).eps * np.abs(values).max() / spread
    assert (np.abs(scaled) <= 1.0 + 1e-9 + rounding).all()
    assert (scaled[:, 0] == 0.0).all()
    np.testing.assert_allclose(statistics.denormalise(scaled), values, rtol=0, atol=1e-6)
    again = MinMax(
        **{k: np.array(v) for k, v in json.loads(json.dumps(statistics.as_json())).items()}
    )
    np.testing.assert_array_equal(again.minimum, statistics.minimum)


def test_windows_golden(built):
    """Checked by hand against the frames of the first episode: padding, alignment, flags."""
    dataset = load_dataset(built)
    windows = dataset.windows("train", 2, 16)
    frames = dataset.frames
    rows = int(dataset.episodes["rows"][0])
    assert windows.observations.shape == (len(windows.episode), 2, frames.observation.shape[1])
    assert windows.actions.shape == (len(windows.episode), 16, 10)
    np.testing.assert_array_equal(windows.observations[0, 0], frames.observation[0])
    np.testing.assert_array_equal(windows.observations[0, 1], frames.observation[0])
    np.testing.assert_array_equal(windows.observations[3], frames.observation[2:4])
    np.testing.assert_array_equal(windows.actions[3, 0], frames.action[3])
    np.testing.assert_array_equal(windows.actions[3, 15], frames.action[rows - 1])
    assert windows.is_pad[3].tolist() == [3 + k >= rows for k in range(16)]
    assert windows.index[:rows].tolist() == list(range(rows))
    observations, actions, is_pad, episode, index = windows
    assert len(observations) == len(actions) == len(is_pad) == len(episode) == len(index)


@settings(max_examples=25, deadline=None)
@given(st.integers(1, 5), st.integers(1, 30), st.sampled_from(["train", "validation", "test"]))
def test_windows_equal_their_definition(built, horizon, prediction, split):
    dataset = load_dataset(built, verify=False)
    windows = dataset.windows(split, horizon, prediction)
    frames = dataset.frames
    for m in range(0, len(windows.episode), 7):
        own = np.flatnonzero(frames.episode == windows.episode[m])
        i = windows.index[m]
        assert dataset.episodes["split"][windows.episode[m]] == split
        for h in range(horizon):
            row = own[max(0, i - horizon + 1 + h)]
            np.testing.assert_array_equal(windows.observations[m, h], frames.observation[row])
        for k in range(prediction):
            row = own[min(len(own) - 1, i + k)]
            np.testing.assert_array_equal(windows.actions[m, k], frames.action[row])
            assert windows.is_pad[m, k] == (i + k >= len(own))


def test_windows_leave_out_failures_unless_told(factory, tmp_path):
    episodes = [factory.episode(n, outcome="failure" if n == 0 else "success") for n in range(7)]
    paths = factory.write_all(tmp_path, episodes)
    ingest_recordings(paths, contract=factory.contract(), out=tmp_path / "out")
    dataset = load_dataset(tmp_path / "out")
    assert 0 not in dataset.windows("train", 1, 1).episode
    assert 0 in dataset.windows("train", 1, 1, only_success=False).episode
    with pytest.raises(ContractError, match="split is 'all'"):
        dataset.windows("all", 1, 1)
    with pytest.raises(ContractError, match="horizons"):
        dataset.windows("train", 0, 1)


def test_split_rule():
    uuids = [str(n) for n in range(20)]
    times = list(range(20, 0, -1))
    splits = assign_splits(times, uuids, SplitRule(0.7, 0.15))
    assert [splits.count(name) for name in ("train", "validation", "test")] == [14, 3, 3]
    assert splits[0] == "test"
    assert splits[-1] == "train"
    assert assign_splits([1, 1, 1], ["c", "a", "b"], SplitRule()) == ["test", "train", "validation"]
    changed = ["train", *splits[1:]]
    assert split_hash({}, uuids, splits) != split_hash({}, uuids, changed)


@pytest.mark.parametrize(
    "name", ["frames.parquet", "episodes.parquet", "refusals.json", "manifest.json"]
)
def test_bit_flips_are_never_accepted_silently(copied, name):
    """200 flips of each file."""
    original = (copied / name).read_bytes()
    rng = np.random.default_rng(3)
    silent = 0
    for position in rng.choice(8 * len(original), 200, replace=False):
        changed = bytearray(original)
        changed[position // 8] ^= 1 << (position % 8)
        (copied / name).write_bytes(bytes(changed))
        with contextlib.suppress(BadInputError):
            load_dataset(copied)
            silent += 1
    assert silent == 0


def test_truncated_missing_and_extra_files(copied):
    original = (copied / "frames.parquet").read_bytes()
    for size in np.linspace(0, len(original) - 1, 20).astype(int):
        (copied / "frames.parquet").write_bytes(original[:size])
        with pytest.raises(IntegrityError, match=r"frames\.parquet"):
            load_dataset(copied)
        with pytest.raises(BadInputError, match=r"frames\.parquet"):
            load_dataset(copied, verify=False)
    (copied / "frames.parquet").write_bytes(original)
    (copied / "notes.txt").write_text("x")
    with pytest.raises(IntegrityError, match=r"notes\.txt is in the folder but not"):
        load_dataset(copied)
    (copied / "notes.txt").unlink()
    (copied / "refusals.json").unlink()
    with pytest.raises(IntegrityError, match=r"refusals\.json"):
        load_dataset(copied)
    with pytest.raises(IntegrityError, match=r"manifest\.json"):
        load_dataset(copied / "nowhere")


def test_link_in_place_of_a_file(copied, tmp_path):
    (copied / "frames.parquet").rename(tmp_path / "elsewhere")
    (copied / "frames.parquet").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(IntegrityError, match=r"frames\.parquet"):
        load_dataset(copied)


def forge(folder, name, change):
    """Change a table and put its new hash in the manifest, as a careful forger would."""
    table = change(read_table(folder / name))
    write_table(folder / name, table)
    manifest = json.loads((folder / "manifest.json").read_text())
    manifest["files"][name] = sha256_file(folder / name)
    (folder / "manifest.json").write_bytes(seal(manifest))


def put(name, edit):
    def change(table):
        values = edit(table[name].to_pylist())
        position = table.column_names.index(name)
        return table.set_column(position, name, pa.array(values, table[name].type))

    return change


@pytest.mark.parametrize(
    ("file", "change", "match"),
    [
        ("frames", put("index", lambda v: [0, 2, *v[2:]]), "index is with a gap"),
        ("frames", put("event_time_s", lambda v: [v[1], v[0], *v[2:]]), "event_time_s is not"),
        ("frames", put("phase", lambda v: ["dance", *v[1:]]), "unknown phase"),
        ("frames", put("action", lambda v: [[np.nan] * 10, *v[1:]]), r"row 0, column action\[0\]"),
        ("frames", lambda t: t.slice(1), "rows"),
        ("frames", lambda t: t.drop_columns(["action"]), "dataset schema"),
        ("frames", lambda t: t.set_column(1, "index", pa.array(["a"] * len(t))), "index"),
        ("episodes", put("episode_uuid", lambda v: [v[1], *v[1:]]), "UUID twice"),
        ("episodes", put("episode_uuid", lambda v: [v[0].upper(), *v[1:]]), "lower-case UUID"),
        ("episodes", put("split", lambda v: ["test", *v[1:]]), r"split\.sha256"),
        ("episodes", put("split", lambda v: ["eval", *v[1:]]), "split"),
        ("episodes", put("rows", lambda v: [v[0] + 1, *v[1:]]), "rows"),
        ("episodes", lambda t: t.drop_columns(["operator"]), "operator"),
    ],
)
def test_tables_that_contradict_the_contract(copied, file, change, match):
    forge(copied, f"{file}.parquet", change)
    with pytest.raises(ContractError, match=match):
        load_dataset(copied)


def test_statistics_that_do_not_follow_from_the_training_split(copied):
    manifest = json.loads((copied / "manifest.json").read_text())
    manifest["normalisation"]["action"]["maximum"][0] += 0.1
    (copied / "manifest.json").write_bytes(seal(manifest))
    with pytest.raises(ContractError, match="normalisation is other numbers"):
        load_dataset(copied)


@pytest.mark.parametrize("text", ["[]", "{}", '{"schema_version": 1}', '{"schema_version": 2}'])
def test_manifest_of_another_shape(copied, text):
    (copied / "manifest.json").write_text(text)
    with pytest.raises(ContractError):
        load_dataset(copied)


WRITER = """
import importlib.util, resource, sys
from pathlib import Path
from genpolicy.data.ingest import ingest_recordings
from genpolicy.errors import BadInputError
spec = importlib.util.spec_from_file_location("factory", sys.argv[1])
factory = importlib.util.module_from_spec(spec)
spec.loader.exec_module(factory)
folder = Path(sys.argv[2])
if sys.argv[3] != "0":
    import signal
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[3]),) * 2)
try:
    ingest_recordings(
        sorted(folder.glob("*.mcap")), contract=factory.contract(), out=folder / "out" / "dataset"
    )
except BadInputError as error:
    print(error)
    sys.exit(error.exit_code)
"""


@pytest.mark.parametrize("limit", [1, 600, 4000, 8000])
def test_full_disk_leaves_no_dataset(factory, tmp_path, limit):
    factory.write_all(tmp_path, [factory.episode(number) for number in range(4)])
    (tmp_path / "out").mkdir()
    source = str(Path(__file__).with_name("factory.py"))
    done = subprocess.run(
        [sys.executable, "-c", WRITER, source, str(tmp_path), str(limit)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2, done.stderr
    assert "not writable" in done.stdout
    assert not list((tmp_path / "out").iterdir())


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_read_only_place(factory, tmp_path):
    paths = factory.write_all(tmp_path, [factory.episode(number) for number in range(3)])
    (tmp_path / "out").mkdir(mode=0o555)
    with pytest.raises(BadInputError, match="not writable"):
        ingest_recordings(paths, contract=factory.contract(), out=tmp_path / "out" / "dataset")


def test_place_below_a_file(factory, tmp_path):
    paths = factory.write_all(tmp_path, [factory.episode(number) for number in range(3)])
    with pytest.raises(BadInputError, match="not writable"):
        ingest_recordings(paths, contract=factory.contract(), out=paths[0] / "dataset")
