"""contract.yaml: there and back, and every way to contradict itself."""

from pathlib import Path

import pytest
import yaml

from genpolicy.data.contract import TCP_ACTION
from genpolicy.data.formats.contract import (
    contract_of,
    dump_contract,
    load_contract,
    selectors,
    write_contract,
)
from genpolicy.errors import BadInputError


def document(**changes):
    plain = {
        "format": "parquet",
        "task": "push",
        "rate_hz": 10.0,
        "channels": [
            {
                "name": "hand_m",
                "columns": ["state[0:2]"],
                "components": ["x", "y"],
                "unit": "mm",
                "stream": "state",
            },
            {
                "name": "yaw",
                "columns": ["yaw_deg"],
                "components": ["cos", "sin"],
                "unit": "deg",
                "stream": "state",
                "transform": "cos_sin",
            },
        ],
        "action": {"columns": ["ax", "ay"], "components": ["x", "y"], "units": ["m", "m"]},
        "pairing": {"x": "hand_m.x", "y": "hand_m.y"},
    }
    return {**plain, **changes}


def test_round_trip(tmp_path):
    contract = contract_of(document(), where="here")
    write_contract(tmp_path / "contract.yaml", contract)
    assert load_contract(tmp_path / "contract.yaml") == contract
    assert dump_contract(contract) == (tmp_path / "contract.yaml").read_bytes()
    assert (tmp_path / "contract.yaml").read_text().startswith("# How these recordings")


def test_units_of_the_dataset_are_si():
    contract = contract_of(document(), where="here")
    assert [channel.unit for channel in contract.observation.channels] == ["m", "1"]
    assert contract.channels[0].factor == 1e-3
    assert contract.action_contract.units == ("m", "m")


def test_the_project_s_own_action_keeps_its_hash():
    action = {
        "columns": [f"action[0:{TCP_ACTION.dim}]"],
        "components": list(TCP_ACTION.components),
        "units": list(TCP_ACTION.units),
        "frame": TCP_ACTION.frame,
    }
    contract = contract_of(document(action=action, pairing=None), where="here")
    assert contract.action_contract == TCP_ACTION


def changed(part, **changes):
    return {part: {**document()[part], **changes}}


def channel(**changes):
    return {"channels": [{**document()["channels"][0], **changes}], "pairing": None}


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"speed": 1}, "speed"),
        ({"rate_hz": 0.0}, "rate_hz"),
        ({"rate_hz": "10"}, "rate_hz"),
        ({"format": "rosbag"}, "format"),
        ({"channels": []}, "channels"),
        (channel(columns=["state[0:3]"]), "2 names, expected 3"),
        (channel(columns=["state[2:2]", "x"]), "rising range"),
        (channel(columns=["state[0:9999]"]), "rising range"),
        (channel(columns=["state[-1]", "x"]), "`name`"),
        (channel(components=["x", "x"]), "stands twice"),
        (channel(name="hand m"), "name"),
        (channel(transform="cos_sin", columns=["a"]), "rad or deg"),
        ({"channels": [document()["channels"][0]] * 2}, "stands twice"),
        (changed("action", units=["m"]), "1 units for 2 numbers"),
        (changed("action", units=["m", "rad"]), "one unit on both sides"),
        ({"pairing": {}}, "one to one"),
        ({"pairing": {"x": "hand_m.x", "y": "hand_m.x"}}, "one to one"),
        ({"pairing": {"z": "hand_m.x"}}, "names of the action"),
        ({"pairing": {"x": "hand_m.z"}}, "names of the action"),
        ({"ranges": {"hand_m.z": [0.0, 1.0]}}, "ranges"),
        ({"ranges": {"hand_m.x": [1.0, 0.0]}}, "lower and an upper"),
        ({"frozen": {"streams": ["head"], "seconds": 1.0, "motion": 1.0}}, "frozen.streams"),
        ({"joint_range_rad": [[1.0]]}, "lower and upper"),
        ({"labels": {"colour": "c"}}, "colour"),
        ({"minimum_rows": 1}, "minimum_rows"),
    ],
)
def test_a_contradiction_is_refused_with_its_place(changes, text):
    with pytest.raises(BadInputError, match=text) as caught:
        contract_of(document(**changes), where="here")
    assert str(caught.value).startswith("here")


@pytest.mark.parametrize("text", ["- a\n", "a: 1\na: 2\n", "x: !!python/name:os.system\n", ""])
def test_a_document_that_is_no_contract(tmp_path: Path, text):
    path = tmp_path / "contract.yaml"
    path.write_text(text)
    with pytest.raises(BadInputError, match=r"contract\.yaml"):
        load_contract(path)


def test_selectors():
    found = selectors(["a", "b[2]", "c[0:2]", "obs/x y"[:5]], where="here")
    assert [(s.column, s.element) for s in found] == [
        ("a", None), ("b", 2), ("c", 0), ("c", 1), ("obs/x", None),
    ]  # fmt: skip
    assert yaml.safe_load(dump_contract(contract_of(document(), where="here")))["task"] == "push"
