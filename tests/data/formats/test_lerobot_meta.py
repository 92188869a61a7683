"""The description of a LeRobot dataset: names, templates, and what is refused."""

import pytest

from genpolicy.data.formats import open_dataset
from genpolicy.data.formats.lerobot_meta import flat_names, path_pattern
from genpolicy.errors import BadInputError


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"fps": 0}, "fps"),
        ({"fps": True}, "fps"),
        ({"fps": "30"}, "fps"),
        ({"codebase_version": "v1.6"}, "codebase_version"),
        ({"codebase_version": None}, "codebase_version"),
        ({"data_path": "{0.__class__}"}, "data_path"),
        ({"data_path": "data/{episode_index.__class__}.parquet"}, "data_path"),
        ({"data_path": "../{episode_index:06d}.parquet"}, "data_path"),
        ({"data_path": "/etc/{episode_index:06d}.parquet"}, "data_path"),
        ({"data_path": "C:\\{episode_index:06d}.parquet"}, "data_path"),
        ({"data_path": "data/\u0000{episode_index:06d}.parquet"}, "data_path"),
        ({"data_path": "data/{video_key}/{episode_index:06d}.parquet"}, "data_path"),
        ({"data_path": 5}, "data_path"),
        ({"data_path": "elsewhere/{episode_index:06d}.parquet"}, "without a data file"),
        ({"features": []}, "features"),
        ({"features": {"action": {"dtype": "float32", "shape": [-1]}}}, "shape"),
        ({"features": {"action": 3}}, "features.action"),
    ],
)
def test_a_description_that_is_refused(layouts, tmp_path, changes, text):
    root = layouts.v2(tmp_path / "recordings", **changes)
    with pytest.raises(BadInputError, match=text):
        open_dataset(root, out=tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_names_however_nested():
    assert flat_names([["a", "b"]]) == ("a", "b")
    assert flat_names({"motors": ["a", "b"]}) == ("a", "b")
    assert flat_names({"b": 1, "a": 0}) == ("a", "b")
    assert flat_names(["a", ["b", ["c"]]]) == ("a", "b", "c")
    assert flat_names(None) == flat_names(3) == ()


def test_pattern_accepts_the_published_templates():
    v3 = path_pattern("data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet", where="t")
    assert v3.fullmatch("data/chunk-000/file-012.parquet")
    assert not v3.fullmatch("data/chunk-000/file-012xparquet")
