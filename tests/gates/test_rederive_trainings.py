"""What further training seeds gave is held as the first one is, and said to be of whom it is."""

import json
import shutil

import pytest
import yaml
from makers import write_policy
from test_rederive import TABLES, root  # noqa: F401

from gates import rederive as module
from gates.rederive import STRESS, rederive
from gates.rederive_trainings import only_seed, seed_folders
from genpolicy.errors import RefusedError
from genpolicy.evidence.documents.stress import folder_of_seed
from genpolicy.evidence.rows.stress import RolloutRow
from genpolicy.integrity.rows import write_rows
from genpolicy.integrity.tables import read_table, write_table
from genpolicy.verification.journal_source import read_messages

FURTHER = f"{STRESS}/{folder_of_seed(1)}"


@pytest.fixture
def trained(root):  # noqa: F811
    """The same rollouts once more, as those of a training that came to the same weights."""
    for method in ("flow", "bc"):
        write_policy(root, method, seed=1)
    folder = root / FURTHER
    own = [path for path in (root / STRESS).iterdir() if path.name != "power.json"]
    folder.mkdir(parents=True)
    for path in own:
        (shutil.copytree if path.is_dir() else shutil.copy)(path, folder / path.name)
    for name in ("rollouts", "recoveries", "invocations"):
        path = folder / f"{name}.parquet"
        table = read_table(path)
        place = table.schema.get_field_index("seed")
        seeds = [[1] * table.num_rows]
        write_table(path, table.set_column(place, table.schema.field(place), seeds))
    (root / STRESS / "trainings.json").write_text(json.dumps({"seeds": [1]}))
    plan(root, [0, 1])
    return root


def plan(root, seeds):  # noqa: F811
    params = yaml.safe_load((root / "params.yaml").read_text())
    params["policy"]["seeds"] = seeds
    (root / "params.yaml").write_text(yaml.safe_dump(params))


def test_true_evidence_of_two_trainings_stands(trained):
    rederive(trained, "D")
    rows = read_table(trained / FURTHER / "rollouts.parquet").to_pylist()
    assert {row["seed"] for row in rows} == {1}


@pytest.mark.parametrize(("column", "value"), [
    ("success", True), ("outcome", "success"), ("seed", 0), ("duration_s", 0.1),
])  # fmt: skip
def test_a_forged_row_of_a_further_training_is_refused_by_name(trained, column, value):
    path = trained / FURTHER / "rollouts.parquet"
    rows = read_table(path).to_pylist()
    write_rows(path, RolloutRow, [RolloutRow(**{**rows[0], column: value}),
                                  *(RolloutRow(**row) for row in rows[1:])])  # fmt: skip
    with pytest.raises(
        RefusedError, match=rf"training seed 1: rollout flow/nominal/0: {column} is"
    ):
        rederive(trained, "D")


FORGED = {
    "counts": ("count", 3), "stub": ("stale", 1), "invocations": ("latency_s", 0.001),
    "recoveries": ("recovered", True), "conservation": ("generated", 9),
}  # fmt: skip


@pytest.mark.parametrize("name", FORGED)
def test_every_other_table_of_it_is_held(trained, name):
    column, value = FORGED[name]
    path = trained / FURTHER / f"{name}.parquet"
    rows = read_table(path).to_pylist()
    write_rows(path, TABLES[name], [TABLES[name](**{**rows[0], column: value}),
                                    *(TABLES[name](**row) for row in rows[1:])])  # fmt: skip
    with pytest.raises(RefusedError, match=rf"training seed 1: .*{column} is {value}"):
        rederive(trained, "D")


@pytest.mark.parametrize("file", ["checker.json", "envelope.json"])
def test_its_documents_are_held(trained, file):
    path = trained / FURTHER / file
    document = json.loads(path.read_text())
    key = "checked_actions" if file == "checker.json" else "speed_limit_m_s"
    path.write_text(json.dumps(document | {key: 7}))
    with pytest.raises(RefusedError, match=rf"training seed 1: {FURTHER}/{file}: {key} is 7"):
        rederive(trained, "D")


def test_a_rollout_of_another_checkpoint_is_refused(trained):
    """The journals are of the weights of the first: those of seed 1 are others now."""
    weights = trained / "artifacts/train_generators/flow/seed_1/model.safetensors"
    weights.write_bytes(b"of another training")
    with pytest.raises(RefusedError, match=r"training seed 1: flow__.*made by"):
        rederive(trained, "D")


def test_its_commands_are_played_again_and_its_chunks_drawn_again(trained, monkeypatch):
    played, drawn = [], []
    monkeypatch.setattr(module, "rederive_outcomes", lambda params, paths: played.append(paths))
    monkeypatch.setattr(
        module, "rederive_rollout_draws",
        lambda _, params, paths: drawn.append((params["policy"]["seeds"], paths)),
    )  # fmt: skip
    rederive(trained, "D")
    own = sorted((trained / FURTHER / "journals").glob("*.mcap"))
    assert played[1] == own and drawn[1] == ([1], own)
    assert [seeds for seeds, _ in drawn] == [[0, 1], [1]]
    assert all(next(iter(read_messages(path))) for path in own)


def test_a_training_that_is_not_planned_or_not_there_is_refused(trained):
    plan(trained, [0])
    with pytest.raises(RefusedError, match=r"trainings\.json: seeds is \[1\], required None"):
        rederive(trained, "D")
    (trained / STRESS / "trainings.json").unlink()
    with pytest.raises(RefusedError, match=r"further trainings is artifacts/stress/seeds/1"):
        rederive(trained, "D")
    plan(trained, [0, 1, 2])
    (trained / STRESS / "trainings.json").write_text(json.dumps({"seeds": [1, 2]}))
    with pytest.raises(RefusedError, match="one folder of each"):
        rederive(trained, "D")


def test_folders_are_those_of_the_plan(tmp_path):
    assert seed_folders(tmp_path, {"policy": {"seeds": [4]}}) == {}
    assert only_seed({"seed": 1, "policy": {"seeds": [0, 3], "a": 2}}, 3) == {
        "seed": 1, "policy": {"seeds": [3], "a": 2}
    }  # fmt: skip
