"""Plain Parquet: long tables, files per episode, and tables that lie."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from long_tables import UUIDS, rows

from genpolicy.data.dataset import load_dataset
from genpolicy.data.formats import open_dataset, propose
from genpolicy.data.formats.contract import load_contract, write_contract
from genpolicy.errors import BadInputError


@pytest.fixture
def long(layouts, tmp_path):
    path = tmp_path / "long.parquet"
    pq.write_table(pa.concat_tables([rows(layouts, i) for i in range(8)]), path, row_group_size=70)
    return path


def rewrite(path, layouts, number, **changes):
    parts = [rows(layouts, i, **(changes if i == number else {})) for i in range(8)]
    pq.write_table(pa.concat_tables(parts), path, row_group_size=70)


def test_a_long_table(long, layouts, tmp_path):
    opened = open_dataset(long, out=tmp_path / "out")
    assert (opened.found, opened.accepted) == (8, 8)
    contract = opened.contract
    assert contract.pairing == {"action_tool_x_m": "tool_m.x", "action_tool_y_m": "tool_m.y"}
    assert [(c.name, c.unit) for c in contract.channels] == [("tool_m", "m"), ("load_n", "N")]
    assert contract.rate_hz == 20.0
    assert contract.time_origin == "recording"
    dataset = load_dataset(tmp_path / "out")
    assert dataset.episodes["episode_uuid"].tolist() == UUIDS
    assert dataset.episodes["operator"].tolist() == ["op0", "op1"] * 4
    assert dataset.episodes["outcome"].tolist()[3:6] == ["success", "failure", "success"]
    assert dataset.manifest["phases"] == ["hold", "reach"]
    np.testing.assert_allclose(
        dataset.frames.event_time_s[dataset.frames.episode == 3], 300 + np.arange(30) / 20
    )
    assert "picture" in " ".join(opened.notes)


FAULTS = {
    "step, row 5": {"step": np.arange(30) + (np.arange(30) >= 5)},
    "timestamp, row 6": {"timestamp": 300 + np.where(np.arange(30) == 6, 0, np.arange(30)) / 20},
    "timestamp, row 2 is 1e+30": {"timestamp": [300.0, 300.05] + [1e30] * 28},
    "row 8, column tool_x_m is nan": {"tool_x_m": pa.array([0.0] * 8 + [None] + [0.1] * 21)},
    "row 9, column action_tool_y_m is inf": {
        "action_tool_y_m": np.where(np.arange(30) == 9, np.inf, 0.0)
    },
    "operator, row 12": {"operator": ["op0"] * 12 + ["op1"] * 18},
    "is 'x', expected a lower-case UUID": {"episode_uuid": ["x"] * 30},
    "expected a lower-case UUID": {"episode_uuid": [UUIDS[3].replace("8", "A")] * 30},
}


@pytest.mark.parametrize("reason", list(FAULTS))
def test_a_bad_episode_is_refused_by_name_with_row_and_reason(long, layouts, tmp_path, reason):
    rewrite(long, layouts, 3, **FAULTS[reason])
    opened = open_dataset(long, out=tmp_path / "out")
    assert (opened.found, opened.accepted) == (8, 7)
    assert reason in opened.refused[0].reason
    assert opened.refused[0].file.startswith("long.parquet#")


@pytest.mark.parametrize("data", [b"", b"PAR1", b"PAR1" + bytes(100) + b"PAR1", b"x" * 50])
def test_no_parquet_at_all(tmp_path, data):
    path = tmp_path / "x.parquet"
    path.write_bytes(data)
    with pytest.raises(BadInputError, match=r"x\.parquet"):
        open_dataset(path, out=tmp_path / "out")


def test_what_will_be_refused_decides_nothing_of_the_proposal(long, layouts):
    clean = propose(long)
    rewrite(long, layouts, 0, action_tool_x_m=np.full(30, np.nan))
    assert propose(long) == clean.model_copy(update={"frozen": propose(long).frozen})
    assert propose(long).frozen is not None


def test_a_corrected_contract_decides(long, layouts, tmp_path):
    contract = propose(long)
    lowest = [layouts.samples(i)[0][:, 0].min() for i in range(8)]
    limit = float(np.median(lowest))
    edited = contract.model_copy(
        update={
            "ranges": {"tool_m.x": [limit, 2.0]},
            "labels": contract.labels.model_copy(update={"phase": None}),
        }
    )
    write_contract(tmp_path / "contract.yaml", edited)
    opened = open_dataset(
        long, out=tmp_path / "out", contract=load_contract(tmp_path / "contract.yaml")
    )
    assert len(opened.refused) == sum(low < limit for low in lowest) > 0
    assert "tool_m.x" in opened.refused[0].reason
    assert load_dataset(tmp_path / "out").manifest["phases"] == ["all"]


def test_a_contract_that_names_what_is_not_there(long, tmp_path):
    contract = propose(long)
    for part, text in (
        (
            {"channels": [contract.channels[0].model_copy(update={"columns": ["a", "b"]})]},
            "column a",
        ),
        (
            {
                "channels": [
                    contract.channels[0].model_copy(update={"columns": ["tool_x_m[3]", "step"]})
                ]
            },
            "tool_x_m is 1 numbers wide, expected element 3",
        ),
        (
            {"channels": [contract.channels[0].model_copy(update={"columns": ["phase", "step"]})]},
            "phase is not numbers per row",
        ),
        ({"labels": contract.labels.model_copy(update={"object": "thing"})}, "label object"),
    ):
        with pytest.raises(BadInputError, match=text):
            open_dataset(long, out=tmp_path / "out", contract=contract.model_copy(update=part))
