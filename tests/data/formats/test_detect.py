"""Which layout lies at a path."""

import pytest

from genpolicy.data.formats.detect import detect
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
