"""Policies that were brought: entries are read, and files held against their hashes."""

import pytest
import yaml

from genpolicy.candidates.brought import read_brought, require_brought
from genpolicy.candidates.contenders import admitted_contenders, in_comparison
from genpolicy.contract.planner import PLANNER
from genpolicy.errors import ConfigError, IntegrityError
from genpolicy.integrity.hashing import sha256_file
from tests.candidates.conftest import ENTRY
from tests.conftest import HORIZONS


@pytest.fixture
def brought(tmp_path):
    """Writes an entry with a file of weights; returns the section that names it."""
    (tmp_path / "own").mkdir()
    weights = tmp_path / "own" / "weights.bin"
    weights.write_bytes(b"weights")

    def write(**changes):
        entry = {**ENTRY, "files": {"weights.bin": sha256_file(weights)}, **changes}
        (tmp_path / "own" / "planted.yaml").write_text(yaml.safe_dump(entry))
        return {"planted": "own/planted.yaml"}

    return write


def test_who_was_brought_is_its_entry(brought, tmp_path):
    (one,) = read_brought(brought(), seed=3, root=tmp_path)
    (same,) = read_brought(brought(), seed=3, root=tmp_path)
    (other,) = read_brought(brought(timeout_s=4.0), seed=3, root=tmp_path)
    assert (one.name, one.seed, one.folder) == ("planted", 3, tmp_path / "own")
    assert one.sha256 == same.sha256 != other.sha256
    assert one.sampler_sha256 != other.sampler_sha256


def test_the_files_are_part_of_who_it_is(brought, tmp_path):
    (one,) = read_brought(brought(), seed=0, root=tmp_path)
    (other,) = read_brought(brought(files={"weights.bin": "0" * 64}), seed=0, root=tmp_path)
    assert one.sha256 != other.sha256


def test_a_changed_file_is_refused_before_anything_runs(brought, tmp_path):
    section = brought()
    assert len(require_brought(section, horizons=HORIZONS, root=tmp_path)) == 1
    (tmp_path / "own" / "weights.bin").write_bytes(b"weightz")
    with pytest.raises(IntegrityError, match="planted"):
        require_brought(section, horizons=HORIZONS, root=tmp_path)


def test_what_is_wrong_with_a_file_says_what_its_author_can_do(brought, tmp_path):
    """No stage writes it, so that there is none to run again."""
    section, weights = brought(), tmp_path / "own" / "weights.bin"

    def action():
        with pytest.raises(IntegrityError) as error:
            require_brought(section, horizons=HORIZONS, root=tmp_path)
        assert "stage" not in error.value.action
        return error.value.action

    weights.write_bytes(b"weightz")
    assert "into `files` (weights.bin)" in action()
    weights.rename(tmp_path / "blob")
    assert "Put it there" in action()
    weights.symlink_to(tmp_path / "blob")  # as in a cache of Hugging Face
    assert "`cp -rL`" in action()


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"name": "another"}, r"candidates\.planted.*the entry of another"),
        ({"horizons": {**ENTRY["horizons"], "prediction_horizon": 32}},
         "prediction_horizon 32.*prediction_horizon 16"),
    ],
)  # fmt: skip
def test_what_the_ladder_cannot_work_with_is_refused_by_name(brought, tmp_path, changes, told):
    with pytest.raises(ConfigError, match=told):
        require_brought(brought(**changes), horizons=HORIZONS, root=tmp_path)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"address": "http://127.0.0.1:8000"}, r"address is 'http://.*expected ws://HOST:PORT"),
        ({"address": "nonsense"}, r"planted\.yaml\.address is 'nonsense', expected ws://HOST:PORT"),
        ({"address": "ws://192.168.0.7:8000"}, "192.168.0.7, another machine.*`allow_host`"),
        ({"address": "ws://192.168.0.7:8000", "allow_host": "192.168.0.8"}, "another machine"),
    ],
)
def test_where_nobody_may_be_asked_is_refused_before_anything_runs(
    brought, tmp_path, changes, told
):
    with pytest.raises(ConfigError, match=told):
        require_brought(brought(**changes), horizons=HORIZONS, root=tmp_path)
    with pytest.raises(ConfigError, match=told):
        read_brought(brought(**changes), seed=0, root=tmp_path)


def test_another_machine_that_is_allowed_is_no_mistake(brought, tmp_path):
    section = brought(address="ws://192.168.0.7:8000", allow_host="192.168.0.7")
    assert len(require_brought(section, horizons=HORIZONS, root=tmp_path)) == 1


def test_files_of_another_form_are_refused_before_anything_runs(tmp_path):
    """What is read is not run: see tests of `hosts.forms` for each form."""
    (tmp_path / "planner.py").write_text("open('it_ran', 'w')\n")
    entry = {name: value for name, value in ENTRY.items() if name != "address"} | {
        "kind": "scripted", "function": "planner:plan", "stochastic": False,
        "files": {"planner.py": sha256_file(tmp_path / "planner.py")},
    }  # fmt: skip
    (tmp_path / "planted.yaml").write_text(yaml.safe_dump(entry))
    with pytest.raises(ConfigError, match=r"planner\.py is a module without the function plan"):
        require_brought({"planted": "planted.yaml"}, horizons=HORIZONS, root=tmp_path)
    assert not (tmp_path / "it_ran").exists()


def test_a_program_that_is_not_there_is_refused_before_anything_runs(brought, tmp_path):
    def require(*command):
        section = brought(address=None, command=[*command, "{port}"])
        return require_brought(section, horizons=HORIZONS, root=tmp_path)

    (tmp_path / "own" / "serve").write_text("#!/bin/sh")
    for program in ("no_such_program", "./missing", "./serve"):  # the last is not executable
        with pytest.raises(ConfigError, match=f"command of the candidate planted.*{program}"):
            require(program)
    (tmp_path / "own" / "serve").chmod(0o755)
    assert len(require("./serve")) == len(require("sh")) == 1


def test_a_name_means_one_policy(brought, tmp_path):
    with pytest.raises(ConfigError, match="a name that a trained method has"):
        require_brought(brought(), horizons=HORIZONS, trained=["planted"], root=tmp_path)


def test_who_stands_is_who_was_admitted_in_its_order(fleet, brought, tmp_path):
    (tmp_path / "train_generators").symlink_to(fleet[0])
    (tmp_path / "train_baselines").symlink_to(fleet[0])
    others = read_brought(brought(), seed=0, root=tmp_path)
    found = admitted_contenders(tmp_path, ["planted", "flow"], others, seed=0, device="cpu")
    assert [one.name for one in found] == ["planted", "flow"]
    assert admitted_contenders(tmp_path, ["flow"], others, seed=0, device="cpu")[0].name == "flow"
    compared = in_comparison(
        tmp_path, baselines=["bc", PLANNER], candidates=["flow", "planted"], brought=others, seed=0,
        device="cpu", task="tabletop_insertion", horizons=HORIZONS,
    )  # fmt: skip
    assert [one.name for one in compared] == ["bc", PLANNER, "flow", "planted"]
    only = in_comparison(
        tmp_path, baselines=["bc"], candidates=["flow"], brought=others, seed=0, device="cpu",
        task="tabletop_insertion", horizons=HORIZONS,
    )  # fmt: skip
    assert [one.name for one in only] == ["bc", "flow"]
