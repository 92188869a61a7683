"""Entries of another form than DVC writes are bad configuration, by file, stage and part."""

import pytest

from gates.recorded import require_form
from genpolicy.errors import ConfigError


def test_what_dvc_writes_has_the_form():
    require_form("dvc.yaml", {"a": {"cmd": "x", "deps": ["b", {"c": {"cache": False}}],
                                    "params": ["seed", {"x.yaml": None}]}, "b": 3})  # fmt: skip
    require_form("dvc.lock", {"a": {"deps": [{"path": "b"}], "params": {"params.yaml": {"s": 1}}}})


@pytest.mark.parametrize(("name", "part", "value"), [
    ("dvc.yaml", "deps", 3), ("dvc.yaml", "outs", [None]), ("dvc.yaml", "params", {"a": 1}),
    ("dvc.lock", "deps", ["b"]), ("dvc.lock", "outs", "b"), ("dvc.lock", "params", ["seed"]),
    ("dvc.lock", "params", {"params.yaml": 3}), ("dvc.yaml", "plots", True),
])  # fmt: skip
def test_another_form_is_named(name, part, value):
    stages = {"0": None, "b": {}, "a": {part: value}}
    with pytest.raises(ConfigError, match=rf"{name}: a\.{part} is .*expected what DVC writes"):
        require_form(name, stages)


@pytest.mark.parametrize("name", ["dvc.yaml", "dvc.lock"])
def test_of_several_parts_of_another_form_the_first_is_named(name):
    with pytest.raises(ConfigError, match=rf"{name}: a\.deps is 'x', expected"):
        require_form(name, {"a": {"params": 3, "plots": 2, "outs": 1, "deps": "x"}})
