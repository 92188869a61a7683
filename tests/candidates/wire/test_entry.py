import pytest
import yaml

from genpolicy.candidates.hosts.kinds import read_entry
from genpolicy.candidates.wire.entry import ServerEntry
from genpolicy.errors import BadInputError, ConfigError
from tests.candidates.conftest import ENTRY


def written(tmp_path, **changes):
    path = tmp_path / "candidate.yaml"
    fields = {key: value for key, value in {**ENTRY, **changes}.items() if value is not None}
    path.write_text(yaml.safe_dump(fields))
    return path


def test_an_entry_is_read_as_it_stands(tmp_path):
    entry = read_entry(written(tmp_path))
    assert entry == ServerEntry.model_validate(ENTRY)
    assert entry.action.width == 10


def action(**changes):
    return {**ENTRY["action"], **changes}


def joints(**changes):
    said = {"motion": "absolute", "joints": {"columns": [0, 1, 2], "unit": "rad"}}
    return {**said, "gripper": {"column": 3, "open": 1.0, "open_m": 1.0}, **changes}


def test_an_entry_may_say_joints_in_place_of_a_pose(tmp_path):
    entry = read_entry(written(tmp_path, action=joints()))
    assert (entry.action.width, entry.action.position, entry.action.frame) == (4, None, None)
    assert ServerEntry.model_validate(entry.model_dump()) == entry


@pytest.mark.parametrize(
    ("changes", "place", "expected"),
    [
        ({"kind": "pickle"}, "kind", "server"),
        ({"name": "My Policy"}, "name", "pattern"),
        ({"name": "my__policy"}, "name", "pattern"),
        ({"name": "policy_"}, "name", "pattern"),
        ({"name": "p" * 65}, "name", "64"),
        ({"author": "somebody"}, "author", "pattern"),
        ({"address": None}, "", "address or command"),
        ({"command": ["serve", "{port}"]}, "", "address or command"),
        ({"address": None, "command": ["serve"]}, "", "write {port}"),
        ({"constants": {"observation": 1}}, "", "given twice"),
        ({"constants": {"genpolicy": 1}}, "", "the word of what is asked"),
        ({"constants": {"seed": 10**20}}, "", "integers of 64 bits"),
        ({"files": {"a": "12"}}, "files.a", "pattern"),
        ({"weights": "x"}, "weights", "fields of a candidate of kind server"),
        ({"action": action(frame="tcp")}, "action", "frame robot_base"),
        ({"action": action(motion="relative")}, "action", "anchor"),
        (
            {"action": action(anchor={"position": ["p"], "rotation": ["r"]})},
            "action", "absolute has no anchor",
        ),
        ({"action": joints(frame="robot_base")}, "action", "stand alone"),
        ({"action": joints(rotation=action()["rotation"])}, "action", "stand alone"),
        ({"action": joints(joints=None)}, "action", "or joints say it"),
        ({"action": joints(motion="relative")}, "action", "anchor"),
        (
            {"action": joints(motion="relative", anchor={"position": ["p"], "rotation": ["r"]})},
            "action", "of a motion of joints",
        ),
        (
            {"action": joints(motion="relative", anchor={"position": ["p"], "joints": ["q"]})},
            "action.anchor", "or joints",
        ),
        (
            {"action": action(motion="relative", anchor={"joints": ["q"]})},
            "action", "of a motion of joints",
        ),
        ({"action": joints(gripper={"column": 2, "open": 1.0, "open_m": 1.0})}, "action", "one"),
        ({"action": joints(joints={"columns": [0], "unit": "turns"})}, "unit", "'deg'"),
        ({"action": action(rotation=None)}, "action", "says its rotation"),
        ({"action": action(position={"columns": [0, 1, 9], "unit": "m"})}, "action", "one thing"),
        ({"action": action(position={"columns": [0, 1, 2], "unit": "inch"})}, "unit", "'mm'"),
        (
            {"action": action(rotation={"columns": [3, 4, 5], "form": "quaternion_xyzw"})},
            "action.rotation", "4 columns, not 3",
        ),
        (
            {"action": action(gripper={"column": 9, "open": 0.0, "open_m": 0.04})},
            "action.gripper", "must differ",
        ),
    ],
)  # fmt: skip
def test_what_is_wrong_is_named_with_its_place(tmp_path, changes, place, expected):
    with pytest.raises(ConfigError) as error:
        read_entry(written(tmp_path, **changes))
    assert place in error.value.where
    assert expected in error.value.expected


def test_a_file_that_is_no_entry(tmp_path):
    path = tmp_path / "candidate.yaml"
    path.write_text("- 1\n")
    with pytest.raises(ConfigError, match="no map of settings"):
        read_entry(path)
    with pytest.raises(BadInputError, match="not readable"):
        read_entry(tmp_path / "absent.yaml")
