"""A dataset that is not what its recordings give proves nothing, however its hash is recorded."""

import json
import shutil
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import yaml

from gates import rederive
from gates.rederive_ingest import INGEST, RECORDED, SOURCE, TABLES, rederive_ingest
from gates.settings import read_params
from genpolicy.data.of_task import IngestSection, ingest_of_task
from genpolicy.errors import RefusedError
from genpolicy.integrity.hashing import sha256_file

ROOT = Path(__file__).parents[2]
ROW = 7


@pytest.fixture(scope="module")
def whole(dataset, tmp_path_factory):
    """A workspace with five recordings of the task and what stage `ingest` writes of them."""
    root = tmp_path_factory.mktemp("derived")
    shutil.copy(ROOT / "params.yaml", root)
    (root / RECORDED).mkdir(parents=True)
    for path in sorted((dataset.parent / "episodes").glob("*.mcap"))[:5]:
        shutil.copy(path, root / RECORDED)
    params = read_params(root)
    ingest_of_task(
        sorted((root / RECORDED).glob("*.mcap")),
        root / INGEST,
        task=params["task"]["name"],
        action_period_s=params["horizons"]["action_period_s"],
        section=IngestSection(**params["ingest"]),
    )
    (root / SOURCE).parent.mkdir()
    (root / SOURCE).write_text(json.dumps({"kind": "embedded"}))
    return root


@pytest.fixture
def root(whole, tmp_path):
    return shutil.copytree(whole, tmp_path / "run")


def forge(root, table, column, change):
    """Write a table whose column is another, in the same types."""
    path = root / INGEST / f"{table}.parquet"
    read = pq.read_table(path)
    place = read.schema.get_field_index(column)
    values = change(read[column].to_pylist())
    forged = pa.chunked_array([pa.array(values, type=read.schema.field(column).type)])
    pq.write_table(read.set_column(place, read.schema.field(place), forged), path)


def at_row(change):
    return lambda values: [*values[:ROW], change(values[ROW]), *values[ROW + 1 :]]


def of_one(root, source):
    params = yaml.safe_load((root / "params.yaml").read_text())
    params["source"] = source
    (root / "params.yaml").write_text(yaml.safe_dump(params))
    files = {p.name: sha256_file(p) for p in sorted((root / source["path"]).iterdir())}
    (root / SOURCE).write_text(json.dumps({"kind": source["kind"], "files": files}))


def held(root):
    rederive_ingest(root, read_params(root))


def test_what_the_recordings_give_holds_and_last_digits_are_of_a_processor(root):
    held(root)
    forge(root, "frames", "observation", lambda v: (np.array(v) * (1 + 1e-12)).tolist())
    forge(root, "frames", "event_time_s", lambda v: np.nextafter(v, np.inf).tolist())
    held(root)


