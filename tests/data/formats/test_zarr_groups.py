"""Zarr as people write it: other names, other versions, ends or lengths, a group per episode."""

import numpy as np
import pytest
import zarr

from genpolicy.data.dataset import load_dataset
from genpolicy.data.formats import open_dataset, propose
from genpolicy.errors import ContractError
from genpolicy.seeds import stream

EPISODES, ROWS = 12, 30


def made():
    """Places, commands and a hand of each episode."""
    episodes = []
    for number in range(EPISODES):
        rng = stream(5, "zarr", number)
        path = np.cumsum(rng.normal(0.01, 0.002, (ROWS + 1, 2)), axis=0)
        hand = (np.arange(ROWS + 1) > ROWS // 2)[:, None] * 1.0
        episodes.append((path[:-1] + rng.normal(0, 1e-4, (ROWS, 2)), path[1:], hand[1:]))
    return episodes


def joined():
    seen, told, hand = (np.concatenate(part) for part in zip(*made(), strict=True))
    return seen, told, hand, np.arange(1, EPISODES + 1) * ROWS


def group_each(place):
    return {
        f"{place}episode_{number}/{name}": values
        for number, (seen, told, _) in enumerate(made())
        for name, values in (("obs/state", seen), ("action", told))
    }


def layouts():
    seen, told, hand, ends = joined()
    return {
        "other names": {"data/robot0_eef_pos": seen, "data/action": told,
                        "meta/episode_ends": ends},
        "parts of an action": {"data/obs/eef_pos": seen, "data/arm_action": told,
                               "data/hand_action": hand, "meta/episode_ends": ends},
        "without folders": {"state": seen, "actions": told, "episode_ends": ends},
        "lengths": {"data/state": seen, "data/action": told,
                    "meta/episode_lengths": np.full(EPISODES, ROWS)},
        "a group per episode": group_each(""),
        "a group per episode below data": group_each("data/"),
    }  # fmt: skip


def written(path, arrays, version):
    group = zarr.open_group(str(path), mode="w", zarr_format=version)
    for name, values in arrays.items():
        group.create_array(name, data=values, chunks=values.shape)
    return path


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("name", layouts())
def test_every_layout_gives_the_same_numbers(name, version, tmp_path):
    path = written(tmp_path / "buffer.zarr", layouts()[name], version)
    opened = open_dataset(path, out=tmp_path / "out")
    assert opened.accepted == EPISODES and not opened.refused
    frames = load_dataset(opened.folder).frames
    order = np.argsort(frames.observation[frames.index == 0, 0])
    first = np.array([seen[0] for seen, _, _ in made()])
    np.testing.assert_allclose(
        frames.observation[frames.index == 0][order], first[np.argsort(first[:, 0])]
    )
    width = 3 if name == "parts of an action" else 2
    assert frames.action.shape == (EPISODES * ROWS, width)


def test_a_group_that_lacks_an_array_is_refused_by_name(tmp_path):
    arrays = group_each("")
    del arrays["episode_3/action"]
    opened = open_dataset(written(tmp_path / "b.zarr", arrays, 2), out=tmp_path / "out")
    (refused,) = opened.refused
    assert "b.zarr#episode_3: action is missing" in refused.reason
    assert opened.accepted == EPISODES - 1


def test_episodes_are_counted_as_numbers(tmp_path):
    opened = open_dataset(written(tmp_path / "b.zarr", group_each(""), 3), out=tmp_path / "out")
    names = set(load_dataset(opened.folder).episodes["source_file"])
    assert names == {f"b.zarr#episode_{number}" for number in range(EPISODES)}


def test_what_a_group_says_of_its_episode_is_read(tmp_path):
    path = written(tmp_path / "b.zarr", group_each("data/"), 2)
    for number in range(EPISODES):
        group = zarr.open_group(str(path), mode="r+", zarr_format=2)[f"data/episode_{number}"]
        group.attrs["success"] = bool(number % 2)
    assert propose(path).labels.outcome == "success"
    opened = open_dataset(path, out=tmp_path / "out")
    outcomes = load_dataset(opened.folder).episodes["outcome"].value_counts().to_dict()
    assert outcomes == {"success": EPISODES // 2, "failure": EPISODES // 2}


def test_a_clock_is_known_by_its_name(tmp_path):
    arrays = layouts()["other names"] | {"data/timestamp": np.tile(np.arange(ROWS) / 20, EPISODES)}
    contract = propose(written(tmp_path / "b.zarr", arrays, 2))
    assert contract.labels.time == "timestamp" and contract.rate_hz == 20.0


def test_a_group_without_ends_and_a_codec_of_others_are_refused(tmp_path):
    arrays = layouts()["other names"]
    path = written(tmp_path / "b.zarr", arrays, 2)
    with pytest.raises(ContractError, match="Give the folder that holds data and meta"):
        open_dataset(path / "data", out=tmp_path / "out")
    third = written(tmp_path / "c.zarr", arrays, 3)
    described = third / "data" / "action" / "zarr.json"
    described.write_text(described.read_text().replace('"bytes"', '"pickle"'))
    with pytest.raises(ContractError, match="plain numbers"):
        open_dataset(third, out=tmp_path / "out")
