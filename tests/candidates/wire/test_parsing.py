"""What is wrong with an entry is one sentence: where, what stands there, the rule, what to do."""

import pytest

from genpolicy.candidates.wire.entry import ServerEntry
from genpolicy.candidates.wire.parsing import parse_entry
from genpolicy.errors import ConfigError
from tests.candidates.conftest import ENTRY

ACTION = ENTRY["action"]
TURNED = {"columns": [3, 4, 5, 6], "form": "rotation_6d"}


@pytest.mark.parametrize(
    ("changes", "where", "found", "expected"),
    [
        ({"command": ["serve", "{port}"]}, "",
         "address: 'ws://127.0.0.1:1', command: ['serve', '{port}']",
         "address or command: one of them"),
        ({"action": {**ACTION, "frame": "tcp"}}, ".action",
         "frame: 'tcp', motion: 'absolute'", "motion absolute is in the frame robot_base"),
        ({"action": {**ACTION, "rotation": TURNED}}, ".action.rotation",
         "columns: [3, 4, 5, 6], form: 'rotation_6d'", "rotation_6d has 6 columns, not 4"),
        ({"action": {**ACTION, "motion": "relative"}}, ".action",
         "motion: 'relative'", "the motion relative has an anchor"),
        ({"observation": {"state": {}}}, ".observation.state.channels",
         "missing", "a value of `channels`"),
        ({"adress": "ws://127.0.0.1:1"}, ".adress", "a field that nothing knows", "kind server"),
        ({"timeout_s": 100.0}, ".timeout_s", "100.0", "less than or equal to 60"),
    ],
)  # fmt: skip
def test_a_mistake_names_both_sides_and_what_to_do(changes, where, found, expected):
    with pytest.raises(ConfigError) as error:
        parse_entry(ServerEntry, {**ENTRY, **changes}, where="one.yaml")
    told = error.value
    assert told.where == f"one.yaml{where}"
    assert told.found == found
    assert expected in told.expected
    assert "Value error" not in str(told) and "Field required" not in str(told)
    assert told.action.startswith(("Correct", "Write it"))


def test_a_long_value_is_cut_and_no_dump_is_printed():
    command = ["serve", "{port}", *map(str, range(100))]
    with pytest.raises(ConfigError) as error:
        parse_entry(ServerEntry, {**ENTRY, "command": command}, where="one.yaml")
    assert "…" in error.value.found and len(error.value.found) < 120


@pytest.mark.parametrize(
    "changes",
    [
        {"files": {"weights\0": "0" * 64}},
        {"address": None, "command": ["serve\0", "{port}"]},
        {"constants": {"prompt": "\0"}},
    ],
)
def test_a_text_that_ends_a_path_too_early_is_refused(changes):
    """Wrong before: the machine's own `ValueError` ended whoever read the file or started it."""
    with pytest.raises(ConfigError, match=r"one\.yaml is a text with a character of number 0"):
        parse_entry(ServerEntry, {**ENTRY, **changes}, where="one.yaml")
