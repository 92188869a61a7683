"""`contract.yaml` and `fixtures.yaml` with a wrong value at a place: bad input, nothing written."""

import importlib.util
import shutil
import sys
from pathlib import Path

import pytest
import yaml

from genpolicy.cli.main import main

sys.path.insert(0, str(Path(__file__).parents[1]))

from damaged import broken_bytes, damaged

ROOT = Path(__file__).parents[2]
TRIED = 12


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """A LeRobot data set, and the contract that was proposed for it."""
    path = ROOT / "tests" / "data" / "formats" / "conftest.py"
    spec = importlib.util.spec_from_file_location("importers_conftest", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    root = tmp_path_factory.mktemp("contract")
    folder = module.Layouts.v2(root / "recordings")
    assert main(["propose", str(folder), "--out", str(root / "contract.yaml")]) == 0
    return root


def told(what, words, capsys):
    """The exit code; where it is not 0, one line says where, found, expected and what to do."""
    capsys.readouterr()
    code = main(words)
    printed = capsys.readouterr()
    assert code in (0, 2), (what, printed.err)
    assert "Traceback" not in printed.err
    if code == 2:
        lines = printed.err.strip().splitlines()
        assert lines and lines[-1].startswith("genpolicy "), (what, lines)
        assert ", expected " in lines[-1] and lines[-1].endswith("."), (what, lines)
    return code


def test_a_contract(recordings, tmp_path, capsys):
    kept = (recordings / "contract.yaml").read_bytes()
    contract, out = tmp_path / "contract.yaml", tmp_path / "out"
    words = ["ingest", str(recordings / "recordings"), "--contract", str(contract),
             "--out", str(out)]  # fmt: skip
    document, codes = yaml.safe_load(kept), []
    for what, data in [*damaged("contract", document, each=1, limit=TRIED), *broken_bytes(kept)]:
        contract.write_bytes(data)
        codes.append(told(what, words, capsys))
        assert out.exists() == (codes[-1] == 0), what
        shutil.rmtree(out, ignore_errors=True)
        assert sorted(path.name for path in tmp_path.iterdir()) == ["contract.yaml"], what
    assert codes.count(2) > len(codes) / 2


def test_pins_of_the_fixtures(tmp_path, capsys):
    kept = (ROOT / "fixtures.yaml").read_bytes()
    document, codes = yaml.safe_load(kept), []
    for what, data in [*damaged("pins", document, each=1, limit=TRIED), *broken_bytes(kept)]:
        (tmp_path / "fixtures.yaml").write_bytes(data)
        words = ["fixtures", "--task", "tabletop_insertion", "--root", str(tmp_path)]
        codes.append(told(what, words, capsys))
        assert (tmp_path / "fixtures.yaml").read_bytes() == data
    assert codes.count(0) <= 1  # one of them is the whole file, twice, which YAML may refuse
