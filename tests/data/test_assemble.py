"""A dataset is written whole or not at all, the same bytes for the same recordings."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pyarrow as pa
import pytest

from genpolicy.data.ingest import ingest_recordings
from genpolicy.errors import BadInputError
from genpolicy.integrity.hashing import sha256_file, sha256_tree
from genpolicy.integrity.tables import read_table


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
