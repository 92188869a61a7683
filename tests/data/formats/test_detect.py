"""Which layout lies at a path."""

import pytest

from genpolicy.data.formats.detect import (
    AUDIT_FILES,
    FRAMES_FILE,
    MANIFEST_FILE,
    detect,
    files_of,
    only_hdf5,
)
from genpolicy.errors import BadInputError


def test_layouts_are_told_by_what_is_there(layouts, tmp_path):
    assert detect(layouts.v2(tmp_path / "a")) == "lerobot"
    assert detect(layouts.file(tmp_path / "a", 0)) == "parquet"
    for name, data, kind in (
        ("x.bin", b"\x89HDF\r\n\x1a\n", "robomimic"),
        ("y.bin", b"PAR1", "parquet"),
        ("z.bin", b"\x89MCAP0\r\n", "mcap"),
    ):
        (tmp_path / name).write_bytes(data)
        assert detect(tmp_path / name) == kind
    (tmp_path / "none").mkdir()
    (tmp_path / "text.txt").write_text("hello")
    for name in ("none", "text.txt", "absent"):
        with pytest.raises(BadInputError, match=name):
            detect(tmp_path / name)
    (tmp_path / "none" / "a.mcap").touch()
    (tmp_path / "none" / "b.parquet").touch()
    with pytest.raises(BadInputError, match="several layouts"):
        detect(tmp_path / "none")


def test_recordings_are_known_by_the_ends_of_their_names_in_any_case(tmp_path):
    """What has another suffix of the same layout was left out of the folder in silence."""
    folder = tmp_path / "all"
    folder.mkdir()
    for name in ("a.parquet", "b.PARQUET", "c.pq", "d.parq"):
        (folder / name).write_bytes(b"PAR1")
    assert detect(folder) == "parquet"
    assert [path.name for path in files_of(folder, "parquet")] == [
        "a.parquet", "b.PARQUET", "c.pq", "d.parq",
    ]  # fmt: skip


@pytest.mark.parametrize("missing", [None, *AUDIT_FILES])
def test_an_audit_written_beside_recordings_is_no_data_set(tmp_path, missing):
    """Whoever audits one file and writes beside it can audit the folder afterwards."""
    (tmp_path / "demo.hdf5").write_bytes(b"\x89HDF\r\n\x1a\n")
    for name in (*AUDIT_FILES, f"dataset/{FRAMES_FILE}"):
        if name != missing:
            (tmp_path / "audit" / name).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / "audit" / name).touch()
    if missing is None:
        assert detect(tmp_path) == "robomimic"
        assert only_hdf5(tmp_path) == tmp_path / "demo.hdf5"
    elif missing == f"dataset/{MANIFEST_FILE}":
        with pytest.raises(BadInputError, match="several layouts"):
            detect(tmp_path)
    else:
        with pytest.raises(BadInputError, match=r"above 1 data set \(audit/dataset"):
            detect(tmp_path)


@pytest.mark.parametrize("layout", ["parquet", "mcap"])
def test_files_of_an_audit_are_not_read_as_recordings(tmp_path, layout):
    for name in (*AUDIT_FILES, "dataset/frames.parquet", "dataset/episodes/0.mcap"):
        (tmp_path / "audit" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "audit" / name).touch()
    own = [tmp_path / f"{name}.{layout}" for name in ("a", "b/c")]
    for path in own:
        path.parent.mkdir(exist_ok=True)
        path.touch()
    assert files_of(tmp_path, layout) == own
    assert files_of(own[0], layout) == own[:1]
