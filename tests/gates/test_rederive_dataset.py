"""A fault that writer and reader of a dataset share is seen by a third who counts for himself."""

import json
import shutil

import evidence
import numpy as np
import pandas as pd
import pytest

from gates import rederive
from gates.proof import Rung
from gates.rederive import rederived
from gates.rederive_dataset import rederive_dataset, rederive_trainings
from genpolicy.errors import RefusedError

FRAMES = "artifacts/ingest/frames.parquet"


@pytest.fixture
def dataset(repo):
    """Four episodes in time, with the statistics of the first two."""
    return repo


def _state(root, frames, rows):
    def of(column):
        values = np.stack(frames[column][rows].tolist())
        return {"minimum": values.min(axis=0).tolist(), "maximum": values.max(axis=0).tolist()}

    found = {name: of(name) for name in ("observation", "action")}
    evidence.edit_document(root, "ingest/manifest.json", lambda d: d | {"normalisation": found})


def test_statistics_of_the_training_split_in_time_are_those_that_are_stated(dataset):
    rederive_dataset(dataset)


def test_statistics_of_all_splits_are_refused_by_name(dataset):
    frames = pd.read_parquet(dataset / FRAMES)
    _state(dataset, frames, np.ones(len(frames), dtype=bool))
    with pytest.raises(RefusedError, match=r"normalisation\.\w+: m\w+imum.*training split"):
        rederive_dataset(dataset)


@pytest.mark.parametrize("change", [{}, {"normalisation": 3}, {"normalisation": {}}])
def test_no_statistics_are_refused(dataset, change):
    evidence.edit_document(
        dataset, "ingest/manifest.json", lambda d: {"schema_version": 1} | change
    )
    with pytest.raises(RefusedError, match="normalisation"):
        rederive_dataset(dataset)


@pytest.mark.parametrize(
    "splits",
    [("train", "validation", "train", "test"), ("validation", "train", "train", "test"),
     ("train", "train", "test", "validation"), ("test", "train", "train", "validation"),
     ("train", "train", "validation", "validation"), ("train", "train", "test", "test")],
)  # fmt: skip
def test_splits_that_are_not_in_time_are_refused(dataset, splits):
    evidence.edit_table(dataset, "ingest/episodes.parquet", lambda f: f.assign(split=splits))
    with pytest.raises(RefusedError, match="split"):
        rederive_dataset(dataset)


def test_a_time_that_is_not_known_orders_nothing(dataset):
    evidence.edit_table(
        dataset, "ingest/episodes.parquet", lambda f: f.assign(recorded_at_s=np.nan)
    )
    with pytest.raises(RefusedError, match="split"):
        rederive_dataset(dataset)


def test_recordings_of_one_time_may_lie_on_either_side(dataset):
    evidence.edit_table(dataset, "ingest/episodes.parquet", lambda f: f.assign(recorded_at_s=1.7e9))
    rederive_dataset(dataset)


@pytest.mark.parametrize("least", [0, 1])
def test_rows_of_unequal_length_are_refused(dataset, least):
    """One that is shorter by one, and rows that hold nothing at all."""

    def cut(frame):
        return frame.assign(observation=[[1.0, 2.0][: least * (1 + (i > 0))]
                                         for i in range(len(frame))])  # fmt: skip

    evidence.edit_table(dataset, "ingest/frames.parquet", cut)
    with pytest.raises(RefusedError, match=r"frames\.parquet is rows of unequal length, required"):
        rederive_dataset(dataset)


def test_gate_a_is_refused_where_its_dataset_is(dataset, monkeypatch):
    for name in (
        "rederive_ingest",
        "rederive_audit",
        "rederive_policies",
    ):  # nothing was recorded or trained here
        monkeypatch.setattr(rederive, name, lambda *_: None)
    rung = Rung("A", "need", "PASS", "", "", "reports/gate_a.json", 0)
    assert rederived(dataset, [rung])[0].verdict == "PASS"
    evidence.edit_document(dataset, "ingest/manifest.json", lambda d: {"schema_version": 1})
    assert rederived(dataset, [rung])[0].verdict == "REFUSED"


def _training(root, folder, **changes):
    """What a training says that it was given, true but for the changes."""
    table = pd.read_parquet(root / "artifacts/ingest/episodes.parquet")
    own = {split: table["episode_uuid"][table["split"] == split].tolist()
           for split in ("train", "validation", "test")}  # fmt: skip
    given = {"episodes": own["train"], "validation_episodes": own["validation"]}
    path = root / "artifacts" / folder / "a" / "seed_0" / "training.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    wrong = {key: own[value] if str(value) in own else value for key, value in changes.items()}
    path.write_text(json.dumps(given | wrong))
    return own


@pytest.mark.parametrize(
    ("gate", "folder"),
    [("A", "train_baselines"), ("A", "train_factors"), ("B", "train_generators")],
)
def test_a_training_that_saw_another_split_is_refused(dataset, gate, folder, monkeypatch):
    monkeypatch.setattr(rederive, "rederive_ingest", lambda *_: None)  # nothing was recorded here
    _training(dataset, folder)
    rederive_trainings(dataset, gate, evidence.PARAMS)
    own = _training(dataset, folder, episodes="validation")
    first = own["validation"][0]
    said = (
        rf"training\.json: episodes is \d+ episodes outside the training split, among them {first}"
    )
    with pytest.raises(RefusedError, match=said):
        rederive_trainings(dataset, gate, evidence.PARAMS)
    _training(dataset, folder, validation_episodes="test")
    with pytest.raises(
        RefusedError, match=r"validation_episodes is .* outside the validation split"
    ):
        rederive_trainings(dataset, gate, evidence.PARAMS)
    for nothing in ([], None, "some"):
        _training(dataset, folder, episodes=nothing)
        with pytest.raises(RefusedError, match="episodes is nothing"):
            rederive_trainings(dataset, gate, evidence.PARAMS)
    note = rederived(dataset, [Rung(gate, "n", "PASS", "", "", "r", 0)])[0].note
    assert "training.json" in note


def test_the_trainings_of_one_gate_are_not_those_of_another(dataset):
    _training(dataset, "train_generators", episodes="validation")
    rederive_trainings(dataset, "A", evidence.PARAMS)


@pytest.mark.parametrize(
    ("gate", "folder", "name"),
    [("A", "train_baselines", "chunked_bc"), ("A", "train_factors", "reference"),
     ("B", "train_generators", "flow")],
)  # fmt: skip
def test_a_training_that_is_named_and_not_there_is_refused(dataset, gate, folder, name):
    rederive_trainings(dataset, gate, evidence.PARAMS)
    shutil.rmtree(dataset / "artifacts" / folder / name)
    with pytest.raises(RefusedError, match=f"artifacts/{folder}/{name} is not trained"):
        rederive_trainings(dataset, gate, evidence.PARAMS)
