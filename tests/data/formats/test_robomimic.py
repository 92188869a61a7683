"""robomimic HDF5: read from inside the file only, refused by demonstration."""

import json
import shutil

import h5py
import numpy as np
import pytest

from genpolicy.data.dataset import load_dataset
from genpolicy.data.formats import open_dataset, propose
from genpolicy.errors import BadInputError

ENV = {"env_name": "Lift", "env_kwargs": {"control_freq": 20, "controller_configs": {}}}


@pytest.fixture
def file(layouts, tmp_path):
    path = tmp_path / "demo.hdf5"
    with h5py.File(path, "w") as out:
        data = out.create_group("data")
        data.attrs["env_args"] = json.dumps(ENV)
        for i in range(12):
            state, action = layouts.samples(i)
            demo = data.create_group(f"demo_{i}")
            demo.attrs["num_samples"] = len(action)
            demo.create_dataset("actions", data=action, compression="gzip")
            demo.create_dataset("obs/robot0_joint_pos", data=state)
            demo.create_dataset("obs/agentview_image", data=np.zeros((30, 4, 4, 3), "u1"))
            demo.create_dataset("states", data=np.zeros((30, 2)))
            demo.create_dataset("rewards", data=np.zeros(30))
        for name, members in (("ann_operator", range(0, 12, 2)), ("bob_operator", range(1, 12, 2))):
            out[f"mask/{name}"] = np.array([f"demo_{i}".encode() for i in members])
    return path


def test_every_demonstration_under_its_number(file, layouts, tmp_path):
    opened = open_dataset(file, out=tmp_path / "out")
    assert (opened.found, opened.accepted) == (12, 12)
    assert opened.contract.rate_hz == 20.0
    dataset = load_dataset(tmp_path / "out")
    files = dataset.episodes["source_file"].tolist()
    state, action = layouts.samples(10)
    rows = dataset.frames.episode == files.index("demo.hdf5#demo_10")
    np.testing.assert_array_equal(dataset.frames.observation[rows], state)
    np.testing.assert_array_equal(dataset.frames.action[rows], action)
    operators = dict(zip(files, dataset.episodes["operator"], strict=True))
    assert operators["demo.hdf5#demo_0"] == "ann_operator"
    assert operators["demo.hdf5#demo_1"] == "bob_operator"
    notes = " ".join(opened.notes)
    assert "obs/agentview_image" in notes
    assert "operator was taken from the file's masks" in notes
    assert opened.contract.pairing_guessed  # robomimic names no number; they follow each other
    assert len(opened.contract.pairing or {}) == 3


def test_what_is_empty_or_damaged_beside_the_contract_refuses_nothing(file, tmp_path):
    with h5py.File(file, "a") as out:
        demo = out["data/demo_3"]
        out["data/demo_0"].attrs["x"] = demo.attrs["x"] = h5py.Empty("S1")
        demo["note"] = h5py.Empty("f4")
        demo.create_dataset("extra/emb", data=np.ones((30, 8)), compression="gzip")
        demo["extra/emb"].id.write_direct_chunk((0, 0), b"damaged")
    opened = open_dataset(file, out=tmp_path / "out")
    assert (opened.found, opened.accepted) == (12, 12)
    notes = " ".join(opened.notes)
    assert "not readable: extra/emb." in notes
    assert "no plain value of a row or of the demonstration: note, x." in notes


def test_the_only_file_of_a_folder_is_that_file(file, tmp_path):
    folder = tmp_path / "mine"
    (folder / "deeper").mkdir(parents=True)
    (folder / "notes.txt").write_text("of Tuesday")
    shutil.copy(file, folder / "deeper" / file.name)
    alone, inside = (
        open_dataset(path, out=tmp_path / f"out_{path.stem}") for path in (file, folder)
    )
    for name in ("frames.parquet", "episodes.parquet"):
        assert (inside.folder / name).read_bytes() == (alone.folder / name).read_bytes()
    with pytest.raises(BadInputError, match="several layouts"):
        (folder / "x.parquet").write_bytes(b"PAR1")
        open_dataset(folder, out=tmp_path / "both")


def external_link(demo, outside):
    del demo["actions"]
    demo["actions"] = h5py.ExternalLink(outside, "secret")


def soft_link(demo, _):
    del demo["actions"]
    demo["actions"] = h5py.SoftLink("/data/demo_0/actions")


