"""The same episodes in another order, under other names, merged the other way: the same verdict."""

import shutil

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from planar import LIMITS

from gates.cause import cause_of
from genpolicy.audit import audit, propose_settings
from genpolicy.audit.evidence import write_evidence
from genpolicy.audit.rows import Stratum
from genpolicy.data.dataset import load_dataset
from genpolicy.data.formats.opening import open_dataset
from genpolicy.integrity.rows import read_rows
from genpolicy.seeds import stream

EPISODES, ROWS = 120, 40


@pytest.fixture(scope="module")
def episodes():
    """Two ways round, one in nine by chance, the rest as a column of words says."""
    made = []
    for number in range(EPISODES):
        rng = stream(7, "order", number)
        side = int(rng.integers(2))
        word = side if rng.random() < 8 / 9 else 1 - side
        time = np.linspace(0.0, 1.0, ROWS + 1)
        x = 0.5 * time + rng.normal(0, 0.003)
        y = 0.12 * (2 * side - 1) * np.sin(np.pi * time) + rng.normal(0, 0.004)
        seen = np.stack([x, y], axis=1)[:-1] + rng.normal(0, 0.0005, (ROWS, 2))
        made.append(
            {
                "frame_index": np.arange(ROWS), "timestamp": np.arange(ROWS) / 20,
                "observation.x_m": seen[:, 0], "observation.y_m": seen[:, 1],
                "action.x_m": x[1:], "action.y_m": y[1:],
                "scenario": [f"kitchen {word}"] * ROWS,
                "heat": np.full(ROWS, rng.normal()), "success": np.ones(ROWS, dtype=bool),
            }
        )  # fmt: skip
    return made


def audited(folder, files, episodes):
    """Evidence and verdict of recordings: for each file the episodes that it holds, in order."""
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "recordings").mkdir(parents=True)
    for name, numbers in files.items():
        parts = [
            pa.table({"episode_index": np.full(ROWS, place), **episodes[number]})
            for place, number in enumerate(numbers)
        ]
        pq.write_table(pa.concat_tables(parts), folder / "recordings" / name)
    open_dataset(folder / "recordings", out=folder / "dataset")
    dataset = load_dataset(folder / "dataset")
    settings = propose_settings(dataset)
    report = audit(dataset, settings)
    (folder / "evidence").mkdir()
    write_evidence(report.result, folder / "evidence", settings=settings)
    cause = cause_of(folder / "evidence", LIMITS)
    found = {path.name: path.read_bytes() for path in (folder / "evidence").iterdir()}
    return cause, found, dataset


def same(one, other):
    assert one[0] == other[0]
    assert [name for name in one[1] if one[1][name] != other[1][name]] == []


def test_any_order_and_any_name_of_the_file(episodes, tmp_path):
    order = list(range(EPISODES))
    one = audited(tmp_path / "a", {"a.parquet": order}, episodes)
    assert one[0].text == "hidden_state(scenario)"
    mixed = stream(1, "mixed").permutation(EPISODES).tolist()
    same(one, audited(tmp_path / "b", {"zz.parquet": mixed}, episodes))
    split = dict(zip(one[2].episodes["episode_uuid"], one[2].episodes["split"], strict=True))
    again = load_dataset(tmp_path / "b" / "dataset").episodes
    assert dict(zip(again["episode_uuid"], again["split"], strict=True)) == split
    # Not the first ones of the file train.
    numbers = one[2].episodes["source_file"].str[-6:].astype(int)
    assert numbers[one[2].episodes["split"] == "test"].min() < EPISODES // 2


def test_two_collections_merged_either_way(episodes, tmp_path):
    first, second = list(range(45)), list(range(45, EPISODES))
    one = audited(tmp_path / "a", {"A.parquet": first, "B.parquet": second}, episodes)
    other = audited(tmp_path / "b", {"A.parquet": second[::-1], "B.parquet": first}, episodes)
    assert one[0].text == "hidden_state(scenario)"
    same(one, other)
    assert {row.variable for row in _strata(tmp_path / "a")} >= {"file", "scenario", "heat"}


def _strata(folder):
    return read_rows(folder / "evidence" / "strata.parquet", Stratum)
