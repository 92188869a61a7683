"""`genpolicy propose` and `genpolicy ingest`: exit codes, one line per error, nothing half done."""

import importlib.util
import json
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from genpolicy.cli.main import main
from genpolicy.data.dataset import load_dataset


@pytest.fixture(scope="session")
def layouts():
    path = Path(__file__).parents[1] / "data" / "formats" / "conftest.py"
    spec = importlib.util.spec_from_file_location("importers_conftest", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.Layouts


def test_propose_correct_ingest(layouts, tmp_path, capsys):
    root = layouts.v2(tmp_path / "recordings")
    contract = tmp_path / "contract.yaml"
    assert main(["propose", str(root), "--out", str(contract)]) == 0
    text = capsys.readouterr().out
    assert "state_rad (2), state (1)" in text
    assert "Units were guessed" in text
    document = yaml.safe_load(contract.read_text())
    document["task"] = "corrected"
    document["labels"]["task"] = None
    contract.write_text(yaml.safe_dump(document))
    arguments = [str(root), "--contract", str(contract), "--out", str(tmp_path / "out")]
    assert main(["ingest", *arguments]) == 0
    text = capsys.readouterr().out
    assert "accepted  6" in text
    assert load_dataset(tmp_path / "out").manifest["tasks"] == ["corrected"]


def test_a_corrected_contract_is_not_overwritten(layouts, tmp_path, capsys):
    root = layouts.v2(tmp_path / "recordings")
    contract = tmp_path / "contract.yaml"
    contract.write_text("mine")
    arguments = ["propose", str(root), "--out", str(contract)]
    assert main(arguments) == 2
    assert contract.read_text() == "mine"
    assert "--force" in capsys.readouterr().err
    assert main([*arguments, "--force"]) == 0
    assert contract.read_text() != "mine"


def test_json_lists_every_refusal(layouts, tmp_path, capsys):
    root = layouts.v2(tmp_path / "recordings")
    layouts.file(root, 1).write_bytes(b"")
    assert main(["ingest", str(root), "--out", str(tmp_path / "out"), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert (document["found"], document["accepted"]) == (6, 5)
    assert document["refused"][0]["file"] == "data/chunk-000/episode_000001.parquet"


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["ingest", "absent", "--out", "out"], "absent is missing"),
        (["ingest", "recordings", "--out", "out", "--contract", "absent.yaml"], "absent.yaml"),
        (["ingest", "recordings", "--out", "recordings"], "nothing was removed"),
        (["ingest", "recordings", "--out", "out", "--format", "zarr"], "recordings"),
        (["propose", "empty", "--out", "c.yaml"], "of no known layout"),
    ],
)
def test_bad_input_is_one_line_and_code_two(
    layouts, tmp_path, capsys, monkeypatch, arguments, text
):
    monkeypatch.chdir(tmp_path)
    layouts.v2(tmp_path / "recordings")
    (tmp_path / "empty").mkdir()
    assert main(arguments) == 2
    printed = capsys.readouterr()
    assert text in printed.err
    assert len(printed.err.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()
    assert not (tmp_path / "c.yaml").exists()


def test_a_dataset_is_not_ingested_again(layouts, tmp_path, capsys):
    layouts.v2(tmp_path / "recordings")
    main(["ingest", str(tmp_path / "recordings"), "--out", str(tmp_path / "out")])
    assert main(["ingest", str(tmp_path / "out"), "--out", str(tmp_path / "again")]) == 2
    assert "a dataset already" in capsys.readouterr().err


def test_a_fault_of_ours_is_code_one(layouts, tmp_path, capsys, monkeypatch):
    def fail(*_, **__):
        raise RuntimeError("unforeseen")

    monkeypatch.setattr("genpolicy.cli.ingest.open_dataset", fail)
    root = layouts.v2(tmp_path / "recordings")
    assert main(["ingest", str(root), "--out", str(tmp_path / "out")]) == 1
    assert "fault of genpolicy" in capsys.readouterr().err


def test_the_module_runs():
    done = subprocess.run(
        [sys.executable, "-m", "genpolicy", "ingest", "--help"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0
    assert "Examples:" in done.stdout