@pytest.mark.parametrize(
    ("table", "column", "change"),
    [
        ("frames", "observation", at_row(lambda v: [v[0] + 1e-6, *v[1:]])),
        ("frames", "action", at_row(lambda v: [*v[:-1], v[-1] - 1e-6])),
        ("frames", "event_time_s", at_row(lambda v: v + 0.0001)),
        ("frames", "event_time_s.camera", at_row(lambda v: None)),
        ("frames", "phase", at_row(lambda v: "retreat")),
        ("frames", "index", at_row(lambda v: v + 1)),
        ("episodes", "outcome", lambda v: ["failure", *v[1:]]),
        ("episodes", "operator", lambda v: [*v[:-1], "another"]),
        ("episodes", "split", lambda v: list(reversed(v))),
        ("episodes", "recorded_at_s", lambda v: [v[0] - 0.0001, *v[1:]]),
        ("episodes", "lead_action", lambda v: [[[0.0] * 10], *v[1:]]),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_one_number_that_nobody_recorded_is_named(root, table, column, change):
    forge(root, table, column, change)
    row = ROW if table == "frames" else r"\d"
    with pytest.raises(RefusedError, match=rf"{table}\.parquet: {column} of row {row} \(episode "):
        held(root)


@pytest.mark.parametrize("table", TABLES)
def test_a_row_less_is_refused(root, table):
    path = root / INGEST / f"{table}.parquet"
    pq.write_table(pq.read_table(path)[:-1], path)
    with pytest.raises(RefusedError, match=rf"{table}\.parquet is \d+ rows, required \d+, as rec"):
        held(root)


def test_a_column_more_is_refused(root):
    path = root / INGEST / "episodes.parquet"
    table = pq.read_table(path)
    pq.write_table(table.append_column("hidden", table["operator"]), path)
    with pytest.raises(RefusedError, match=r"episodes\.parquet: columns is .*hidden"):
        held(root)


@pytest.mark.parametrize(
    ("name", "change", "place"),
    [
        ("refusals.json", {"found": 6}, "refusals.json: found"),
        ("manifest.json", {"tasks": ["another"]}, "manifest.json: tasks"),
        ("manifest.json", {"normalisation": {}}, "manifest.json: normalisation"),
    ],
)
def test_what_a_document_says_is_what_was_recorded(root, name, change, place):
    path = root / INGEST / name
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(RefusedError, match=place):
        held(root)


def test_without_recordings_there_is_no_dataset(root):
    shutil.rmtree(root / RECORDED)
    with pytest.raises(RefusedError, match=f"{INGEST} is a dataset, required what its recordings"):
        held(root)


def test_recordings_of_ones_own_are_those_that_were_seen(root):
    shutil.move(root / RECORDED, root / "own")
    of_one(root, {"kind": "recordings", "path": "own"})
    held(root)
    forge(root, "frames", "action", at_row(lambda v: [v[0] + 0.01, *v[1:]]))
    with pytest.raises(RefusedError, match=r"frames\.parquet: action of row 7"):
        held(root)
    other = sorted((root / "own").iterdir())[1]
    other.write_bytes(other.read_bytes() + b"\0")
    with pytest.raises(RefusedError, match=rf"own/{other.name} is another file"):
        held(root)
    other.unlink()
    with pytest.raises(RefusedError, match=rf"own/{other.name} is another file"):
        held(root)


def test_a_recording_that_came_later_is_refused(root):
    shutil.move(root / RECORDED, root / "own")
    of_one(root, {"kind": "recordings", "path": "own"})
    shutil.copy(next((root / "own").iterdir()), root / "own" / "later.mcap")
    with pytest.raises(RefusedError, match=r"own/later\.mcap is another file"):
        held(root)


def test_recordings_that_do_not_lie_here_are_asked_nothing(root):
    shutil.move(root / RECORDED, root / "own")
    of_one(root, {"kind": "recordings", "path": "own"})
    shutil.rmtree(root / "own")
    held(root)


def test_a_dataset_that_was_brought_is_its_files(root):
    shutil.copytree(root / INGEST, root / "brought")
    of_one(root, {"kind": "dataset", "path": "brought"})
    shutil.rmtree(root / "brought")
    held(root)
    forge(root, "frames", "action", at_row(lambda v: [v[0] + 0.01, *v[1:]]))
    with pytest.raises(RefusedError, match=r"artifacts/ingest/frames\.parquet is another file"):
        held(root)
    (root / INGEST / "frames.parquet").unlink()
    with pytest.raises(RefusedError, match=r"artifacts/ingest/frames\.parquet is another file"):
        held(root)


def test_gate_a_asks_it_before_anything_that_stands_on_the_dataset(root, monkeypatch):
    for later in ("rederive_trainings", "rederive_audit", "rederive_policies"):
        monkeypatch.setattr(rederive, later, lambda *_: pytest.fail("asked first"))
    forge(root, "episodes", "outcome", lambda v: ["failure", *v[1:]])
    with pytest.raises(RefusedError, match=r"Gate A refuses: .*episodes\.parquet: outcome"):
        rederive.rederive(root, "A")
