"""Recordings of one's own enter the ladder, and no stage writes to them or replaces them."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml

from genpolicy.data.assemble import MANIFEST_FILE
from genpolicy.data.dataset import DATA_FILES
from genpolicy.errors import ConfigError
from genpolicy.integrity.hashing import sha256_tree
from stages._source import KEPT_BY_INGEST, SourceSection, source_files

Stage = Callable[[str], tuple[int, str]]


@pytest.fixture
def run(recorded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A workspace of its own with those recordings, which is the current folder."""
    shutil.copytree(recorded, tmp_path / "run")
    monkeypatch.chdir(tmp_path / "run")
    return tmp_path / "run"


@pytest.fixture
def mine(run: Path, tmp_path: Path) -> Path:
    """The same recordings in a folder of somebody's own."""
    shutil.copytree(run / "artifacts" / "record" / "episodes", tmp_path / "mine")
    return tmp_path / "mine"


@pytest.fixture
def dataset(run: Path, stage: Stage, tmp_path: Path) -> Path:
    """A dataset of them."""
    assert stage("ingest")[0] == 0
    shutil.copytree(run / "artifacts" / "ingest", tmp_path / "dataset")
    return tmp_path / "dataset"


def named(run: Path, edit, kind: str, path: Path) -> None:
    edit(run, lambda params: params.update(source={"kind": kind, "path": str(path)}))


@pytest.mark.parametrize(
    "section", [{"kind": "embedded", "path": "a"}, {"kind": "recordings"}, {"kind": "dataset"}]
)
def test_a_folder_is_named_exactly_where_one_is_read(section):
    with pytest.raises(ValueError, match="embedded has none"):
        SourceSection.model_validate(section)


@pytest.mark.parametrize("name", ["episodes/mine.mcap", "episodes/deep/mine.mcap", "notes.txt"])
def test_a_file_of_somebody_in_the_folder_of_record_stops_the_ladder(run, stage, name):
    foreign = run / "artifacts" / "record" / name
    foreign.parent.mkdir(exist_ok=True)
    foreign.write_bytes(b"mine")
    code, said = stage("task")
    assert code == 2 and name in said and "source" in said
    assert foreign.read_bytes() == b"mine"


def test_a_recording_put_in_place_of_ours_stops_the_ladder(run, stage):
    first = sorted((run / "artifacts" / "record" / "episodes").iterdir())[0]
    first.write_bytes(b"mine")
    assert stage("task")[0] == 2
    assert first.read_bytes() == b"mine"


def test_recordings_put_there_before_the_first_run_stop_the_ladder(workspace, stage):
    folder = workspace / "artifacts" / "record" / "episodes"
    folder.mkdir(parents=True)
    (folder / "mine.mcap").write_bytes(b"mine")
    assert stage("task")[0] == 2


def test_a_file_of_somebody_beside_the_dataset_stops_the_ladder(run, dataset, stage):
    (run / "artifacts" / "ingest" / "mine.parquet").write_bytes(b"mine")
    code, said = stage("task")
    assert code == 2 and "mine.parquet" in said


def test_a_file_of_somebody_where_a_later_stage_writes_stops_the_ladder(run, stage):
    """Bare `dvc repro` as well: this stage runs first, and before DVC empties the others."""
    (run / "dvc.yaml").write_text("stages:\n  audit: {cmd: x, outs: [artifacts/audit]}\n")
    mine = run / "artifacts" / "audit" / "notes.txt"
    mine.parent.mkdir()
    mine.write_bytes(b"mine")
    code, said = stage("task")
    assert code == 2 and "artifacts/audit/notes.txt" in said
    assert mine.read_bytes() == b"mine"


def test_dvc_leaves_its_folder_to_the_stage_that_looks_for_files_of_somebody():
    """Otherwise DVC empties it before; what `candidates` writes is nobody's but its own."""
    stages = yaml.safe_load((Path(__file__).parents[2] / "dvc.yaml").read_text())["stages"]
    assert [name for name, stage in stages.items() if stage.get("always_changed")] == [
        "task", "candidates",
    ]  # fmt: skip
    assert stages["task"]["outs"] == [{"artifacts/task": {"persist": True}}]


