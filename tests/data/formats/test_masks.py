"""Masks say who demonstrated, how a file is split, or what a person found worth a name."""

import h5py
import numpy as np
import pytest

from genpolicy.data.dataset import load_dataset
from genpolicy.data.formats import open_dataset
from genpolicy.data.formats.masks import say
from genpolicy.data.variables import stored

DEMOS = [f"demo_{k}" for k in range(6)]
LEFT, RIGHT = {"demo_0", "demo_2", "demo_4"}, {"demo_1", "demo_3", "demo_5"}


def test_a_mask_that_is_no_split_is_a_column():
    notes = []
    masks = {
        "train": LEFT, "valid": RIGHT, "20_percent_train": LEFT, "50_demos": LEFT, "all": LEFT,
        "lamp_on": LEFT, "better": {"demo_1", "demo_9"}, "better_train": LEFT,
    }  # fmt: skip
    operators, said = say(masks, DEMOS, notes)
    assert not operators
    assert said["demo_0"] == {"mask/better": "0", "mask/lamp_on": "1"}
    assert said["demo_1"] == {"mask/better": "1", "mask/lamp_on": "0"}
    assert notes == [
        "Masks name 1 demonstrations that are not there.",
        "Masks not looked at as a reason, splits for training: 20_percent_train, 50_demos, all, "
        "better_train, train, valid.",
    ]


@pytest.mark.parametrize("shared", [True, False])
def test_operators_are_told_only_where_they_share_all_out(shared):
    masks = {"better_operator_1": LEFT, "worse_operator_1": RIGHT if shared else {"demo_1"}}
    operators, said = say(masks, DEMOS, [])
    assert bool(operators) is shared
    assert bool(said) is not shared


def test_no_mask_but_splits_and_operators_says_nothing():
    assert say({"train": LEFT, "ann_operator": set(DEMOS)}, DEMOS, [])[1] == {}


def test_a_mask_travels_with_the_dataset(layouts, tmp_path):
    with h5py.File(tmp_path / "demo.hdf5", "w") as file:
        for name in DEMOS:
            state, action = layouts.samples(int(name[-1]))
            file.create_dataset(f"data/{name}/actions", data=action)
            file.create_dataset(f"data/{name}/obs/joint_pos", data=state)
        file["mask/lamp_on"] = np.array(sorted(name.encode() for name in LEFT))
        file["mask/picture"] = np.zeros((3, 3))
    opened = open_dataset(tmp_path / "demo.hdf5", out=tmp_path / "out")
    episodes = load_dataset(tmp_path / "out").episodes
    kept = dict(zip(episodes["source_file"], stored(episodes)["mask/lamp_on"], strict=True))
    assert kept["demo.hdf5#demo_0"].values == ("1",)
    assert kept["demo.hdf5#demo_1"].values == ("0",)
    assert "Not read of the masks: picture (no list of demonstrations)." in opened.notes
