"""The dataset folder: splits, statistics, windows, and that no change to it goes unseen."""

import contextlib
import json
import shutil

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from genpolicy.contract.normalisation import MinMax, statistics_of
from genpolicy.data.assemble import seal
from genpolicy.data.dataset import load_dataset
from genpolicy.data.ingest import ingest_recordings
from genpolicy.errors import BadInputError, ContractError, IntegrityError
from genpolicy.integrity.hashing import sha256_file
from genpolicy.integrity.tables import read_table, write_table


@pytest.fixture
def copied(built, tmp_path):
    shutil.copytree(built, tmp_path / "dataset")
    return tmp_path / "dataset"


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