def test_what_the_stages_wrote_themselves_stops_nothing(run, dataset, stage):
    assert stage("task") == (0, "")


def test_the_same_recordings_give_the_same_dataset_from_wherever_they_come(
    run, dataset, mine, stage, edit
):
    before = sha256_tree(mine)
    named(run, edit, "recordings", mine)
    for name in ("task", "record", "ingest"):
        assert stage(name) == (0, "")
    assert json.loads((run / "artifacts/record/index.json").read_text())["files"] == {}
    assert sha256_tree(run / "artifacts" / "ingest") == sha256_tree(dataset)
    assert sha256_tree(mine) == before


def test_a_dataset_enters_as_it_is(run, dataset, stage, edit):
    shutil.rmtree(run / "artifacts" / "ingest")
    named(run, edit, "dataset", dataset)
    for name in ("task", "record", "ingest"):
        assert stage(name) == (0, "")
    assert sha256_tree(run / "artifacts" / "ingest") == sha256_tree(dataset)


def test_a_dataset_at_another_rate_is_refused(run, dataset, stage, edit):
    named(run, edit, "dataset", dataset)
    edit(run, lambda params: params["horizons"].update(action_period_s=0.1))
    assert stage("task")[0] == 0
    code, said = stage("ingest")
    assert code == 2 and "0.05 s" in said and "0.1 s" in said


def test_a_damaged_dataset_is_refused(run, dataset, stage, edit):
    table = dataset / "frames.parquet"
    table.write_bytes(table.read_bytes()[:-1] + b"x")
    named(run, edit, "dataset", dataset)
    assert stage("task")[0] == 0
    assert stage("ingest")[0] == 2


@pytest.mark.parametrize("kind", ["recordings", "dataset"])
def test_files_that_change_while_the_ladder_runs_are_refused(run, dataset, mine, stage, edit, kind):
    folder = {"recordings": mine, "dataset": dataset}[kind]
    named(run, edit, kind, folder)
    assert stage("task")[0] == 0
    sorted(folder.iterdir())[0].write_bytes(b"other")
    code, said = stage("ingest")
    assert code == 2 and "other files than at the start" in said


def test_new_recordings_are_seen_by_the_identity(run, mine, stage, edit):
    named(run, edit, "recordings", mine)
    said = []
    for _ in range(2):
        assert stage("task")[0] == 0
        said.append((run / "artifacts/task/source.json").read_bytes())
        sorted(mine.iterdir())[0].unlink()
    assert said[0] != said[1]


@pytest.mark.parametrize("kind", ["recordings", "dataset"])
@pytest.mark.parametrize("make", [True, False])
def test_a_folder_without_recordings_is_refused(tmp_path, kind, make):
    folder = tmp_path / "empty"
    if make:
        folder.mkdir()
    with pytest.raises(ConfigError, match=r"source\.path"):
        source_files(SourceSection(kind=kind, path=str(folder)))


def test_a_folder_where_the_stages_write_is_refused(run):
    section = SourceSection(kind="recordings", path="artifacts/record/episodes")
    with pytest.raises(ConfigError, match="where the stages write"):
        _ = section.folder


def test_the_first_stage_knows_every_file_of_a_dataset_without_loading_what_writes_it():
    assert set(KEPT_BY_INGEST) == {*DATA_FILES, MANIFEST_FILE}


def test_a_device_that_is_not_there_stops_the_ladder_before_anything_else(run, stage, edit):
    """`torch.device` knows the word; the number is beyond what any machine has."""
    edit(run, lambda params: params["compute"].update(device="cuda:4096"))
    shutil.rmtree(run / "artifacts" / "task", ignore_errors=True)
    code, said = stage("task")
    assert code == 2 and "compute.device is 'cuda:4096'" in said
    assert not (run / "artifacts" / "task").exists()
