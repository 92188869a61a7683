"""Workspaces: overrides of parameters, and what is copied and refreshed."""

import os
from pathlib import Path

import pytest
import yaml

from flows.workspace import declared_outputs, make_workspace, merged
from genpolicy.errors import BadInputError, ConfigError


def test_only_the_overridden_leaf_changes() -> None:
    base = {"a": {"x": 1, "y": [1, 2]}, "b": 2}
    assert merged(base, {"a": {"x": 5}}) == {"a": {"x": 5, "y": [1, 2]}, "b": 2}
    assert base["a"] == {"x": 1, "y": [1, 2]}
    assert merged(base, {}) == base


def test_a_section_that_stands_empty_takes_keys_that_its_stage_knows() -> None:
    assert merged({"a": {"z": {}}}, {"a": {"z": {"n": 2}}}) == {"a": {"z": {"n": 2}}}


@pytest.mark.parametrize(
    ("overrides", "place"),
    [
        ({"c": 1}, "override c is not a key"),
        ({"a": {"z": 1}}, "override a.z is not a key"),
        ({"a": 3}, "override a is a int, expected a dict"),
        ({"b": {"x": 1}}, "override b is a dict, expected a int"),
    ],
)
def test_an_override_that_fits_nothing_is_refused(overrides: dict, place: str) -> None:
    with pytest.raises(ConfigError, match=place):
        merged({"a": {"x": 1}, "b": 2}, overrides)


def test_copies_what_git_would_track_and_nothing_that_stages_write(
    checkout: Path, tmp_path: Path
) -> None:
    (checkout / "reports").mkdir()
    (checkout / "reports" / "gate_a.md").write_text("of the checkout")
    (checkout / "artifacts" / "record").mkdir(parents=True)
    (checkout / "dvc.lock").write_text("schema: '2.0'\n")
    target = make_workspace(checkout, tmp_path / "other", {"record": {"value": 7}})
    names = {p.relative_to(target).as_posix() for p in target.rglob("*") if p.is_file()}
    expected = {"stage.py", "dvc.yaml", "params.yaml", ".gitignore", ".dvc/config"}
    assert names == expected | {".workspace.json"}
    assert yaml.safe_load((target / "params.yaml").read_text())["record"]["value"] == 7
    config = (target / ".dvc" / "config").read_text()
    assert "no_scm = True" in config
    assert "analytics = false" in config


def test_a_refresh_touches_only_differences(checkout: Path) -> None:
    (checkout / "old.py").write_text("1")
    target = make_workspace(checkout, checkout / "build" / "small", {})
    (target / "artifacts").mkdir()
    (target / "artifacts" / "mine.txt").write_text("kept")
    os.utime(target / "stage.py", ns=(10**9, 10**9))
    (checkout / "old.py").unlink()
    (checkout / "new.py").write_text("2")
    make_workspace(checkout, target, {})
    assert (target / "stage.py").stat().st_mtime_ns == 10**9
    assert (target / "new.py").read_text() == "2"
    assert not (target / "old.py").exists()
    assert (target / "artifacts" / "mine.txt").read_text() == "kept"
    assert not (target / "build").exists()


def test_a_folder_with_other_things_is_left_alone(checkout: Path, tmp_path: Path) -> None:
    target = tmp_path / "home"
    target.mkdir()
    (target / "precious.txt").write_text("mine")
    with pytest.raises(BadInputError, match="a folder with something else in it"):
        make_workspace(checkout, target, {})
    assert [p.name for p in target.iterdir()] == ["precious.txt"]


def test_outputs_of_every_kind_are_found() -> None:
    stage = {"outs": ["a", {"b": {"cache": False}}], "metrics": [{"m.json": {}}], "plots": ["p"]}
    assert declared_outputs({"stages": {"s": stage}}) == ("a", "b", "m.json", "p")


def test_an_override_may_declare_a_criterion_not_applicable_in_place_of_its_limit() -> None:
    base = {"gate_d": {"limits": {"safety": {"force": [80, "why"], "stub": [0, "why"]}}}}
    waived = {"not_applicable": {"safety": {"force": "twelve starts"}}}
    assert merged(base, {"gate_d": waived}) == {
        "gate_d": {"limits": {"safety": {"stub": [0, "why"]}}, **waived}
    }
    with pytest.raises(ConfigError, match="not_applicable is not a key"):
        merged({"record": {"episodes": 3}}, {"record": waived})


def test_an_override_may_name_who_answers_for_a_question_that_was_not_asked() -> None:
    base = {"gate_a": {"limits": {"safety": {"force": [80, "why"]}}}}
    waived = {"waived_checks": {"model": {"past.approach": "too few episodes"}}}
    assert merged(base, {"gate_a": waived}) == {"gate_a": {**base["gate_a"], **waived}}
    with pytest.raises(ConfigError, match="waived_checks is not a key"):
        merged({"record": {"episodes": 3}}, {"record": waived})
