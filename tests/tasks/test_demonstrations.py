"""Recording sessions: the same files however they are shared out."""

import pytest

from genpolicy.errors import ConfigError
from genpolicy.tasks.demonstrations import record_session


def recorded(folder, *, workers, root_seed=3):
    folder.mkdir()
    names = record_session(
        "tabletop_insertion", root_seed=root_seed, episodes=3, shares={"nominal": 1.0},
        folder=folder, workers=workers, scheduler="local",
    )  # fmt: skip
    return names, {path.name: path.read_bytes() for path in folder.iterdir()}


def test_names_in_order_and_bytes_independent_of_the_workers(tmp_path):
    one, first = recorded(tmp_path / "one", workers=1)
    two, second = recorded(tmp_path / "two", workers=2)
    assert one == two == [f"episode_{number:05d}.mcap" for number in range(3)]
    assert sorted(first) == one
    assert first == second
    _, other = recorded(tmp_path / "other", workers=1, root_seed=4)
    assert all(other[name] != first[name] for name in one)


def test_an_unknown_task_is_refused(tmp_path):
    with pytest.raises(ConfigError, match="juggling"):
        record_session(
            "juggling", root_seed=1, episodes=2, shares=None, folder=tmp_path, workers=1,
            scheduler="local",
        )  # fmt: skip