def external_storage(demo, _):
    del demo["actions"]
    demo.create_dataset("actions", (30, 3), "u1", external=[("/etc/passwd", 0, 90)])


def virtual(demo, outside):
    del demo["actions"]
    layout = h5py.VirtualLayout(shape=(30, 3), dtype="f8")
    layout[:] = h5py.VirtualSource(outside, "secret", shape=(30, 3))
    demo.create_virtual_dataset("actions", layout)


def objects(demo, _):
    del demo["actions"]
    demo["actions"] = np.array(["a"] * 30, dtype=h5py.string_dtype())


def other_length(demo, _):
    del demo["actions"]
    demo["actions"] = np.zeros((29, 3))


def other_width(demo, _):
    del demo["actions"]
    demo["actions"] = np.zeros((30, 4))


def missing(demo, _):
    del demo["obs/robot0_joint_pos"]


def not_finite(demo, _):
    demo["obs/robot0_joint_pos"][13, 2] = np.nan


def bomb(demo, _):
    del demo["actions"]
    demo.create_dataset("actions", (10**9, 3), "f8", chunks=(1000, 3), compression="gzip")


def foreign_filter(demo, _):
    del demo["actions"]
    properties = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    properties.set_chunk((30, 3))
    properties.set_filter(307, h5py.h5z.FLAG_OPTIONAL, (9,))
    space = h5py.h5s.create_simple((30, 3))
    h5py.h5d.create(demo.id, b"actions", h5py.h5t.NATIVE_DOUBLE, space, properties)


@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        (external_link, "a ExternalLink"),
        (soft_link, "a SoftLink"),
        (external_storage, "stored in another file"),
        (virtual, "a virtual data set"),
        (objects, "type object"),
        (other_length, "rows long"),
        (other_width, "of shape (30, 4)"),
        (missing, "missing"),
        (not_finite, "row 13, column obs/robot0_joint_pos[2] is nan"),
        (bomb, "of shape (1000000000, 3)"),
        (foreign_filter, "filters [307]"),
    ],
)
def test_a_bad_demonstration_is_refused_by_name(file, tmp_path, fault, reason):
    outside = tmp_path / "outside.hdf5"
    with h5py.File(outside, "w") as other:
        other["secret"] = np.full((30, 3), 7.0)
    with h5py.File(file, "a") as edited:
        fault(edited["data/demo_5"], str(outside))
    opened = open_dataset(file, out=tmp_path / "out")
    assert (opened.found, opened.accepted) == (12, 11)
    assert opened.refused[0].file == "demo.hdf5#demo_5"
    assert reason in opened.refused[0].reason


@pytest.mark.parametrize("name", ["data", "mask"])
def test_a_whole_group_elsewhere_is_refused(file, tmp_path, name):
    outside = tmp_path / "outside.hdf5"
    file.rename(outside)
    with h5py.File(outside) as source, h5py.File(file, "w") as out:
        for other in {"data", "mask"} - {name}:
            source.copy(other, out)
        out[name] = h5py.ExternalLink(str(outside), name)
    with pytest.raises(BadInputError, match="ExternalLink"):
        open_dataset(file, out=tmp_path / "out")


@pytest.mark.parametrize("share", [0.0, 0.01, 0.3, 0.9])
def test_truncated(file, tmp_path, share):
    whole = file.read_bytes()
    file.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(BadInputError, match=r"demo\.hdf5"):
        open_dataset(file, out=tmp_path / "out")


def test_without_a_rate_it_is_guessed_and_said(file, tmp_path):
    with h5py.File(file, "a") as edited:
        edited["data"].attrs["env_args"] = "{"
    opened = open_dataset(file, out=tmp_path / "out")
    assert opened.contract.rate_guessed
    assert any("rate was guessed" in note for note in opened.notes)
    assert any("env_args could not be read" in note for note in opened.notes)


def test_normalised_differences_are_changes(file, layouts, tmp_path):
    """The action of an operational-space controller is a step of its own size."""
    with h5py.File(file, "a") as edited:
        for i in range(12):
            state = layouts.samples(i)[0]
            steps = np.diff(state, axis=0, append=state[-1:])
            edited[f"data/demo_{i}/actions"][...] = steps / 0.125
    contract = propose(file)
    assert list(contract.pairing or {}) == ["actions_0", "actions_1", "actions_2"]
    for form in contract.forms.values():
        assert (form.form, form.gain) == ("change", pytest.approx(0.125, rel=0.05))
    assert contract.frozen is None  # a change that stays the same is a motion
